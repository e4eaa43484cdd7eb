"""The unit's side of the protocol, by the examples of the manual."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fleet.emulation.pan_tilt.unit import Unit

S = 1_000_000_000


def said(unit: Unit, commands: str, now_ns: int = 0) -> str:
    return b"".join(unit.receive(commands.encode(), now_ns)).decode()


@pytest.mark.parametrize(
    ("commands", "answers"),
    [
        ("PP ", "PP * Current Pan position is 0\r\n"),
        ("pp ", "PP * Current Pan position is 0\r\n"),
        ("PR\r\n", "PR * 185.1428 seconds arc per Pan position\r\n"),
        ("TN TX ", "TN * Minimum Tilt position is -907\r\nTX * Maximum Tilt position is 604\r\n"),
        ("PP3200 ", "PP3200 ! Maximum allowable Pan position is 3090\r\n"),
        ("LD PP3200 ", "LD *\r\nPP3200 *\r\n"),
        ("PS3300 ", "PS3300 ! Pan speed cannot exceed 2902 positions/sec\r\n"),
        ("PS20 ", "PS20 ! Motor speed cannot be less than 57 pos/sec\r\n"),
        ("PS600 PS ", "PS600 *\r\nPS * Target Pan speed is 600 positions/sec\r\n"),
        ("FT PP ", "FT *\r\nPP * 0\r\n"),
        ("ED PP ", "ED *\r\n* Current Pan position is 0\r\n"),
        ("QQ ", "QQ ! Illegal command entered\r\n"),
        ("PN5 ", "PN5 ! Illegal command entered\r\n"),
        ("PP", ""),
    ],
)
def test_commands(commands: str, answers: str):
    assert said(Unit(), commands) == answers


def test_a_command_may_arrive_in_pieces():
    unit = Unit(echo=False, verbose=False)
    assert said(unit, "P") == ""
    assert said(unit, "P ") == "* 0\r\n"


def test_moves_take_their_time_and_await_holds_back_the_rest():
    unit = Unit(echo=False, verbose=False)
    assert said(unit, "PS500 PP1000 A PP ") == "*\r\n*\r\n"
    assert unit.tick(S) == []
    assert b"".join(unit.tick(3 * S)) == b"*\r\n* 1000\r\n"


def test_slaved_moves_begin_together():
    unit = Unit(echo=False, verbose=False)
    said(unit, "S PP500 TP-300 ")
    assert b"".join(unit.receive(b"PP TP ", S)) == b"* 0\r\n* 0\r\n"
    unit.receive(b"A ", S)
    unit.tick(4 * S)
    assert b"".join(unit.receive(b"PP TP ", 4 * S)) == b"* 500\r\n* -300\r\n"


def test_a_restart_brings_the_defaults_back():
    unit = Unit()
    said(unit, "FT ED PP500 ")
    unit.tick(5 * S)
    unit.restart()
    assert said(unit, "PP ", 5 * S) == "PP * Current Pan position is 0\r\n"


@given(st.lists(st.binary(max_size=30), max_size=20))
def test_no_bytes_stop_it(pieces: list[bytes]):
    unit = Unit()
    for k, piece in enumerate(pieces):
        unit.receive(piece, k * S)
    unit.restart()
    assert said(unit, " PP ").endswith("PP * Current Pan position is 0\r\n")


def test_endless_bytes_without_an_end_are_forgotten():
    unit = Unit()
    for _ in range(100):
        unit.receive(bytes(1000), 0)
    assert len(unit._waiting) <= 64
    assert "PP * " in said(unit, " PP ")
