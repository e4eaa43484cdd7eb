"""`robot-agent run` as a process, a real router, and a service that only stores and acknowledges.

What is killed here is killed with SIGKILL, in the middle of the work.
"""

import contextlib
import json
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tagmap.link.keys import Keys
from tagmap.link.query import Query
from tagmap.link.router import RouterProcess
from tagmap.link.session import Link
from tagmap.records import Ack, encode
from tagmap.store.outbox import Outbox

Journal = Callable[[int], Path]
Eventually = Callable[[Callable[[], bool]], None]

MANY = 6000
PAUSE_S = 0.01
PATIENCE_S = 60.0


class AckingService:
    """Stores what arrives in batches and acknowledges after each; what it queued dies with it."""

    def __init__(self, endpoint: str, ledger: Any) -> None:
        self.ledger = ledger
        self.keys = Keys("site")
        self.queue: list[tuple[str, bytes]] = []
        self.lock = threading.Lock()
        self.ended = threading.Event()
        self.link = Link.open([endpoint], wait_s=PATIENCE_S)
        self.link.subscribe(self.keys.keyframes(), self.enqueue, capacity=4096)
        self.link.serve(self.keys.ack(), self.answer)
        self.thread = threading.Thread(target=self.work)
        self.thread.start()

    def enqueue(self, key: str, payload: bytes) -> None:
        with self.lock:
            self.queue.append((key, payload))

    def answer(self, query: Query) -> None:
        session = query.parameters["session"]
        if session in self.ledger.contiguous:
            with self.lock:
                ack = self.ledger.ack(session)
            query.reply(query.key, encode(ack))
        else:
            query.reply_error("never heard of")

    def work(self) -> None:
        while not self.ended.wait(PAUSE_S):
            with self.lock:
                told = dict(self.ledger.contiguous)
                touched = {
                    (self.keys.robot_of(key), self.ledger.take(payload))
                    for key, payload in self.queue
                }
                self.queue.clear()
                acks = [(r, self.ledger.ack(s, told.get(s, -1))) for r, s in touched]
            for robot, ack in acks:
                self.link.put(self.keys.ack(robot), encode(ack))

    def close(self) -> None:
        self.ended.set()
        self.thread.join()
        self.link.close()


@pytest.fixture
def service(router: RouterProcess, endpoint: str, ledger: Any) -> Iterator[AckingService]:
    assert router.poll() is None
    with contextlib.closing(AckingService(endpoint, ledger)) as service:
        yield service


