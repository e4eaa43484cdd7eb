"""The driver and the camera server over real sockets, and servers as nobody wants them."""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager

import numpy as np
import pytest

from fleet.emulation.camera.faults import CameraFaults
from fleet.emulation.camera.server import CameraServer, Pairs
from robot_agent.cameras import connection
from robot_agent.cameras.camera import CameraInfo, Failure, StereoPair
from robot_agent.cameras.frames import QUESTION_BYTES, Header, Kind, answer_to, decode_question
from robot_agent.cameras.network import NetworkCamera, NetworkConfig
from tagmap.errors import LinkError

ENOUGH_S = 10.0
SIZE = (64, 48)


class World:
    """Renders what it is told to; others wait for it."""

    def __init__(self) -> None:
        self._newest: StereoPair | Failure | None = None
        self._news = threading.Condition()

    def show(self, t_ns: int, dtype: type[np.generic] = np.uint8) -> StereoPair:
        rng = np.random.default_rng(t_ns)
        left, right = rng.integers(0, np.iinfo(dtype).max, (2, 48, 64), dtype)  # type: ignore[type-var]
        pair = StereoPair(left, right, t_ns, 250, f"pair {t_ns}")
        self.put(pair)
        return pair

    def put(self, found: StereoPair | Failure) -> None:
        with self._news:
            self._newest = found
            self._news.notify_all()

    def pairs(self, after_ns: int | None, wait_s: float) -> StereoPair | Failure | None:
        with self._news:
            self._news.wait_for(lambda: self._found(after_ns), wait_s)
            return self._found(after_ns)

    def _found(self, after_ns: int | None) -> StereoPair | Failure | None:
        if isinstance(self._newest, StereoPair) and self._newest.t_ns <= (after_ns or 0):
            return None
        return self._newest


@pytest.fixture
def world() -> World:
    return World()


@pytest.fixture
def serve() -> Iterator[Callable[..., NetworkCamera]]:
    """`serve(pairs, faults)`: the camera that is served."""
    with ExitStack() as opened:

        def build(pairs: Pairs, faults: CameraFaults | None = None) -> NetworkCamera:
            return opened.enter_context(
                at(opened.enter_context(CameraServer(pairs, faults=faults)))
            )

        yield build


def at(server: CameraServer, expected_px: tuple[int, int] | None = None) -> closing[NetworkCamera]:
    host, port = server.address
    expected = None if expected_px is None else (expected_px, expected_px)
    return closing(NetworkCamera(NetworkConfig(host=host, port=port), expected))


def pair_of(found: StereoPair | Failure) -> StereoPair:
    assert isinstance(found, StereoPair), found
    return found


def failure_of(found: object) -> Failure:
    assert isinstance(found, Failure), found
    return found


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_a_pair_arrives_as_it_was(world: World, serve, dtype: type[np.generic]):
    shown = world.show(7, dtype)
    found = pair_of(serve(world.pairs).grab(ENOUGH_S))
    assert (found.t_ns, found.skew_ns, found.name) == (7, 250, "pair 7")
    assert found.left.dtype == found.right.dtype == dtype
    np.testing.assert_array_equal(found.left, shown.left)
    np.testing.assert_array_equal(found.right, shown.right)


def test_each_pair_once_and_the_newest(world: World, serve):
    camera = serve(world.pairs)
    world.show(1)
    assert pair_of(camera.grab(ENOUGH_S)).t_ns == 1
    found = failure_of(camera.grab(0.05))
    assert found.reason == "stalled"
    assert "no new pair within 0.05 s" in found.detail
    world.show(2)
    world.show(3)
    assert pair_of(camera.grab(ENOUGH_S)).t_ns == 3


def test_a_probe_leaves_the_pair(world: World, serve):
    camera = serve(world.pairs)
    world.show(1)
    found = camera.probe()
    assert isinstance(found, CameraInfo)
    assert found.what.startswith("network 127.0.0.1:")
    assert (found.left_px, found.right_px) == (SIZE, SIZE)
    assert pair_of(camera.grab(ENOUGH_S)).t_ns == 1


def test_a_pair_kept_by_the_caller_stays_what_it_is(world: World, serve):
    camera = serve(world.pairs)
    first = world.show(1)
    kept = pair_of(camera.grab(ENOUGH_S))
    world.show(2)
    pair_of(camera.grab(ENOUGH_S))
    np.testing.assert_array_equal(kept.left, first.left)


def test_without_any_time_it_arrives_by_and_by(
    world: World, serve, eventually: Callable[[Callable[[], object]], None]
):
    camera = serve(world.pairs)
    world.show(1)
    found: list[StereoPair] = []

    def polled() -> bool:
        got = camera.grab(0.0)
        assert isinstance(got, StereoPair) or got.reason == "stalled", got
        found.extend([got] if isinstance(got, StereoPair) else [])
        return bool(found)

    eventually(polled)
    assert [pair.t_ns for pair in found] == [1]


