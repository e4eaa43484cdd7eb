"""The page says what the program does: every option is in it, and its example runs."""

import re
from pathlib import Path

import pytest

from robot_agent.cli.run import run
from robot_agent.sources.journal import JournalSource

PAGE = (Path(__file__).parents[2] / "docs" / "agent.md").read_text()


def test_every_option_is_on_the_page() -> None:
    table = {
        option
        for line in PAGE.splitlines()
        if line.startswith("| `--")
        for option in re.findall(r"`(--[a-z-]+)", line)
    }
    assert table == {option for parameter in run.params for option in parameter.opts}


def test_the_journal_example_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    [example] = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(example, {})
    assert len(JournalSource(tmp_path / "mine.journal").take(10, now_ns=0)) == 1
