"""Driver and emulated reader over a real socket: what becomes of tags."""

import time
from collections.abc import Callable

import pytest

from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Always
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.tag import Tag
from robot_agent.rfid.reader import Failure, Inventory, ReaderInfo, UserWords
from tests.fleet.emulation.llrp.conftest import Stand, dark, epc, lit

RECORD = tuple(range(0xE500, 0xE500 + 22))
PATIENCE_S = 2.0


def epcs(result: Inventory | Failure) -> list[str]:
    assert isinstance(result, Inventory), result
    return [heard.epc for heard in result.tags]


def test_an_inventory_hears_who_is_lit(stand: Callable[..., Stand]):
    s = stand(lit(1), dark(2), lit(3))
    result = s.driver.inventory(0.2)
    assert epcs(result) == [epc(1), epc(3)]
    assert isinstance(result, Inventory)
    assert result.ended_ns - result.started_ns >= 0.2e9
    for heard in result.tags:
        assert heard.count > 1
        assert heard.first_s is not None
        assert heard.last_s is not None
        assert 0.0 <= heard.first_s < heard.last_s < (result.ended_ns - result.started_ns) * 1e-9


def test_nobody_heard_is_no_failure(stand: Callable[..., Stand]):
    assert epcs(stand(dark(1)).driver.inventory(0.05)) == []


def test_a_window_is_deaf_before_and_behind(stand: Callable[..., Stand]):
    """Light that was there earlier, and light that comes later, identify nothing."""
    s = stand(dark(1))
    s.scene.shine("laser", [epc(1)], time.time_ns())
    assert epcs(s.driver.inventory(0.05)) == [epc(1)]
    s.scene.shine("laser", [], time.time_ns())
    assert epcs(s.driver.inventory(0.05)) == []
    s.scene.shine("laser", [epc(1)], time.time_ns())
    assert epcs(s.driver.inventory(0.05)) == [epc(1)]


def test_a_slow_tag_needs_a_longer_window(stand: Callable[..., Stand]):
    slow = dark(1)
    slow.switch_on_ns = 1_000_000_000
    s = stand(slow)
    s.driver.probe()
    lit_ns = time.time_ns()
    s.scene.shine("laser", [epc(1)], lit_ns)
    assert epcs(s.driver.inventory(0.05)) == []
    result = s.driver.inventory(1.5)
    assert epcs(result) == [epc(1)]
    assert isinstance(result, Inventory)
    [heard] = result.tags
    assert heard.first_s is not None
    assert result.started_ns + heard.first_s * 1e9 == pytest.approx(lit_ns + 1e9, abs=0.2e9)


def test_strays_and_phantoms_are_heard_as_readers_hear_them(stand: Callable[..., Stand]):
    neighbour = dark(2)
    neighbour.faults.stray = 1.0
    assert epcs(stand(lit(1), neighbour).driver.inventory(0.05)) == [epc(1), epc(2)]
    haunted = stand(lit(1), radio=Reader("r1", phantom=1.0))
    heard = epcs(haunted.driver.inventory(0.05))
    assert epc(1) in heard
    assert len(heard) > 1


def test_two_readers_hear_the_same_tag(stand: Callable[..., Stand]):
    s = stand(lit(1))
    scene_of_both = stand(*s.scene.tags)
    assert epcs(s.driver.inventory(0.05)) == epcs(scene_of_both.driver.inventory(0.05))


def test_write_is_read_back(stand: Callable[..., Stand]):
    s = stand(lit(1))
    assert s.driver.write_user(epc(1), 2, RECORD, PATIENCE_S) == UserWords(epc(1), 2, RECORD)
    assert s.scene.tag(epc(1)).memory.words == (0, 0, *RECORD, *(0,) * 8)
    assert s.driver.read_user(epc(1), 2, 22, PATIENCE_S) == UserWords(epc(1), 2, RECORD)
    whole = s.driver.read_user(epc(1).upper(), 0, None, PATIENCE_S)
    assert whole == UserWords(epc(1), 0, s.scene.tag(epc(1)).memory.words)
    assert s.scene.tag(epc(1)).memory.writes == 1, "one write, not one in each round"


def test_only_the_tag_that_was_asked_for_is_written(stand: Callable[..., Stand]):
    """Not its neighbours, and not one whose longer EPC begins the same."""
    longer = Tag("longer", epc(1) + "0001", UserMemory([0] * 32), lights=(Always(),))
    s = stand(longer, lit(2), lit(1), lit(3))
    assert isinstance(s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S), UserWords)
    written = [tag.name for tag in s.scene.tags if any(tag.memory.words)]
    assert written == [epc(1)]
    assert isinstance(s.driver.read_user(longer.epc, 0, 1, PATIENCE_S), UserWords)


def test_a_prefix_is_no_tag(stand: Callable[..., Stand]):
    s = stand(lit(1))
    failed = s.driver.write_user(epc(1)[:8], 0, (1,), 0.1)
    assert isinstance(failed, Failure)
    assert failed.reason == "other_tags_only"
    assert not any(s.scene.tag(epc(1)).memory.words)


