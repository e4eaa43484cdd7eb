"""`[agent]`: a slow line to the reader makes windows and slots longer, not the listening."""

import re
from pathlib import Path

import pytest

from robot_agent.assembly import check
from robot_agent.devices.config import read_config
from robot_agent.settings import ShotsTable
from tagmap.arbitration.blink import BlinkRules
from tagmap.errors import ConfigError
from tagmap.records.scanner_file import write_scanner
from tests.records.test_scanner_file import RECORD

LASER = """
rig = "wide-angle"
T_base_cam = {p_m = [0, 0, 0]}
cameras.network.host = "127.0.0.1"
scanner = "scanner.toml"
laser = {device = "file:laser", bearing_rad = [-1, 1], elevation_rad = [0, 1]}
rfid.llrp.host = "127.0.0.1"
"""


def test_a_blink_slot_has_the_margin_of_a_shot():
    assert ShotsTable().blink_rules() == BlinkRules()
    slow = ShotsTable(margin_s=0.1)
    assert slow.rules().margin_s == 0.1
    assert slow.blink_rules().guard_s == pytest.approx(0.09)
    assert slow.blink_rules().listen_s == pytest.approx(BlinkRules().listen_s)


def test_light_that_the_interlock_would_never_allow_is_refused_at_the_start(tmp_path: Path):
    path = tmp_path / "robot.toml"
    write_scanner(tmp_path / "scanner.toml", RECORD, {})
    path.write_text(LASER + "agent = {stationary = true, shots = {margin_s = 0.1}}\n")
    said = "[agent.shots] needs light for 0.35 s at a time, and [laser] allows longest_s = 0.3"
    with pytest.raises(ConfigError, match=re.escape(said)):
        check(read_config(path), path)
    path.write_text(LASER + "agent = {stationary = true, shots = {margin_s = 0.05}}\n")
    check(read_config(path), path)
