"""The reader straight on a scene and the driver over LLRP tell the agent the same."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.reader import SceneReader
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag
from robot_agent.rfid.reader import Failure, Inventory, ReaderInfo, RfidReader
from tests.fleet.emulation.llrp.conftest import Stand, dark, epc, lit

RECORD = tuple(range(0xE500, 0xE500 + 22))


@dataclass
class Clock:
    now: int = time.time_ns()

    def pass_by(self, duration_ns: int) -> None:
        self.now += duration_ns


def tags() -> list[Tag]:
    locked = lit(3)
    locked.memory.locked = True
    return [
        lit(1),
        dark(2),
        locked,
        lit(4, words=4),
        lit(5, power_fails_after=[5]),
        lit(6, deaf=True),
        lit(7, dead=True),
    ]


@pytest.fixture(params=["scene", "llrp"])
def reader(request: pytest.FixtureRequest, stand: Callable[..., Stand]) -> Iterator[RfidReader]:
    if request.param == "llrp":
        yield stand(*tags()).driver
    else:
        clock = Clock()
        antenna = Scene(tags(), [Reader("r1")]).antenna("r1")
        yield SceneReader(antenna, lambda: clock.now, clock.pass_by)


def test_the_same_tags_and_failures(reader: RfidReader):
    assert isinstance(reader.probe(), ReaderInfo)
    heard = reader.inventory(0.1)
    assert isinstance(heard, Inventory)
    assert [tag.epc for tag in heard.tags] == [epc(n) for n in (1, 3, 4, 5, 6)]
    assert 0.1e9 <= heard.ended_ns - heard.started_ns < 5e9
    told = {}
    for n in range(1, 8):
        result = reader.write_user(epc(n), 0, RECORD, 0.4)
        failed = isinstance(result, Failure)
        told[n] = (result.reason, result.words_written) if failed else result.words
    assert told == {
        1: RECORD,
        2: ("other_tags_only", None),
        3: ("locked", 0),
        4: ("partial", 4),
        5: ("partial", 5),
        6: ("no_answer", 0),
        7: ("other_tags_only", None),
    }
    assert reader.read_user(epc(4), 0, None, 0.5) == reader.read_user(epc(4).upper(), 0, 4, 0.5)


def test_in_virtual_time_windows_cost_nothing():
    clock = Clock(0)
    scene = Scene([dark(1)], [Reader("r1", missed=0.05)])
    reader = SceneReader(scene.antenna("r1"), lambda: clock.now, clock.pass_by)
    scene.shine("laser", [epc(1)], 1_000_000_000)
    heard = reader.inventory(100.0)
    assert isinstance(heard, Inventory)
    [tag] = heard.tags
    assert tag.first_s == pytest.approx(1.0, abs=0.05)
    assert 4500 < tag.count < 4950
    assert clock.now == 100_000_000_000
