"""A disk without room: nothing is acknowledged, nothing is lost, and the service lives on."""

import resource
import time

from tagmap.records import Ack, decode
from tagmap.store.check import check
from tests.mapping.messages import SESSION, hello, keyframe

N = 400
ROOM_FOR_THE_LOG = 4000


def limit_file_size(process, size):
    """Writing beyond `size` bytes fails in that process, as on a full disk; None lifts it."""
    _, hard = resource.prlimit(process.pid, resource.RLIMIT_FSIZE)
    soft = hard if size is None else size
    resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk(serve, client):
    client.deliver(hello(), keyframe(1))
    limit_file_size(serve.process, ROOM_FOR_THE_LOG)
    frames = [keyframe(seq) for seq in range(2, N + 1)]
    for _ in range(3):
        client.send(*frames)
        time.sleep(0.7)
    (reply,) = client.ask(f"{client.keys.ack('r1')}?session={SESSION}")
    assert reply.error or decode(Ack, reply.payload).contiguous < N
    limit_file_size(serve.process, None)
    assert client.deliver(hello(), keyframe(1), *frames).contiguous == N
    assert serve.log.read_text().count('"commit failed"') == 1
    assert '"commits again"' in serve.log.read_text()
    assert serve.stop() == 0
    assert check(serve.folder / "site.db") == []