def test_locked_memory(stand: Callable[..., Stand]):
    s = stand(lit(1))
    s.scene.tag(epc(1)).memory.locked = True
    failed = s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S)
    expected = f"writing words 0 to 21 of {epc(1)}: the memory is locked"
    assert failed == Failure("locked", expected, 0)


def test_memory_that_ends_before(stand: Callable[..., Stand]):
    s = stand(lit(1, words=16))
    failed = s.driver.write_user(epc(1), 16, (1, 2), PATIENCE_S)
    assert isinstance(failed, Failure)
    assert (failed.reason, failed.words_written) == ("overrun", 0)
    failed = s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S)
    assert isinstance(failed, Failure)
    assert (failed.reason, failed.words_written) == ("partial", 16)
    assert failed.detail.endswith("16 of 22 written, then overrun")
    failed = s.driver.read_user(epc(1), 0, 17, PATIENCE_S)
    assert isinstance(failed, Failure)
    assert failed.reason == "tag_error", "LLRP 1.0.1 has no word for it"


def test_power_lost_in_the_middle(stand: Callable[..., Stand]):
    s = stand(lit(1, power_fails_after=[5]))
    failed = s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S)
    assert isinstance(failed, Failure)
    assert (failed.reason, failed.words_written) == ("partial", 5)
    assert s.scene.tag(epc(1)).memory.words == (*RECORD[:5], *(0,) * 27)
    assert isinstance(s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S), UserWords)


def test_light_lost_in_the_middle(stand: Callable[..., Stand]):
    s = stand(dark(1))
    s.scene.shine("laser", [epc(1)], time.time_ns())
    writing = s.scene.tag(epc(1)).memory.write

    def write_and_go_dark(address: int, word: int) -> object:
        if address == 7:
            s.scene.shine("laser", [], time.time_ns())
        return writing(address, word)

    s.scene.tag(epc(1)).memory.write = write_and_go_dark  # type: ignore[assignment, method-assign]
    failed = s.driver.write_user(epc(1), 0, RECORD, 0.5)
    assert isinstance(failed, Failure)
    assert (failed.reason, failed.words_written) == ("partial", 8)


def test_worn_memory_is_found_by_reading_back(stand: Callable[..., Stand]):
    worn = Tag(epc(1), epc(1), UserMemory([0] * 32, endurance=1), lights=(Always(),))
    s = stand(worn)
    assert isinstance(s.driver.write_user(epc(1), 0, (7,), PATIENCE_S), UserWords)
    failed = s.driver.write_user(epc(1), 0, (8,), PATIENCE_S)
    expected = f"writing words 0 to 0 of {epc(1)}: word 0 reads 0007, expected 0008"
    assert failed == Failure("partial", expected, 1)


def test_out_of_write_range(stand: Callable[..., Stand]):
    s = stand(lit(1), radio=Reader("r1", (40.0, 0.0, 0.0)))
    assert isinstance(s.driver.read_user(epc(1), 0, 1, PATIENCE_S), UserWords)
    failed = s.driver.write_user(epc(1), 0, RECORD, PATIENCE_S)
    assert isinstance(failed, Failure)
    assert (failed.reason, failed.words_written) == ("no_power", 0)


@pytest.mark.parametrize(
    ("tags", "reason", "detail"),
    [
        ((dark(1),), "nothing_heard", "neither"),
        ((), "nothing_heard", "neither"),
        ((lit(1, dead=True), lit(2)), "other_tags_only", f"but {epc(2)}"),
        ((lit(1, deaf=True),), "no_answer", "the tag stopped answering"),
    ],
    ids=["dark", "no tag", "dead", "deaf"],
)
def test_silence(stand: Callable[..., Stand], tags: tuple[Tag, ...], reason: str, detail: str):
    s = stand(*tags)
    for failed in (
        s.driver.read_user(epc(1), 0, 2, 0.3),
        s.driver.write_user(epc(1), 0, (1, 2), 0.3),
    ):
        assert isinstance(failed, Failure)
        assert failed.reason == reason
        assert detail in failed.detail


@pytest.mark.parametrize(
    ("name", "start", "words", "said"),
    [
        ("door-3", 0, (1,), "'door-3' is no EPC"),
        ("e20", 0, (1,), "'e20' is no EPC"),
        ("", 0, (1,), "'' is no EPC"),
        (epc(1), -1, (1,), "1 words from -1"),
        (epc(1), 65535, (1, 2), "2 words from 65535"),
        (epc(1), 0, (), "0 words from 0"),
        (epc(1), 0, (65536,), "word 65536"),
    ],
)
def test_what_cannot_be_asked(
    stand: Callable[..., Stand], name: str, start: int, words: tuple[int, ...], said: str
):
    failed = stand(lit(1)).driver.write_user(name, start, words, 0.1)
    assert isinstance(failed, Failure)
    assert failed.reason == "bad_request"
    assert said in failed.detail


def test_probe(stand: Callable[..., Stand]):
    s = stand()
    host, port = s.server.address
    assert s.driver.probe() == ReaderInfo(f"{host}:{port}", 0, 0, "emulated", 1)
