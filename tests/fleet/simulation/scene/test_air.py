"""Who answers a reader, and when."""

import numpy as np
import pytest

from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Always, Beams, Light, Schedule
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import EPC, RESERVED, TID, USER, Tag, TagFaults

MS = 1_000_000
ONE, TWO = "e2004700" + 15 * "0" + "1", "e2004700" + 15 * "0" + "2"


def tag(name: str, epc: str = ONE, *lights: Light, words: int = 8, **more: object) -> Tag:
    return Tag(name, epc, UserMemory([0] * words), lights=lights, **more)  # type: ignore[arg-type]


def heard(scene: Scene, t_ns: int, reader: str = "r1") -> list[str]:
    return [reply.epc for reply in scene.antenna(reader).hear(t_ns)]


def test_a_tag_answers_only_while_it_is_lit():
    scene = Scene([tag("a")], [Reader("r1")])
    assert heard(scene, 0) == []
    scene.shine("laser", ["a"], 10 * MS)
    assert heard(scene, 11 * MS) == [], "it needs 2 ms to switch on"
    assert heard(scene, 12 * MS) == [ONE]
    scene.shine("laser", [], 20 * MS)
    assert heard(scene, 20 * MS) == []


def test_two_lasers_light_a_tag_without_a_break():
    beams = Beams()
    beams.shine("r1", ["a"], 10)
    beams.shine("r2", ["a", "b"], 20)
    assert beams.lit_since("a", 30) == 10
    beams.shine("r1", [], 40)
    assert beams.lit_since("a", 50) == 20
    beams.shine("r2", ["a"], 60)
    assert beams.lit_since("a", 70) == 20
    assert beams.lit_since("b", 70) is None


def test_a_schedule_repeats():
    schedule = Schedule(period_ns=100, on_ns=30, start_ns=1000)
    lit = [schedule.lit_since("a", t) for t in (999, 1000, 1029, 1030, 1099, 1100, 1229)]
    assert lit == [None, 1000, 1000, None, None, 1100, 1200]


def test_everyone_in_range_hears_whoever_is_lit():
    readers = [Reader("near"), Reader("edge", (85.0, 0.0, 0.0)), Reader("far", (85.1, 0.0, 0.0))]
    scene = Scene([tag("a", ONE, Always()), tag("b", TWO, Always()), tag("c")], readers)
    assert [heard(scene, MS * 5, name) for name in ("near", "edge", "far")] == [
        [ONE, TWO],
        [ONE, TWO],
        [],
    ]
    scene.move("far", (0.0, 0.0, 0.0))
    assert heard(scene, MS * 5, "far") == [ONE, TWO]


def test_writing_needs_to_be_nearer_than_reading():
    scene = Scene([tag("a", ONE, Always())], [Reader("r1", (40.0, 0.0, 0.0))])
    antenna = scene.antenna("r1")
    [reply] = antenna.hear(5 * MS)
    assert antenna.read(reply.handle, USER, 0, 2, 5 * MS) == (0, 0)
    assert antenna.write(reply.handle, USER, 0, 7, 5 * MS) == "no_power"
    scene.move("r1", (30.0, 0.0, 0.0))
    assert antenna.write(reply.handle, USER, 0, 7, 5 * MS) is None
    assert scene.tag("a").memory.words[0] == 7


def test_banks():
    scene = Scene([tag("a", ONE, Always(), tid="e28011050000")], [Reader("r1")])
    antenna = scene.antenna("r1")
    [reply] = antenna.hear(5 * MS)
    assert antenna.read(reply.handle, EPC, 1, 7, 5 * MS) == (6 << 11, 0xE200, 0x4700, 0, 0, 0, 1)
    assert antenna.read(reply.handle, TID, 0, 0, 5 * MS) == (0xE280, 0x1105, 0)
    assert antenna.read(reply.handle, RESERVED, 0, 0, 5 * MS) == "locked"
    assert antenna.write(reply.handle, TID, 0, 1, 5 * MS) == "locked"
    assert antenna.read(reply.handle, USER, 7, 1, 5 * MS) == (0,)
    assert antenna.read(reply.handle, USER, 7, 2, 5 * MS) == "overrun"
    assert antenna.read(reply.handle, USER, 8, 0, 5 * MS) == "overrun"
    assert antenna.read(99, USER, 0, 1, 5 * MS) == "silent"


