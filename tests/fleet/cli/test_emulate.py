"""`fleet emulate llrp` as a process: killed, started again, and refusing."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from click.testing import CliRunner

from fleet.cli.root import cli
from robot_agent.rfid.llrp.driver import LlrpConfig, LlrpReader
from robot_agent.rfid.reader import Inventory, UserWords
from tagmap.errors import TagmapError

EPC = "e20047000000000000000001"
RECORD = (0xE510, 0x0001, 0xFFFF)


def start(*options: str) -> subprocess.Popen[str]:
    """Returns when it listens."""
    command = [sys.executable, "-m", "fleet.cli", "emulate", "llrp", *options]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    assert process.stdout.readline().startswith("llrp reader with ")
    return process


def test_tags_remember_when_the_emulator_is_killed(
    tmp_path: Path, free_port: int, eventually: Callable[[Callable[[], object]], None]
):
    memory = tmp_path / "tags.json"
    options = ("--listen", f"127.0.0.1:{free_port}", "--tag", EPC, "--memory", str(memory))
    driver = LlrpReader(LlrpConfig(host="127.0.0.1", port=free_port))
    with closing(driver), start(*options) as process:
        written = driver.write_user(EPC, 0, RECORD, 2.0)
        assert written == UserWords(EPC, 0, RECORD)
        eventually(lambda: json.loads(memory.read_text())[EPC].startswith("e5100001ffff"))
        process.kill()
        process.wait()
        assert not isinstance(driver.inventory(0.02), Inventory)
        with start(*options) as again:
            eventually(lambda: isinstance(driver.inventory(0.02), Inventory))
            assert driver.read_user(EPC, 0, 3, 2.0) == UserWords(EPC, 0, RECORD)
            again.send_signal(signal.SIGTERM)
            assert again.wait(10) == 130


def test_it_ends_by_itself():
    done = CliRunner().invoke(
        cli, ["emulate", "llrp", "--listen", "127.0.0.1:0", "--duration-s", "0"]
    )
    assert done.exit_code == 0
    assert done.stdout.startswith("llrp reader with 0 tags at 127.0.0.1:")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--listen", "5084"), "'5084' is not HOST:PORT"),
        (("--tag", "E2G0"), "$[0].epc"),
        (("--cut-every", "-1"), "--cut-every"),
    ],
)
def test_wrong_usage(options: tuple[str, ...], said: str):
    done = CliRunner().invoke(cli, ["emulate", "llrp", *options])
    assert done.exit_code == 2
    assert said in done.stderr


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("[]", "not tag memories"),
        ("{", "not tag memories"),
        (f'{{"{EPC}": "-001"}}', "not tag memories"),
        (f'{{"{EPC}": "e510"}}', f"{EPC} has 1 words, the scene says 64"),
    ],
)
def test_a_memory_file_that_is_none(tmp_path: Path, content: str, said: str):
    file = tmp_path / "tags.json"
    file.write_text(content)
    options = ["--listen", "127.0.0.1:0", "--tag", EPC, "--memory", str(file)]
    done = CliRunner().invoke(cli, ["emulate", "llrp", *options])
    assert isinstance(done.exception, TagmapError)
    assert str(done.exception).startswith(f"{file}: ")
    assert said in str(done.exception)
    assert file.read_text() == content
