"""What a unit answers, by the examples of its manual and by any bytes at all."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_agent.pan_tilt.ptu import replies
from robot_agent.pan_tilt.ptu.replies import Garbled, Refused


@pytest.mark.parametrize(
    ("received", "command", "echo", "text"),
    [
        (b"PP * 22\r\n", "PP", True, "22"),
        (b"pp \r\n* 22\r\n", "PP", True, "22"),
        (b"* 22\r\n", "PP", False, "22"),
        (b"\n* 22\r\n", "PP", False, "22"),
        (b"EE *\r\n", "EE", None, ""),
        (b"*\r\n", "EE", None, ""),
        (b"PR * 185.1428\r\n", "PR", True, "185.1428"),
        (b"!P\r\nPP * 3090\r\n", "PP", True, "3090"),
        (b"PP !T!P* 3090\r\n", "PP", True, "3090"),
    ],
)
def test_answers(received: bytes, command: str, echo: bool | None, text: str):
    assert replies.is_complete(received)
    assert replies.answer(received, command, echo) == text


@pytest.mark.parametrize(
    ("received", "command", "echo"),
    [
        (b"TP * 22\r\n", "PP", True),
        (b"* 22\r\n", "PP", True),
        (b"PP12 *\r\n", "PP123", True),
        (b"PPPP ! Illegal command entered\r\n", "PP", True),
        (b"PP * 22\r\n", "PP", False),
        (b"x* 22\r\n", "PP", None),
        (b"PP * 2", "PP", True),
        (b"", "PP", True),
    ],
)
def test_what_is_no_answer_to_this_question(received: bytes, command: str, echo: bool | None):
    with pytest.raises(Garbled, match=f"^{command} was answered '"):
        replies.answer(received, command, echo)


def test_a_refusal_is_told_in_the_words_of_the_unit():
    with pytest.raises(Refused, match=r"^PP3200: Maximum allowable Pan position is 3090$"):
        replies.answer(b"PP3200 ! Maximum allowable Pan position is 3090\r\n", "PP3200", True)


@pytest.mark.parametrize("text", ["", "Current Pan position is 22", "2-2", "22 22", "nan", "1e3"])
def test_numbers_are_numbers(text: str):
    with pytest.raises(Garbled, match="expected a number"):
        replies.number(text, "PP")


@given(st.binary(max_size=80), st.sampled_from([True, False, None]))
def test_no_bytes_do_anything_else(received: bytes, echo: bool | None):
    replies.is_complete(received)
    try:
        replies.number(replies.answer(received, "PP", echo), "PP")
    except (Garbled, Refused):
        return


def test_a_line_without_end_is_given_up():
    assert replies.is_complete(bytes(2000))
    assert not replies.is_complete(b"PP !P!T\r\n")
