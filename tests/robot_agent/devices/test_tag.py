"""`robot-agent tag read|write` through a reader on a real socket."""

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from robot_agent.cli import main
from tests.robot_agent.devices.conftest import EPC, lit

OTHER = "e20047000000000000000002"
HERE = ("-1.5", "2.25", "3", "--sigma-m", "0.002")
SITE = ("--site-number", "3")


def tag(config: Path, *arguments: str) -> Result:
    verb, *rest = arguments
    if "--timeout-s" not in rest:
        rest += ["--timeout-s", "0.4"]
    return CliRunner().invoke(main, ["tag", verb, "--config", str(config), *rest])


def told(result: Result) -> dict[str, Any]:
    assert result.exit_code == 0, result.stderr
    answer: dict[str, Any] = json.loads(result.stdout)
    return answer


def refusal(result: Result) -> str:
    assert result.exit_code == 1
    assert result.stderr.startswith("robot-agent: ")
    assert result.stderr.count("\n") == 1
    return result.stderr.removeprefix("robot-agent: ").strip()


def test_what_is_written_is_read(robot):
    stand = robot(lit())
    stand.add('robot = {name = "r1", number = 7, site_number = 3}')
    written = told(tag(stand.config, "write", *HERE, "--surveyed", "--json"))
    read = told(tag(stand.config, "read", EPC.upper(), "--json"))
    assert read == written
    assert (read["tag"], read["memory_bytes"], read["form"]) == (EPC, 128, "full")
    assert read["slots"] == {"A": "counts", "B": "blank"}
    record = read["record"]
    assert record["p_m"] == pytest.approx([-1.5, 2.25, 3.0], abs=1e-4)
    assert record["sigma_m"] == pytest.approx([0.002] * 3, rel=1e-3)
    assert (record["site"], record["robot"], record["map_version"]) == (3, 7, 0)
    assert (record["surveyed"], record["frozen"], record["retired"]) == (True, False, False)


def test_in_words(robot):
    stand = robot(lit())
    tag(stand.config, "write", *HERE, *SITE, "--frozen")
    lines = tag(stand.config, "read").stdout.splitlines()
    facts = dict(line.split("  ", 1) for line in lines)
    said = {name.strip(): value.strip() for name, value in facts.items()}
    assert said["tag"] == EPC
    assert said["memory"] == "128 bytes, 2 x full"
    assert said["position"] == "-1.5000  2.2500  3.0000 m"
    assert said["sigma"] == "2.0  2.0  2.0 mm"
    assert said["flags"] == "frozen"


def test_the_next_record_goes_into_the_other_slot(robot):
    stand = robot(lit())
    tag(stand.config, "write", *HERE, *SITE)
    before = stand.memory()
    again = told(tag(stand.config, "write", "1", "2", "3", *HERE[3:], *SITE, "--map-version", "5",
                     "--json"))  # fmt: skip
    assert again["slots"] == {"A": "older", "B": "counts"}
    assert again["record"]["map_version"] == 5
    assert stand.memory()[:44] == before[:44]
    older = tag(stand.config, "write", *HERE, *SITE, "--map-version", "4")
    assert "the record there is of map version 5" in refusal(older)


def test_a_frozen_record_stays_but_for_leave(robot):
    stand = robot(lit())
    tag(stand.config, "write", *HERE, *SITE, "--frozen")
    other = ("9", "9", "3", *HERE[3:], *SITE, "--map-version", "1", "--json")
    assert "the record there is frozen" in refusal(tag(stand.config, "write", *other))
    assert told(tag(stand.config, "write", *other, "--thaw"))["record"]["p_m"][0] == 9.0


def test_a_signed_record_needs_the_key(robot, tmp_path: Path):
    stand = robot(lit())
    for name, byte in (("site.key", b"k"), ("other.key", b"o")):
        (tmp_path / name).write_bytes(16 * byte)
    stand.add('robot = {site_number = 3, memory_key = "site.key"}')
    assert told(tag(stand.config, "write", *HERE, "--json"))["slots"]["A"] == "counts"
    assert told(tag(stand.config, "read", "--json"))["record"]["site"] == 3
    wrong = tag(stand.config, "read", "--key", str(tmp_path / "other.key"))
    assert wrong.exit_code == 1
    assert "the signature is not of this site's key" in wrong.stderr