class Commands:
    """Starts `robot-agent` in a folder and ends what is left at the end of the test."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.processes: list[subprocess.Popen[str]] = []

    def start(self, *arguments: object) -> subprocess.Popen[str]:
        process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                "from robot_agent.cli import main; main()",
                *map(str, arguments),
            ],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.processes.append(process)
        return process

    def run(self, *arguments: object) -> subprocess.Popen[str]:
        """Start the robot r1, number 1, with JSON output."""
        return self.start("run", "--robot", "r1", "--number", 1, "--json", *arguments)

    def close(self) -> None:
        for process in self.processes:
            if process.poll() is None:
                process.kill()
            process.communicate()


@pytest.fixture
def commands(tmp_path: Path) -> Iterator[Commands]:
    with contextlib.closing(Commands(tmp_path)) as commands:
        yield commands


def summary_of(process: subprocess.Popen[str]) -> dict[str, Any]:
    """Waits for a clean end."""
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 0, err
    summary: dict[str, Any] = json.loads(out)
    return summary


def one_error_of(process: subprocess.Popen[str]) -> str:
    """Waits for exit 1; the last line on stderr, the only one that is no log event."""
    out, err = process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 1, (out, err)
    [line] = [line for line in err.splitlines() if not line.startswith("{")]
    return line


def events_of(process: subprocess.Popen[str]) -> list[str]:
    _, err = process.communicate(timeout=PATIENCE_S)
    return [json.loads(line)["event"] for line in err.splitlines()]


def assert_delivered_once(ledger: Any, count: int) -> None:
    assert sorted(keyframe.t_ns for keyframe in ledger.keyframes()) == list(range(count))
    assert ledger.contradictions == 0
    for keyframe in ledger.keyframes():
        assert (keyframe.odom is None) == (keyframe.seq == 1)


def test_a_recording_is_delivered(
    commands: Commands, service: AckingService, endpoint: str, journal: Journal
) -> None:
    process = commands.run("--source", journal(MANY), "--connect", endpoint)
    summary = summary_of(process)
    assert summary.pop("wall_s") > 0.0
    assert summary == {
        "robot": "r1",
        "sessions": 1,
        "keyframes": MANY,
        "settled": MANY,
        "refused": 0,
        "pending": 0,
    }
    assert_delivered_once(service.ledger, MANY)
    assert set(service.ledger.first.values()) == {0}
    [hello] = service.ledger.hellos()
    assert (hello.robot, hello.number, hello.site, hello.kind) == ("r1", 1, "site", "planar")


def test_a_killed_router_interrupts_but_loses_nothing(
    commands: Commands,
    service: AckingService,
    router: RouterProcess,
    endpoint: str,
    journal: Journal,
    eventually: Eventually,
) -> None:
    process = commands.run("--source", journal(MANY), "--connect", endpoint)
    for share in (0.2, 0.6):
        eventually(lambda share=share: len(service.ledger.stored) > share * MANY)  # type: ignore[misc]
        router._process.kill()  # type: ignore[union-attr]
        router.stop()
        router.start()
    assert summary_of(process)["pending"] == 0
    assert_delivered_once(service.ledger, MANY)


def test_a_killed_agent_resumes_in_a_new_session(
    commands: Commands,
    service: AckingService,
    endpoint: str,
    journal: Journal,
    eventually: Eventually,
) -> None:
    arguments = ("--source", journal(MANY), "--connect", endpoint)
    for share in (0.2, 0.6):
        process = commands.run(*arguments)
        eventually(lambda share=share: len(service.ledger.stored) > share * MANY)  # type: ignore[misc]
        process.kill()
        process.communicate()
    summary = summary_of(commands.run(*arguments))
    assert (summary["sessions"], summary["keyframes"], summary["settled"]) == (3, MANY, MANY)
    assert list(service.ledger.first.values()) == [0, 0, 0]
    assert_delivered_once(service.ledger, MANY)


def test_a_restarted_service_gets_what_it_had_not_stored(
    commands: Commands,
    router: RouterProcess,
    endpoint: str,
    ledger: Any,
    journal: Journal,
    eventually: Eventually,
) -> None:
    assert router.poll() is None
    process = commands.run("--source", journal(MANY), "--connect", endpoint)
    with Link.open([endpoint], wait_s=PATIENCE_S) as link:
        eventually(lambda: link.alive(Keys("site").alive("r1")) != [])
    for share in (0.0, 0.4, 0.9):
        with contextlib.closing(AckingService(endpoint, ledger)):
            eventually(lambda share=share: len(ledger.stored) > share * MANY)  # type: ignore[misc]
    with contextlib.closing(AckingService(endpoint, ledger)):
        assert summary_of(process)["pending"] == 0
    assert_delivered_once(ledger, MANY)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_it_cleanly_and_the_rest_stays_in_the_outbox(
    commands: Commands,
    service: AckingService,
    endpoint: str,
    journal: Journal,
    eventually: Eventually,
    tmp_path: Path,
    number: signal.Signals,
) -> None:
    arguments = ("--source", journal(MANY), "--connect", endpoint)
    process = commands.run(*arguments)
    eventually(lambda: len(service.ledger.stored) > 500)
    process.send_signal(number)
    stopped = summary_of(process)
    assert stopped["keyframes"] == stopped["settled"] + stopped["pending"] < MANY
    with Outbox.open(tmp_path / "r1.outbox.db") as outbox:
        assert outbox.counts().keyframes == stopped["keyframes"]
    assert summary_of(commands.run(*arguments))["keyframes"] == MANY
    assert_delivered_once(service.ledger, MANY)


def test_refused_keyframes_are_settled_and_visible(
    commands: Commands, service: AckingService, endpoint: str, journal: Journal
) -> None:
    service.ledger.refuses = lambda t_ns: t_ns in (3, 4, 900)
    process = commands.run("--source", journal(1000), "--connect", endpoint)
    summary = summary_of(process)
    assert (summary["settled"], summary["refused"], summary["pending"]) == (1000, 3, 0)


def test_refusals_are_logged_with_their_reason(
    commands: Commands, service: AckingService, endpoint: str, journal: Journal
) -> None:
    service.ledger.refuses = lambda t_ns: t_ns == 3
    process = commands.run("--source", journal(10), "--connect", endpoint)
    _, err = process.communicate(timeout=PATIENCE_S)
    [event] = [e for e in map(json.loads, err.splitlines()) if e["event"] == "refused"]
    assert (event["robot"], event["seq"], event["count"]) == ("r1", 4, 1)
    assert event["reason"] == "not wanted"


def test_garbage_for_acknowledgements_is_ignored(
    commands: Commands,
    router: RouterProcess,
    endpoint: str,
    ledger: Any,
    journal: Journal,
    eventually: Eventually,
) -> None:
    assert router.poll() is None
    process = commands.run("--source", journal(100), "--connect", endpoint)
    keys = Keys("site")
    with Link.open([endpoint], wait_s=PATIENCE_S) as link:
        eventually(lambda: link.alive(keys.alive("r1")) != [])
        foreign = encode(Ack(session="somebody-else", contiguous=10**6))
        for payload in (b"", b"\xff" * 100, foreign[:-1], foreign, b"\x81\xa1v\x63"):
            link.put(keys.ack("r1"), payload)
    with contextlib.closing(AckingService(endpoint, ledger)):
        assert "malformed messages ignored" in events_of(process)
    assert process.returncode == 0
    assert_delivered_once(ledger, 100)


@pytest.mark.parametrize("pace", [("--realtime",), ("--speed", "1000")])
def test_a_paced_replay_is_delivered_too(
    commands: Commands,
    service: AckingService,
    endpoint: str,
    journal: Journal,
    pace: tuple[str, ...],
) -> None:
    process = commands.run("--source", journal(700), "--connect", endpoint, *pace)
    assert summary_of(process)["settled"] == 700
    assert_delivered_once(service.ledger, 700)


def test_it_waits_for_a_router_and_says_so_once(
    commands: Commands,
    endpoint: str,
    ledger: Any,
    journal: Journal,
    eventually: Eventually,
    tmp_path: Path,
) -> None:
    process = commands.run("--source", journal(100), "--connect", endpoint)
    eventually((tmp_path / "r1.outbox.db").exists)
    assert process.stderr is not None
    told = [json.loads(process.stderr.readline()) for _ in range(2)]
    assert [event["event"] for event in told] == ["agent started", "waiting for a router"]
    assert endpoint in told[1]["reason"]
    with RouterProcess(endpoint), contextlib.closing(AckingService(endpoint, ledger)):
        assert events_of(process) == ["router connected", "agent ends"]
    assert process.returncode == 0
    assert_delivered_once(ledger, 100)


def test_a_signal_ends_the_waiting_for_a_router(
    commands: Commands, endpoint: str, journal: Journal, eventually: Eventually, tmp_path: Path
) -> None:
    process = commands.run("--source", journal(100), "--connect", endpoint)
    eventually((tmp_path / "r1.outbox.db").exists)
    assert process.stderr is not None
    process.stderr.readline()
    process.terminate()
    assert summary_of(process)["pending"] in range(101)


def test_a_damaged_recording_is_delivered_up_to_the_damage(
    commands: Commands, service: AckingService, endpoint: str, journal: Journal
) -> None:
    path = journal(300)
    path.write_bytes(path.read_bytes()[:-5])
    process = commands.run("--source", path, "--connect", endpoint)
    assert one_error_of(process).endswith("300.journal: observation 299 is cut short")
    assert_delivered_once(service.ledger, 299)


def test_what_is_no_journal_is_refused(commands: Commands, tmp_path: Path) -> None:
    absent = commands.run("--source", "absent.journal")
    assert one_error_of(absent) == (
        "robot-agent: absent.journal: cannot be read: No such file or directory"
    )
    (tmp_path / "text").write_text("hello")
    text = commands.run("--source", "text")
    assert one_error_of(text) == "robot-agent: text: not an observation journal"
    assert not (tmp_path / "r1.outbox.db").exists()


def test_an_outbox_that_cannot_be_used_is_refused(
    commands: Commands, journal: Journal, tmp_path: Path
) -> None:
    path = journal(1)
    nowhere = commands.run("--source", path, "--outbox", "no/where.db")
    assert "no/where.db: the folder no does not exist" in one_error_of(nowhere)
    Outbox.open(tmp_path / "r2.db", "site/r2").close()
    foreign = commands.run("--source", path, "--outbox", "r2.db")
    assert one_error_of(foreign) == "robot-agent: r2.db: the outbox of site/r2, not of site/r1"
    with Outbox.open(tmp_path / "busy.db"):
        busy = commands.run("--source", path, "--outbox", "busy.db")
        assert "busy.db: another process is writing" in one_error_of(busy)


def test_what_can_never_be_a_link_is_refused(commands: Commands, journal: Journal) -> None:
    path = journal(1)
    nonsense = commands.run("--source", path, "--connect", "nonsense")
    assert "nonsense" in one_error_of(nonsense)
    absent = commands.run("--source", path, "--zenoh-config", "absent.json5")
    assert "absent.json5" in one_error_of(absent)


@pytest.mark.parametrize(
    "arguments",
    [
        ("--speed", "0"),
        ("--speed", "2", "--realtime"),
        ("--robot", "R 1"),
        ("--site", "-"),
        ("--number", "65536"),
    ],
)
def test_wrong_usage_is_told_as_such(
    commands: Commands, journal: Journal, arguments: tuple[str, ...]
) -> None:
    process = commands.run("--source", journal(1), *arguments)
    process.communicate(timeout=PATIENCE_S)
    assert process.returncode == 2


def test_help_imports_nothing_heavy() -> None:
    heavy = {"numpy", "zenoh", "sqlite3", "structlog", "msgspec", "scipy"}
    code = f"import sys, robot_agent.cli; print(*({heavy!r} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
