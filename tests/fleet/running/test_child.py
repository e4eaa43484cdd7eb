import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from fleet.running.child import Child


@pytest.fixture
def child(tmp_path: Path) -> Iterator[Child]:
    made = Child("sleeper", [sys.executable, "-c", "import time; time.sleep(60)"], tmp_path)
    yield made
    made.stop()


def wait_for_end(child: Child) -> int:
    while (status := child.status) is None:
        time.sleep(0.02)
    return status


def test_runs_until_it_is_stopped(child: Child):
    assert (child.pid, child.status) == (None, None)
    child.start()
    assert child.pid
    assert child.status is None
    child.stop()
    child.stop()
    assert child.status == -15


def test_output_goes_to_files_and_the_last_line_is_the_reason(child: Child):
    child.command = [
        sys.executable,
        "-c",
        "import sys; print('out'); print('first', file=sys.stderr); sys.exit('the reason')",
    ]
    child.start()
    assert wait_for_end(child) == 1
    assert child.out.read_text() == "out\n"
    assert child.last_words() == "the reason"


def test_a_silent_death_has_no_reason(child: Child):
    assert child.last_words() == "no reason given"
