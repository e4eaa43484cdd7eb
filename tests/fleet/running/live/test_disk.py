"""A disk without room for one process."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fleet.running.live.disk import LEAST_BYTES, Disk

pytestmark = pytest.mark.skipif(not Disk().can_be_filled, reason="needs Linux")

WRITER = """
import sys
for line in sys.stdin:
    try:
        with open(sys.argv[1], "ab") as file:
            file.write(bytes(int(line)))
        print("written", flush=True)
    except OSError as error:
        print(error.strerror, flush=True)
"""


class Writer:
    def __init__(self, path: Path) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", WRITER, str(path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def write(self, count: int) -> str:
        self.process.stdin.write(f"{count}\n")
        self.process.stdin.flush()
        return self.process.stdout.readline().strip()


@pytest.fixture
def writers(tmp_path: Path) -> Iterator[list[Writer]]:
    made = [Writer(tmp_path / f"{k}") for k in range(2)]
    yield made
    for one in made:
        one.process.kill()
        one.process.communicate()


def test_it_is_full_for_the_one_who_has_the_pid_and_then_there_is_room(writers: list[Writer]):
    disk, (one, other) = Disk(), writers
    disk.fill()
    disk.mind(one.process.pid)
    assert one.write(LEAST_BYTES) == "written"
    assert one.write(1) == "File too large"
    assert other.write(LEAST_BYTES + 1) == "written"
    disk.make_room()
    disk.mind(one.process.pid)
    assert one.write(1) == "written"


def test_who_is_started_again_finds_it_full(writers: list[Writer]):
    disk, (one, other) = Disk(), writers
    disk.fill()
    disk.mind(one.process.pid)
    disk.mind(None)
    disk.mind(other.process.pid)
    assert other.write(LEAST_BYTES + 1) == "File too large"


def test_nobody_is_there(writers: list[Writer]):
    disk, (one, _) = Disk(), writers
    one.process.kill()
    one.process.wait()
    disk.fill()
    disk.mind(one.process.pid)
    disk.make_room()
    disk.mind(None)