def test_what_was_asked_for_long_ago_does_not_count_before_what_is_newer(
    world: World, serve, eventually: Callable[[Callable[[], object]], None]
):
    """The first call gives up before the answer is there; then there is a newer pair."""
    may_answer, handed_over = threading.Event(), []

    def slow(after_ns: int | None, wait_s: float) -> StereoPair | Failure | None:
        assert may_answer.wait(ENOUGH_S)
        found = world.pairs(after_ns, wait_s)
        handed_over.append(found)
        return found

    camera = serve(slow)
    world.show(1)
    assert failure_of(camera.grab(0.05)).reason == "stalled"
    may_answer.set()
    eventually(lambda: handed_over)
    world.show(2)
    assert pair_of(camera.grab(ENOUGH_S)).t_ns == 2
    assert [pair.t_ns for pair in handed_over] == [1, 2]


def test_a_failure_of_the_cameras_is_told(world: World, serve):
    camera = serve(world.pairs)
    world.put(Failure("one_side_missing", "no image\nfrom the right"))
    found = failure_of(camera.grab(ENOUGH_S))
    assert found.reason == "one_side_missing"
    assert found.detail.endswith(": no image from the right")
    world.show(1)
    assert pair_of(camera.grab(ENOUGH_S)).t_ns == 1


def test_nobody_there(free_port: int):
    camera = NetworkCamera(NetworkConfig(host="127.0.0.1", port=free_port))
    for found in (camera.grab(0.1), camera.grab(0.0), camera.grab(-1.0)):
        assert failure_of(found).reason == "camera_gone"
        assert failure_of(found).detail == (
            f"camera 127.0.0.1:{free_port}: cannot connect: Connection refused"
        )
    assert failure_of(NetworkCamera(NetworkConfig(host="a" * 70)).grab(0.0)).reason == "camera_gone"


def test_a_server_that_comes_within_the_time_is_enough(world: World, free_port: int):
    world.show(1)
    camera = NetworkCamera(NetworkConfig(host="127.0.0.1", port=free_port))
    assert failure_of(camera.grab(0.0)).reason == "camera_gone"
    server: list[CameraServer] = []
    late = threading.Timer(
        0.2, lambda: server.append(CameraServer(world.pairs, port=free_port).__enter__())
    )
    late.start()
    with closing(camera):
        assert pair_of(camera.grab(ENOUGH_S)).t_ns == 1
    late.join()
    server[0].__exit__()


def test_a_server_that_starts_again_goes_on(world: World):
    with CameraServer(world.pairs) as first, at(first) as camera:
        port = first.address[1]
        world.show(5)
        assert pair_of(camera.grab(ENOUGH_S)).t_ns == 5
        first.__exit__()
        assert failure_of(camera.grab(0.1)).reason == "camera_gone"
        with CameraServer(world.pairs, port=port):
            assert failure_of(camera.grab(0.2)).reason == "stalled", "the same pair again"
            world.show(6)
            assert pair_of(camera.grab(ENOUGH_S)).t_ns == 6
        with CameraServer(world.pairs, port=port):
            world.show(2)
            assert pair_of(camera.grab(ENOUGH_S)).t_ns == 2, "its clock was set back"


@pytest.mark.parametrize("fault", ["cut_every", "wrong_size_every", "garbage_every"])
def test_after_a_pair_that_went_wrong_the_next_one_is_right(world: World, serve, fault: str):
    camera = serve(world.pairs, CameraFaults(**{fault: 2}))
    for t_ns in range(1, 9):
        shown = world.show(t_ns)
        found = pair_of(camera.grab(ENOUGH_S))
        assert found.t_ns == t_ns
        width = 63 if fault == "wrong_size_every" and t_ns % 2 == 0 else 64
        np.testing.assert_array_equal(found.left, shown.left[:, :width])


def test_another_size_than_that_of_the_rig_is_refused(world: World):
    with (
        CameraServer(world.pairs, faults=CameraFaults(wrong_size_every=2)) as server,
        at(server, SIZE) as camera,
    ):
        world.show(1)
        pair_of(camera.grab(ENOUGH_S))
        world.show(2)
        found = failure_of(camera.grab(ENOUGH_S))
        assert found.reason == "size_changed"
        assert found.detail.endswith("left image is 63x48 px, expected 64x48 px")
        assert pair_of(camera.grab(ENOUGH_S)).t_ns == 2


def test_a_server_that_falls_silent_is_connected_anew(world: World, serve, monkeypatch):
    monkeypatch.setattr(connection, "SILENT_S", 0.2)
    camera = serve(world.pairs, CameraFaults(stall_every=2))
    world.show(1)
    pair_of(camera.grab(ENOUGH_S))
    world.show(2)
    found = [failure_of(camera.grab(0.1)) for _ in range(2)]
    while not isinstance(last := camera.grab(0.1), StereoPair):
        found.append(last)
        assert len(found) < 100
    assert {failure.reason for failure in found} == {"stalled"}
    assert "has sent nothing for" in found[-1].detail
    assert last.t_ns == 2


