"""Every key as the wire contract spells it, and back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tagmap.conventions import NAME
from tagmap.errors import LinkError
from tagmap.link.keys import Keys

KEYS = Keys("hall-3")


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        (KEYS.keyframes("r1"), "agents/r1/keyframes"),
        (KEYS.agent_pose("r1"), "agents/r1/pose"),
        (KEYS.job_results("r1"), "agents/r1/jobs/results"),
        (KEYS.alive("r1"), "agents/r1/alive"),
        (KEYS.ack("r1"), "robots/r1/ack"),
        (KEYS.pose("r1"), "robots/r1/pose"),
        (KEYS.jobs("r1"), "robots/r1/jobs"),
        (KEYS.map_tags(), "map/tags"),
        (KEYS.map_tag("e200"), "map/tags/e200"),
        (KEYS.map_version(), "map/version"),
        (KEYS.localize(), "localize"),
        (KEYS.lease(), "activation/lease"),
        (KEYS.admin("tags", "survey"), "admin/tags/survey"),
        (KEYS.keyframes(), "agents/*/keyframes"),
        (KEYS.ack(), "robots/*/ack"),
        (KEYS.map_tag(), "map/tags/*"),
        (KEYS.admin(), "admin/*/*"),
    ],
)
def test_keys_are_those_of_the_contract(key: str, expected: str) -> None:
    assert key == f"tagmap/hall-3/{expected}"


@given(st.from_regex(NAME, fullmatch=True))
def test_the_robot_is_the_keys(robot: str) -> None:
    for key in (KEYS.keyframes(robot), KEYS.job_results(robot), KEYS.ack(robot)):
        assert KEYS.robot_of(key) == robot


@pytest.mark.parametrize(
    "key",
    [
        "",
        "tagmap/hall-3",
        "tagmap/hall-3/",
        "tagmap/hall-3/agents/r1",
        "tagmap/hall-3/agents/*/keyframes",
        "tagmap/hall-3/agents/R1/keyframes",
        "tagmap/hall-3/map/tags/r1",
        "tagmap/hall-33/agents/r1/keyframes",
        "tagmap/other/agents/r1/keyframes",
    ],
)
def test_no_robot_in_other_keys(key: str) -> None:
    assert KEYS.robot_of(key) is None


@given(st.text())
def test_any_text_may_arrive_as_a_key(key: str) -> None:
    for text in (key, f"{KEYS.root}/{key}"):
        KEYS.robot_of(text)
        KEYS.tag_of(text)
        KEYS.command_of(text)


def test_tag_and_command_of_a_key() -> None:
    assert KEYS.tag_of(KEYS.map_tag("e200")) == "e200"
    assert KEYS.tag_of(KEYS.map_tag()) is None
    assert KEYS.tag_of(KEYS.map_tags()) is None
    assert KEYS.command_of(KEYS.admin("map", "solve")) == ("map", "solve")
    assert KEYS.command_of(KEYS.admin("map")) is None
    assert KEYS.command_of(KEYS.localize()) is None


@pytest.mark.parametrize("site", ["", "Hall", "a/b", "*", "hall\n", "x" * 33])
def test_a_site_must_be_a_name(site: str) -> None:
    with pytest.raises(LinkError, match="site name"):
        Keys(site)
