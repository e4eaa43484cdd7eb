"""`robot-agent run --config`: what cannot work is refused at once, in one line, with its file."""

import signal
from pathlib import Path

import pytest
from click.testing import CliRunner

from robot_agent.cli.run import run
from tagmap.records.scanner_file import write_scanner
from tests.records.test_scanner_file import RECORD

ROBOT = {
    "robot": 'robot = {name = "r1", number = 7}',
    "rig": 'rig = "wide-angle"',
    "where": "T_base_cam = {p_m = [0, 0, 0]}",
    "cameras": 'cameras.folder.folder = "images"',
    "odometry": 'odometry.udp.listen = "127.0.0.1:0"',
    "rfid": 'rfid.llrp.host = "127.0.0.1"',
    "scanner": 'scanner = "scanner.toml"',
    "laser": 'laser = {device = "file:laser", bearing_rad = [-1, 1], elevation_rad = [0, 1]}',
}
SECTOR = "bearing_rad = [-1, 1], elevation_rad = [0, 1]"


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_scanner(tmp_path / "scanner.toml", RECORD, {})
    yield tmp_path
    # A run that gets so far has signals of its own.
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


def refused(change=None, *options):
    """What it says with these lines instead of the usual ones; None: without."""
    lines = [line for line in (ROBOT | (change or {})).values() if line]
    Path("robot.toml").write_text("\n".join(lines))
    done = CliRunner().invoke(run, ["--config", "robot.toml", *options])
    assert done.exit_code == 1, done.output
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1, done.stderr
    assert not list(Path().glob("*.outbox.db*")), "nothing was begun"
    return done.stderr


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"robot": None}, "robot.toml: expected name and number in [robot]"),
        ({"robot": 'robot = {name = "r1"}'}, "expected name and number in [robot]"),
        ({"robot": "robot = {number = 7}"}, "expected name and number in [robot]"),
        ({"robot": 'robot = {name = "R 1", number = 7}'}, "robot.toml: Expected `str` matching"),
        ({"robot": 'robot = {name = "r1", number = 0}'}, "at `$.robot.number`, got 0"),
        ({"robot": 'robot = {name = "r1", number = 7, nmae = 1}'}, "unknown field `nmae`"),
        (
            {"robot": 'robot = {name = "r1", number = 7, memory_key = "site.key"}'},
            "site.key: No such file",
        ),
        ({"rig": None}, "robot.toml: no rig, expected rig = FILE or a preset"),
        ({"rig": 'rig = "nowhere"'}, "nowhere: no such file, and no preset"),
        ({"cameras": None}, "robot.toml: no cameras, expected a table [cameras.DRIVER]"),
        ({"cameras": "cameras = {}"}, "cameras has no driver, expected [cameras.folder]"),
        ({"where": None}, "robot.toml: where are the cameras? Expected T_base_cam or [pan_tilt]"),
        ({"scanner": None}, "robot.toml: there is a [laser], but no scanner"),
        ({"scanner": 'scanner = "lost.toml"'}, "lost.toml: No such file"),
        ({"rfid": None}, "robot.toml: there is a [laser], but no [rfid.llrp]"),
        ({"odometry": None}, "there is a [laser], but no [odometry]"),
        (
            {"agent": "agent.stationary = true"},
            "there is an [odometry], but stationary = true in [agent]",
        ),
        (
            {"laser": f'laser = {{device = "com1", {SECTOR}}}'},
            "laser is 'com1', expected udp:HOST:PORT or file:PATH - at `$.laser`",
        ),
        (
            {"laser": f'laser = {{device = "file:laser", {SECTOR}, heartbeat_s = 0.1}}'},
            "and [laser] allows heartbeat_s = 0.1",
        ),
        (
            {"laser": f'laser = {{device = "file:laser", {SECTOR}, dwell_s = 0.1}}'},
            "and [laser] allows dwell_s = 0.1",
        ),
        ({"agent": "agent.shots.margin_s = 0.1"}, "and [laser] allows longest_s = 0.3"),
        ({"agent": "agent.grab_s = 60"}, "<= 10.0 - at `$.agent.grab_s`, got 60"),
        ({"agent": "agent.confirm_s = nan"}, "at `$.agent.confirm_s`, got nan"),
        ({"agent": "agent.keyframes.way_m = -1"}, "way_m is -1.0, expected more than 0"),
        ({"agent": "agent.spots.sigma_px = [3, 2]"}, "expected least and largest"),
        ({"agent": "agent = ["}, "robot.toml: not TOML"),
    ],
)
def test_what_cannot_work_is_refused(change, said):
    assert said in refused(change)


def test_no_such_file():
    done = CliRunner().invoke(run, ["--config", "lost.toml"])
    assert (done.exit_code, done.stderr) == (
        1,
        "robot-agent: lost.toml: No such file or directory\n",
    )


def test_an_outbox_that_cannot_be_is_refused():
    Path("robot.toml").write_text("\n".join(ROBOT.values()))
    done = CliRunner().invoke(run, ["--config", "robot.toml", "--outbox", "no/such/folder/x.db"])
    assert done.exit_code == 1
    assert "no/such/folder/x.db" in done.stderr
    assert "Traceback" not in done.output


def test_a_pan_tilt_unit_that_is_not_there_is_refused(monkeypatch):
    """It is opened after the uplink was made, which has nothing to close yet."""
    monkeypatch.setattr("robot_agent.gear.UNIT_S", 0.1)
    turned = "T_base_pan = {p_m=[0,0,0]}\nT_pan_tilt = {p_m=[0,0,0]}\nT_tilt_cam = {p_m=[0,0,0]}\n"
    lines = [line for key, line in ROBOT.items() if key != "where"]
    unit = f'[pan_tilt]\n{turned}ptu.port = "/dev/none"\n'
    Path("robot.toml").write_text("\n".join(lines) + "\n" + unit)
    done = CliRunner().invoke(run, ["--config", "robot.toml"])
    assert done.exit_code == 1
    assert "robot.toml: the pan-tilt unit does not answer" in done.stderr


@pytest.mark.parametrize(
    "options",
    [
        [],
        ["--config", "a.toml", "--source", "b.journal"],
        ["--config", "a.toml", "--realtime"],
        ["--config", "a.toml", "--number", "0"],
        ["--config", "a.toml", "--number", "65536"],
        ["--config", "a.toml", "--robot", "No Name"],
        ["--config", "a.toml", "--site", "a/b"],
        ["--source", "b.journal", "--robot", "r1"],
        ["--source", "b.journal", "--robot", "r1", "--number", "1", "--map-cache", "c"],
    ],
)
def test_wrong_usage_is_exit_status_2(options):
    done = CliRunner().invoke(run, options)
    assert done.exit_code == 2
    assert "Traceback" not in done.output