@contextmanager
def answering(*answers: bytes, hang_up: bool = True) -> Iterator[NetworkCamera]:
    """A server that answers each first question of a connection so; the last one for ever."""
    over = threading.Event()
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.05)

        def serve() -> None:
            left = list(answers)
            lines = []
            while not over.is_set():
                try:
                    line, _ = listener.accept()
                except TimeoutError:
                    continue
                line.settimeout(ENOUGH_S)
                lines.append(line)
                if line.recv(QUESTION_BYTES):
                    line.sendall(left[0] if len(left) == 1 else left.pop(0))
                if hang_up:
                    line.close()
            for line in lines:
                line.close()

        thread = threading.Thread(target=serve)
        thread.start()
        config = NetworkConfig(host="127.0.0.1", port=listener.getsockname()[1])
        try:
            with closing(NetworkCamera(config)) as camera:
                yield camera
        finally:
            over.set()
            thread.join()


def whole(number: int = 1, size: int = 20) -> bytes:
    image = np.zeros((size, size), np.uint8)
    return b"".join(map(bytes, answer_to(number, StereoPair(image, image, 1, None, "one"))))


def pair_header(**more: object) -> bytes:
    made = {"t_ns": 1, "left_px": (20, 20), "right_px": (20, 20), "bits": 8} | more
    return Header(Kind.PAIR, 1, **made).encode()  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("answer", "reason", "said"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n" + bytes(20), "camera_gone", "is no camera server"),
        (pair_header(t_ns=-1), "bad_image", "announces the time -1 ns"),
        (pair_header(bits=12), "bad_image", "pixels of 12 bits, expected 8 or 16"),
        (pair_header(left_px=(65535, 65535)), "bad_image", "more than 256 MiB"),
        (pair_header(left_px=(0, 20)), "bad_image", "left image is 0x20 px: too small"),
        (pair_header(text_bytes=2000), "camera_gone", "announces 2000 bytes of text"),
        (whole(number=2), "camera_gone", "answers question 2, asked was 1"),
        (b"", "camera_gone", "hung up without an answer"),
        (whole()[:10], "camera_gone", "hung up within an answer"),
        (whole()[:-1], "camera_gone", "hung up after 802 of 803 bytes of a pair"),
    ],
)
def test_what_is_no_answer_is_told(answer: bytes, reason: str, said: str):
    with answering(answer) as camera:
        found = failure_of(camera.grab(0.1))
    assert found.reason == reason
    assert said in found.detail


def test_a_pair_that_was_cut_is_asked_for_again_within_the_call():
    with answering(whole()[:-1], b"", whole()) as camera:
        assert pair_of(camera.grab(ENOUGH_S)).name == "one"


def test_a_server_that_says_nothing_ends_no_call():
    with answering(b"", hang_up=False) as camera:
        started = time.monotonic()
        assert failure_of(camera.grab(0.1)).reason == "stalled"
        assert time.monotonic() - started < ENOUGH_S


def test_bytes_of_nobody_end_no_call():
    rng = np.random.default_rng(0)
    for _ in range(20):
        garbage = rng.bytes(int(rng.integers(0, 300)))
        start = whole()[: int(rng.integers(0, 60))]
        with answering(start + garbage) as camera:
            found = camera.grab(0.0)
            while isinstance(found, Failure) and found.reason == "stalled":
                found = camera.grab(0.05)
        assert isinstance(found, Failure)


def test_the_server_lets_go_of_who_asks_nonsense_and_serves_the_others(world: World):
    world.show(1)
    with CameraServer(world.pairs) as server, at(server) as camera:
        with socket.create_connection(server.address) as stranger:
            stranger.settimeout(ENOUGH_S)
            stranger.sendall(b"GET / HTTP/1.1\r\n\r\n...")
            # What was not read when it hung up makes a reset of it.
            with contextlib.suppress(ConnectionResetError):
                assert stranger.recv(1) == b""
        assert pair_of(camera.grab(ENOUGH_S)).t_ns == 1


def test_a_port_in_use_is_refused(world: World):
    with CameraServer(world.pairs) as server, pytest.raises(LinkError, match="cannot listen"):
        CameraServer(world.pairs, port=server.address[1])


def test_the_first_question_asks_for_any_pair():
    with socket.create_server(("127.0.0.1", 0)) as listener:
        config = NetworkConfig(host="127.0.0.1", port=listener.getsockname()[1])
        with closing(NetworkCamera(config)) as camera:
            camera.grab(0.0)
            line, _ = listener.accept()
            with line:
                line.settimeout(ENOUGH_S)
                question = decode_question(line.recv(QUESTION_BYTES))
    assert (question.number, question.after_ns, question.wait_ms) == (1, None, 0)
