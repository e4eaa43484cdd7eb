"""Compiling once on a machine: what decides whether it is done, and how it fails."""

import os
from pathlib import Path

import pytest

from fleet.running import kernels
from tagmap.errors import TagmapError


@pytest.fixture
def rehearsed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path]:
    """A machine where nothing is compiled; how often it was rehearsed."""
    times: list[Path] = []
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(kernels, "_rehearse", lambda folder, *_: times.append(folder))
    return times


def test_once_on_a_machine_and_again_for_other_code(rehearsed, monkeypatch, tmp_path):
    said: list[str] = []
    kernels.prepare(said.append)
    kernels.prepare(said.append)
    assert len(rehearsed) == len(said) == 1
    source = tmp_path / "kernel.py"
    source.write_text("@compiled")
    monkeypatch.setattr(kernels, "ROOT", tmp_path)
    monkeypatch.setattr(kernels, "ROOMS", (".",))
    kernels.prepare(said.append)
    kernels.prepare(said.append)
    assert len(rehearsed) == 2
    os.utime(source, (1, 1))
    kernels.prepare(said.append)
    assert len(rehearsed) == 3


def test_where_nothing_can_be_kept_it_is_done_each_time(rehearsed, monkeypatch):
    monkeypatch.setattr(kernels, "_cache", lambda: None)
    kernels.prepare(lambda _: None)
    kernels.prepare(lambda _: None)
    assert len(rehearsed) == 2


def test_what_was_ended_early_is_not_done(rehearsed):
    kernels.prepare(lambda _: None, lambda: True)
    kernels.prepare(lambda _: None)
    assert len(rehearsed) == 2


def test_all_kernels_count():
    names = {path.name for path in kernels._sources()}
    assert {"compiled.py", "measure.py", "window.py", "search.py", "grains.py"} <= names


def test_a_rehearsal_that_fails_says_why(monkeypatch, tmp_path):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(kernels, "PARTS", {"piece": None})
    with pytest.raises(TagmapError, match=r"rehearsal of the piece failed: KeyError: 'piece'"):
        kernels.prepare(lambda _: None)
    assert not (tmp_path / kernels.STAMP).exists()