def test_power_lost_in_the_middle_of_a_write():
    faulty = tag("a", ONE, Always(), faults=TagFaults(power_fails_after=[3]))
    antenna = Scene([faulty], [Reader("r1")]).antenna("r1")
    [reply] = antenna.hear(5 * MS)
    at = [antenna.write(reply.handle, USER, i, 9, (5 + i) * MS) for i in range(5)]
    assert at == [None, None, None, "silent", "silent"]
    assert faulty.memory.words == (9, 9, 9, 0, 0, 0, 0, 0)
    later = [antenna.write(reply.handle, USER, i, 8, (300 + i) * MS) for i in range(8)]
    assert later == [None] * 8


def test_memory_wears_out_locks_and_ends():
    memory = UserMemory([0, 0], endurance=2)
    assert [memory.write(0, word) for word in (1, 2, 3)] == [None] * 3
    assert memory.words == (2, 0), "the third write was acknowledged, but did not hold"
    assert memory.writes == 3
    assert memory.write(2, 1) == "overrun"
    memory.locked = True
    assert memory.write(1, 1) == "locked"


def test_dead_and_deaf_tags():
    scene = Scene(
        [
            tag("dead", ONE, Always(), faults=TagFaults(dead=True)),
            tag("deaf", TWO, Always(), faults=TagFaults(deaf=True)),
        ],
        [Reader("r1")],
    )
    antenna = scene.antenna("r1")
    [reply] = antenna.hear(5 * MS)
    assert reply.epc == TWO
    assert antenna.read(reply.handle, USER, 0, 1, 5 * MS) == "silent"


@pytest.mark.parametrize(
    ("reader", "stray", "rate"),
    [
        (Reader("r1", missed=0.05), 0.0, 0.95),
        (Reader("r1", phantom=0.02), 0.0, 1.02),
        (Reader("r1"), 0.1, 1.1),
    ],
    ids=["missed", "phantom", "stray"],
)
def test_chance_has_the_rates_that_were_asked_for(reader: Reader, stray: float, rate: float):
    """Within four standard deviations of the binomial."""
    scene = Scene(
        [tag("a", ONE, Always()), tag("b", TWO, faults=TagFaults(stray=stray))], [reader], seed=3
    )
    n = 4000
    replies = sum(len(heard(scene, 5 * MS + i)) for i in range(n))
    p = abs(rate - 1.0)
    assert abs(replies / n - rate) < 4.0 * np.sqrt(p * (1.0 - p) / n)


def test_a_phantom_is_nobody():
    scene = Scene([tag("a")], [Reader("r1", phantom=1.0)])
    antenna = scene.antenna("r1")
    [phantom] = antenna.hear(0)
    assert len(phantom.epc) == 24
    assert phantom.epc != ONE
    assert antenna.read(phantom.handle, USER, 0, 1, 0) == "silent"


def test_answers_depend_on_the_question_not_on_the_order():
    def scene() -> Scene:
        return Scene(
            [tag("a", ONE, Always())], [Reader("r1", missed=0.5), Reader("r2", missed=0.5)], seed=7
        )

    times = range(5 * MS, 5 * MS + 50)
    forward = [(t, r, heard(scene(), t, r)) for t in times for r in ("r1", "r2")]
    once = scene()
    backward = [(t, r, heard(once, t, r)) for t in reversed(times) for r in ("r2", "r1")]
    assert sorted(backward) == sorted(forward)
    assert [f[2] for f in forward[::2]] != [f[2] for f in forward[1::2]], "readers differ"


def test_a_beam_ends_when_it_was_said_to():
    beams = Beams()
    beams.shine("r1", ["a"], 10, until_ns=20)
    assert [beams.lit_since("a", t) for t in (9, 10, 19, 20)] == [None, 10, 10, None]
    beams.shine("r1", ["a"], 15, until_ns=30)
    assert beams.lit_since("a", 29) == 10, "prolonged while it was on"
    beams.shine("r1", ["a"], 40, until_ns=50)
    assert beams.lit_since("a", 45) == 40
