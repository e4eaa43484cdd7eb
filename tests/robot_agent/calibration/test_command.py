"""`robot-agent calibrate stereo` on files a user would have, and on wrong ones."""

import json
import os
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from robot_agent.cli import main
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import read_rig

BOARD = ("--board", "9x6", "--square-m", "0.03")


def run(folder: Path, out: Path, *options: str):
    command = ["calibrate", "stereo", str(folder), "--out", str(out), *(options or BOARD)]
    return CliRunner().invoke(main, command)


def test_rendered_boards_give_the_rig_that_took_them(boards_folder, tmp_path, small_rig):
    out = tmp_path / "rig.toml"
    done = run(boards_folder, out, *BOARD, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert list(told["rejected"]) == ["03"]
    assert list(told["pairs"]) == ["01", "02", "04", "05", "06", "07", "08"]
    assert told["rms_px"] < 0.15
    baseline_m = np.linalg.norm(small_rig.T_right_left[:3, 3])
    assert abs(told["baseline_m"] - baseline_m) < 4.0 * told["sigmas"]["baseline_m"]
    rig = stereo_rig(read_rig(out))
    for side, camera, true in (
        ("left", rig.left, small_rig.left),
        ("right", rig.right, small_rig.right),
    ):
        sigma = told["cameras"][side]["sigmas"]
        for name in ("fx_px", "fy_px", "cx_px", "cy_px"):
            assert abs(getattr(camera, name) - getattr(true, name)) < 4.0 * sigma[name], name
    moved_m = rig.T_right_left[:3, 3] - small_rig.T_right_left[:3, 3]
    assert np.all(np.abs(moved_m) < 4.0 * np.array(told["sigmas"]["p_m"]))


def test_the_rig_file_says_how_good_it_is(boards_folder, tmp_path):
    out = tmp_path / "rig.toml"
    done = run(boards_folder, out)
    assert done.exit_code == 0, done.output
    assert "expected at most" in done.stdout
    text = out.read_text()
    assert "# baseline 80." in text
    assert "03: left out, residual" in text
    assert "# sigma" in text
    rig = read_rig(out)
    assert rig.rms_px is not None
    assert rig.sigma_px < rig.rms_px < 0.15
    assert rig.by.startswith("robot-agent ")
    assert rig.made.endswith("Z")
    picture = cv2.imread(str(out.with_suffix(".png")))
    assert picture is not None
    assert sorted(path.name for path in tmp_path.iterdir()) == ["rig.png", "rig.toml"]


def refused(folder: Path, out: Path, *options: str) -> str:
    done = run(folder, out, *options)
    assert done.exit_code == 1, done.output
    assert not out.exists()
    (line,) = done.stderr.splitlines()
    return line


def test_images_of_different_sizes(some_boards, tmp_path):
    folder = some_boards([1, 2])
    cv2.imwrite(str(folder / "right02.png"), np.zeros((100, 200), np.uint8))
    line = refused(folder, tmp_path / "rig.toml")
    assert "right02.png: 200 x 100 px, expected 320 x 240 px as left01.png" in line


def test_the_wrong_board(some_boards, tmp_path):
    folder = some_boards([1, 2, 4, 5, 6])
    for board in ("8x6", "8x5", "12x9"):
        line = refused(folder, tmp_path / "rig.toml", "--board", board, "--square-m", "0.03")
        larger = "the board has 9x6 inner corners or more, expected 8x6"
        assert larger in line or f"no board of {board} inner corners" in line


def exchange(folder: Path, a: str, b: str) -> None:
    (folder / a).rename(folder / "kept")
    (folder / b).rename(folder / a)
    (folder / "kept").rename(folder / b)


def shake(folder: Path, name: str) -> None:
    """The board moved by 9 px while this image was exposed, not while its partner was."""
    path = str(folder / name)
    cv2.imwrite(path, cv2.blur(cv2.imread(path, cv2.IMREAD_GRAYSCALE), (9, 1), anchor=(8, 0)))


def defocus(folder: Path, pair: str) -> None:
    for side in ("left", "right"):
        path = str(folder / f"{side}{pair}.png")
        cv2.imwrite(path, cv2.GaussianBlur(cv2.imread(path, cv2.IMREAD_GRAYSCALE), (0, 0), 2.0))


DAMAGES = {
    "none": lambda _: None,
    "left and right exchanged": lambda folder: exchange(folder, "left04.png", "right04.png"),
    "an image of another pair": lambda folder: (folder / "right04.png").write_bytes(
        (folder / "right05.png").read_bytes()
    ),
    "one image shaken": lambda folder: shake(folder, "right04.png"),
    "both out of focus": lambda folder: defocus(folder, "04"),
}


@pytest.mark.parametrize("what", DAMAGES)
def test_the_bad_pair_is_found_and_named_and_no_other(what, some_boards, tmp_path, small_rig):
    folder = some_boards([1, 2, 4, 5, 6, 7, 8])
    DAMAGES[what](folder)
    done = run(folder, tmp_path / "rig.toml", *BOARD, "--json")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert list(told["rejected"]) == ([] if what == "none" else ["04"])
    assert all("residual" in reason for reason in told["rejected"].values())
    baseline_m = np.linalg.norm(small_rig.T_right_left[:3, 3])
    assert abs(told["baseline_m"] - baseline_m) < 4.0 * told["sigmas"]["baseline_m"]


def test_two_right_images_exchanged_are_both_named(some_boards, tmp_path):
    folder = some_boards([1, 2, 4, 5, 6, 7, 8])
    exchange(folder, "right04.png", "right05.png")
    done = run(folder, tmp_path / "rig.toml", *BOARD, "--json")
    assert done.exit_code == 0, done.output
    assert sorted(json.loads(done.stdout)["rejected"]) == ["04", "05"]


def test_images_without_board(tmp_path):
    for name in ("left01.png", "right01.png"):
        cv2.imwrite(str(tmp_path / name), np.full((240, 320), 90, np.uint8))
    line = refused(tmp_path, tmp_path / "rig.toml")
    assert "no board of 9x6 inner corners, whole in both images" in line


def test_a_pair_with_the_board_in_one_image_is_named(some_boards, tmp_path):
    folder = some_boards([1, 2, 4, 5, 6, 7])
    cv2.imwrite(str(folder / "right05.png"), np.full((240, 320), 90, np.uint8))
    done = run(folder, tmp_path / "rig.toml", *BOARD, "--json")
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["rejected"] == {
        "05": "no board of 9x6 inner corners in right05.png"
    }


def test_too_few_pairs_no_images_no_partner(some_boards, tmp_path):
    folder = some_boards([1, 2, 4])
    out = tmp_path / "rig.toml"
    assert "3 good pairs, expected at least 5" in refused(folder, out)
    (folder / "right02.png").unlink()
    assert "no partner for left02.png" in refused(folder, out)
    assert "no images left* and right*" in refused(tmp_path, out)


def test_one_camera_taken_for_two(some_boards, tmp_path):
    folder = some_boards([1, 2, 4, 5, 6, 7])
    for path in folder.glob("left*"):
        (folder / path.name.replace("left", "right")).write_bytes(path.read_bytes())
    assert "are left and right of two cameras?" in refused(folder, tmp_path / "rig.toml")


def test_a_square_in_another_unit(some_boards, tmp_path):
    folder = some_boards([1, 2, 4, 5, 6, 7])
    done = run(folder, tmp_path / "rig.toml", "--board", "9x6", "--square-m", "9")
    assert done.exit_code == 1
    assert re.search(r"baseline 24 m, expected 0\.001 to 10 m: is the side", done.stderr)
    assert not (tmp_path / "rig.toml").exists()


def test_where_the_rig_cannot_be_written_is_told_before_the_work(tmp_path, monkeypatch):
    assert "no folder" in refused(tmp_path, tmp_path / "nowhere" / "rig.toml")
    assert "ends in .toml" in refused(tmp_path, tmp_path / "rig.png")
    monkeypatch.setattr(os, "access", lambda _, mode: mode != os.W_OK)
    assert "cannot be written to" in refused(tmp_path, tmp_path / "rig.toml")


@pytest.mark.parametrize(
    "options",
    [
        ("--board", "9", "--square-m", "0.03"),
        ("--board", "9x2", "--square-m", "0.03"),
        ("--board", "9x6", "--square-m", "0"),
        ("--board", "9x6", "--square-m", "nan"),
        ("--board", "9x6", "--square-m", "0.03", "--window-px", "0"),
        ("--board", "9x6"),
    ],
)
def test_wrong_usage_is_2(tmp_path, options):
    assert run(tmp_path, tmp_path / "rig.toml", *options).exit_code == 2


RECORDED = ("--board", "9x6", "--square-m", "0.025", "--json")


@pytest.mark.data
def test_recorded_boards(recorded_data, tmp_path):
    """All pairs are good when the window keeps to the squares; which would not be is told."""
    done = run(recorded_data / "stereo_chessboards", tmp_path / "rig.toml", *RECORDED)
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert told["rejected"] == {}
    assert len(told["pairs"]) == 13
    assert told["rms_px"] <= 0.22
    assert told["baseline_m"] == pytest.approx(0.0833, abs=0.0003)
    customary = {name: pair["with_window_11_px"] for name, pair in told["pairs"].items()}
    assert max(customary, key=lambda name: customary[name]) == "02"
    assert customary["02"] > 1.0 > 3.0 * told["pairs"]["02"]["left_px"]
    (note,) = [note for note in told["notes"] if "windows" in note]
    assert "02 1." in note
    assert note in (tmp_path / "rig.toml").read_text()


@pytest.mark.data
def test_recorded_boards_are_not_taken_for_smaller_ones(recorded_data, tmp_path):
    folder = recorded_data / "stereo_chessboards"
    line = refused(folder, tmp_path / "rig.toml", "--board", "8x6", "--square-m", "0.025")
    assert ".jpg: the board has 9x6 inner corners or more, expected 8x6" in line


@pytest.mark.data
def test_recorded_boards_with_bad_corners(recorded_data, tmp_path):
    """The usual window reaches beyond the outer squares of pair 02: it is found and left out."""
    folder = recorded_data / "stereo_chessboards"
    done = run(folder, tmp_path / "rig.toml", *RECORDED, "--window-px", "11")
    assert done.exit_code == 0, done.output
    told = json.loads(done.stdout)
    assert next(iter(told["rejected"])) == "02"
    assert told["rms_px"] <= 0.32
    assert told["baseline_m"] == pytest.approx(0.0833, abs=0.0003)
