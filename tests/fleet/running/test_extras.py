"""What is not installed is named before a run begins, with the extra that brings it."""

from importlib.util import find_spec

import pytest
from click.testing import CliRunner

from fleet.cli.root import cli
from fleet.running import extras
from fleet.simulation.scenario.reading import read_scenario
from tagmap.errors import TagmapError

BROUGHT = {name for names in extras.PACKAGES.values() for name in names}


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch):
    """`only(*names)`: of all packages that extras bring these alone are installed."""

    def install(*names: str) -> None:
        lacking = BROUGHT - set(names)
        monkeypatch.setattr(extras, "find_spec", lambda n: None if n in lacking else find_spec(n))

    return install


@pytest.mark.parametrize(
    ("scenario", "live", "installed", "expected"),
    [
        ("hall-small", False, (), r"this needs open3d: pip install 'tagmap\[sim\]'"),
        ("demo", True, ("open3d",), r"needs pyllrp, bitstring: pip install 'tagmap\[llrp\]'"),
        ("thesis-lab", True, (), r"pip install 'tagmap\[sim,llrp,pan-tilt\]'"),
    ],
)
def test_named_with_what_brings_it(only, scenario: str, live: bool, installed, expected: str):
    only(*installed)
    with pytest.raises(TagmapError, match=expected):
        extras.demand(read_scenario(scenario), live)


def test_nothing_is_asked_for_that_a_run_does_not_need(only):
    only("open3d")
    extras.demand(read_scenario("thesis-lab"), live=False)
    only("open3d", "pyllrp", "bitstring")
    extras.demand(read_scenario("demo"), live=True)


def test_the_command_says_so_and_leaves_no_folder(only, tmp_path):
    only()
    done = CliRunner().invoke(cli, ["run", "demo", "--out", str(tmp_path / "run")])
    assert "pip install 'tagmap[sim]'" in str(done.exception)
    assert not (tmp_path / "run").exists()
