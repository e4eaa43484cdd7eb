"""A running `tagmap serve` and a robot that speaks to it, for tests through the real link."""

import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import Ack, AdminReply, AdminRequest, decode, encode

PATIENCE_S = 60.0


class Serve:
    """The service as a child process; `log` is the file with its stderr."""

    def __init__(self, folder, endpoint):
        self.folder, self.endpoint, self.process = folder, endpoint, None
        self.log = folder / "service.log"

    def start(self, *arguments):
        command = [sys.executable, "-m", "tagmap.cli", "serve", "--listen", self.endpoint]
        with self.log.open("ab") as log:
            self.process = subprocess.Popen([*command, *arguments], cwd=self.folder, stderr=log)
        return self

    def kill(self):
        self.process.kill()
        self.process.wait()

    def stop(self):
        """Exit status after SIGTERM."""
        self.process.send_signal(signal.SIGTERM)
        return self.process.wait(PATIENCE_S)


class Client:
    """A robot and an administrator in one, with everything that was put for them."""

    def __init__(self, endpoint, robot="r1"):
        self.keys, self.robot = Keys("site"), robot
        self.link = Link.open([endpoint], wait_s=PATIENCE_S)
        self.heard = []
        self.link.subscribe(f"{self.keys.root}/robots/**", self._hear)
        self.link.subscribe(f"{self.keys.root}/map/**", self._hear)

    def _hear(self, key, payload):
        self.heard.append((key, payload))

    def send(self, *messages):
        for message in messages:
            payload = message if isinstance(message, bytes) else encode(message)
            self.link.put(self.keys.keyframes(self.robot), payload)

    def ask(self, selector, payload=None):
        return self.link.ask(selector, payload, timeout_s=PATIENCE_S)

    def ack(self, session):
        (reply,) = self.ask(f"{self.keys.ack(self.robot)}?session={session}")
        if reply.payload is None:
            return Ack(session=session, contiguous=-1)
        return decode(Ack, reply.payload)

    def deliver(self, *messages):
        """As an agent does: send again until everything is settled; the last acknowledgement."""
        session, last = messages[0].session, max(message.seq for message in messages)
        give_up_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < give_up_s:
            self.send(*messages)
            patience_s = time.monotonic() + 2.0
            while time.monotonic() < patience_s:
                ack = self.ack(session)
                if ack.contiguous >= last:
                    return ack
                time.sleep(0.02)
        raise AssertionError(f"only {ack.contiguous} of {last} settled")

    def admin(self, noun, verb, **args):
        (reply,) = self.ask(self.keys.admin(noun, verb), encode(AdminRequest(args=args)))
        answer = decode(AdminReply, reply.payload, 2**26)
        assert answer.error is None, answer.error
        return answer.data


@pytest.fixture
def serve(tmp_path, endpoint, request) -> Iterator[Serve]:
    request.getfixturevalue("compiled_solver")
    serve = Serve(tmp_path, endpoint)
    yield serve
    if serve.process is not None and serve.process.poll() is None:
        serve.kill()


@pytest.fixture
def client(serve) -> Iterator[Client]:
    """Of a service that has just been started."""
    serve.start()
    client = Client(serve.endpoint)
    yield client
    client.link.close()