def test_a_small_memory_gets_the_compact_form_again_and_again(robot):
    stand = robot(lit(words=8))
    for version in (0, 1, 2):
        record = told(tag(stand.config, "write", *HERE, *SITE, "--json"))["record"]
        assert record["map_version"] == version
        assert record["p_m"] == pytest.approx([-1.5, 2.25, 3.0], abs=1e-3)


def test_blank_and_strange_tags_are_told_with_exit_status_1(robot):
    stand = robot(lit())
    blank = tag(stand.config, "read")
    assert refusal(blank) == f"tag {EPC} has no valid record: slot A: blank; slot B: blank"
    assert "128 bytes" in blank.stdout
    tag(stand.config, "write", *HERE, *SITE)
    strange = tag(stand.config, "read", "--site-number", "4")
    assert "of site 3, this is 4" in refusal(strange)


def test_several_tags_are_named_and_left_alone(robot):
    stand = robot(lit(), lit(OTHER))
    said = refusal(tag(stand.config, "write", *HERE, *SITE))
    assert f"2 tags answer: {EPC}, {OTHER}; say which" in said
    assert told(tag(stand.config, "write", *HERE, *SITE, "--tag", OTHER, "--json"))["tag"] == OTHER
    assert not any(stand.memory(EPC))


def test_a_torn_write_leaves_what_was_there(robot):
    stand = robot(lit(power_fails_after=[22 + 10]))
    tag(stand.config, "write", *HERE, *SITE)
    torn = tag(stand.config, "write", "7", "7", "3", *HERE[3:], *SITE, "--map-version", "1")
    assert f"tag {EPC} is not written, " in refusal(torn)
    read = told(tag(stand.config, "read", "--json"))
    assert read["record"]["p_m"][0] == -1.5
    assert read["slots"]["B"].startswith(("CRC", "marker", "blank"))


@pytest.mark.parametrize(
    ("tags", "arguments", "said"),
    [
        ([], ("read", "--timeout-s", "0.1"), "no tag answers. A tag answers only while it is lit"),
        ([], ("read", EPC, "--timeout-s", "0.1"), f"tag {EPC} cannot be read, nothing_heard: "),
        ([lit(OTHER)], ("read", EPC, "--timeout-s", "0.1"), "cannot be read, other_tags_only: "),
        ([lit()], ("read", "not-an-epc"), "cannot be read, bad_request: "),
        ([lit()], ("write", *HERE), "no robot.site_number, and no --site-number"),
        ([lit(words=4)], ("read",), "a memory of 8 bytes, expected at least 16"),
        ([lit()], ("write", *HERE, *SITE, "--key", "none.key"), "none.key: No such file"),
        ([lit()], ("write", "1e9", "0", "0", *HERE[3:], *SITE), "p_m holds 1000000000.0"),
    ],
)
def test_failures_are_one_line(robot, tags: list, arguments: tuple[str, ...], said: str):
    stand = robot(*tags)
    assert said in refusal(tag(stand.config, *arguments))
    assert not any(any(stand.memory(made.epc)) for made in tags)


def test_no_reader(tmp_path: Path):
    config = tmp_path / "robot.toml"
    config.write_text("")
    assert (
        refusal(tag(config, "read")) == f"{config}: no reader is configured, expected [rfid.llrp]"
    )
    config.write_text('rfid.llrp = {host = "127.0.0.1", port = 1}')
    assert "cannot connect: Connection refused" in refusal(tag(config, "read"))


def test_wrong_usage(tmp_path: Path):
    assert tag(tmp_path / "robot.toml", "write", "1", "2").exit_code == 2
    assert tag(tmp_path / "robot.toml", "write", "1", "2", "3").exit_code == 2
    assert tag(tmp_path / "robot.toml", "write", "1", "2", "inf", *HERE[3:]).exit_code == 2
