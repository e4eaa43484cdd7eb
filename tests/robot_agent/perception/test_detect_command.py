"""`robot-agent detect` on files as a user has them, good and bad."""

import json
import os
import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from fleet.simulation.image import Sensor, add_hot_pixels, add_spots, dark, expose, flux_of_peak
from robot_agent.cli import main
from robot_agent.cli.detect import detect as command
from robot_agent.encoded_image import LARGEST_BYTES
from robot_agent.perception.flags import Flag
from tagmap.geometry import stereo
from tagmap.geometry.covariance import unpack_upper
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import PRESETS, find_rig, read_rig

TAGS = np.array([[-0.6, -0.3, 3.0], [0.2, 0.5, 2.5], [0.9, -0.7, 4.0], [-0.9, 0.8, 3.5]])
RIG = str(PRESETS / "wide-angle.toml")


PAGE = (Path(__file__).parents[3] / "docs" / "perception.md").read_text()


def detect(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["detect", *map(str, arguments)])


def write_pair(folder: Path, bits: int, ending: str) -> tuple[Path, Path]:
    """Images of TAGS; a fifth tag in the left one only."""
    rig = stereo_rig(find_rig("wide-angle"))
    px, _ = stereo.project(rig, TAGS)
    scale = 1.0 if bits == 8 else 200.0
    sensor = Sensor(rig.left.width_px, rig.left.height_px, read_noise=2.0 * scale, bits=bits)
    rng = np.random.default_rng(bits)
    paths = []
    for side in (0, 1):
        light = dark(sensor, 20.0 * scale)
        seen = px[:, 2 * side : 2 * side + 2]
        if side == 0:
            seen = np.concatenate([seen, [[40.3, 900.2]]])
            add_hot_pixels(light, np.array([[900, 80]]), 120.0 * scale)
        add_spots(light, seen, flux_of_peak(120.0 * scale, 1.2))
        paths.append(folder / f"{('left', 'right')[side]}{bits}.{ending}")
        assert cv2.imwrite(str(paths[-1]), expose(light, sensor, rng))
    return paths[0], paths[1]


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    return write_pair(tmp_path_factory.mktemp("pair"), 8, "png")


@pytest.mark.parametrize(("bits", "ending"), [(8, "png"), (16, "png"), (8, "tif"), (16, "tiff")])
def test_the_contract(tmp_path: Path, bits: int, ending: str):
    left, right = write_pair(tmp_path, bits, ending)
    done = detect(left, right, "--rig", RIG, "--json")
    assert done.exit_code == 0, done.output
    found = json.loads(done.stdout)
    assert set(found) == {"left", "right", "matches", "unmatched_left", "unmatched_right"}
    assert [len(found[side]) for side in ("left", "right")] == [6, 4]
    for spot in found["left"] + found["right"]:
        assert set(spot) == {"u_px", "v_px", "cov_px2", "flux", "flags"}
    [hot] = [spot for spot in found["left"] if spot["flags"]]
    assert (hot["flags"], hot["cov_px2"]) == (["hot_pixel"], None)
    [lone] = found["unmatched_left"]
    assert abs(found["left"][lone]["u_px"] - 40.3) < 0.1
    assert found["unmatched_right"] == []
    assert len(found["matches"]) == len(TAGS)
    for entry in found["matches"]:
        assert set(entry) == {"left", "right", "p_cam_m", "cov_m2", "ambiguous"}
        error = TAGS - entry["p_cam_m"]
        error = error[np.linalg.norm(error, axis=-1).argmin()]
        cov = unpack_upper(np.array(entry["cov_m2"]), 3)
        assert error @ np.linalg.solve(cov, error) < 16.0
        assert np.linalg.norm(error) < 0.03


def test_a_table_for_people(pair: tuple[Path, Path]):
    done = detect(*pair, "--rig", "wide-angle")
    assert done.exit_code == 0, done.output
    for word in ("left", "right", "matches", "hot_pixel", "ambiguous"):
        assert word in done.output


def test_a_picture(pair: tuple[Path, Path], tmp_path: Path):
    out = tmp_path / "seen.png"
    assert detect(*pair, "--rig", RIG, "--picture", out).exit_code == 0
    drawn = cv2.imread(str(out), cv2.IMREAD_UNCHANGED)
    assert drawn.shape[2] == 3
    done = detect(*pair, "--rig", RIG, "--picture", tmp_path / "no" / "folder.png")
    assert_refused(done, "No such file")


def test_a_picture_is_never_drawn_over_an_image(pair: tuple[Path, Path], tmp_path: Path):
    before = pair[0].read_bytes()
    link = tmp_path / "link.png"
    link.symlink_to(pair[0])
    for out in (pair[0], link):
        done = detect(*pair, "--rig", RIG, "--picture", out)
        assert (done.exit_code, pair[0].read_bytes()) == (2, before)
        assert "is one of the images" in done.stderr
    done = detect(*pair, "--rig", RIG, "--picture", tmp_path / "seen.jpg")
    assert (done.exit_code, list(tmp_path.iterdir())) == (2, [link])


@pytest.mark.parametrize("gain", ["nan", "inf", "-1"])
def test_a_gain_that_cannot_be(pair: tuple[Path, Path], gain: str):
    assert detect(*pair, "--rig", RIG, "--gain", gain).exit_code == 2


def test_a_full_scale_above_the_image_type_is_refused(pair: tuple[Path, Path]):
    done = detect(*pair, "--rig", RIG, "--full-scale", "4095")
    assert_refused(done, "left8.png: full scale is 4095, expected 1 to 255: the image has 8 bits")
    assert detect(*pair, "--rig", RIG, "--full-scale", "255").exit_code == 0


def test_black_images_are_no_error(tmp_path: Path):
    path = tmp_path / "black.png"
    cv2.imwrite(str(path), np.zeros((1024, 1280), np.uint8))
    done = detect(path, path, "--rig", RIG, "--json")
    assert done.exit_code == 0
    assert all(value == [] for value in json.loads(done.stdout).values())


def test_an_over_exposed_image_is_told(pair: tuple[Path, Path], tmp_path: Path):
    path = tmp_path / "white.png"
    cv2.imwrite(str(path), np.full((1024, 1280), 255, np.uint8))
    done = detect(pair[0], path, "--rig", RIG, "--json")
    assert done.exit_code == 0
    assert json.loads(done.stdout)["right"] == []
    assert done.stderr == f"over-exposed: {path}: 100 % of it is at full scale (255)\n"
    assert detect(*pair, "--rig", RIG).stderr == ""


def assert_refused(done: Result, reason: str) -> None:
    assert done.exit_code == 1, done.output
    assert done.stdout == ""
    assert done.stderr.startswith("robot-agent: ")
    assert done.stderr.count("\n") == 1
    assert reason in done.stderr


def wrong_images(folder: Path) -> dict[str, tuple[Path, str]]:
    """A file in place of the right image, and what is said of it."""
    shape, even = (1024, 1280), np.zeros((1024, 1280), np.uint8)
    images = {
        "colour.png": (np.zeros((*shape, 3), np.uint8), "3 channels, expected one"),
        "small.png": (even[:480, :640], "is 640x480 px"),
        "deep.png": (even.astype(np.uint16), "uint16"),
        "float.tiff": (even.astype(np.float32), "float32"),
        "nan.tiff": (np.full(shape, np.nan, np.float32), "float32"),
        "signed.tiff": (even.astype(np.int16), "int16"),
    }
    made = {}
    for name, (image, reason) in images.items():
        cv2.imwrite(str(folder / name), image)
        made[name] = (folder / name, reason)
    (folder / "text.png").write_text("not an image")
    (folder / "empty.png").write_bytes(b"")
    whole = cv2.imencode(".png", even)[1].tobytes()
    (folder / "cut.png").write_bytes(whole[:40])
    whole = cv2.imencode(".png", np.arange(even.size, dtype=np.uint8).reshape(shape))[1].tobytes()
    (folder / "half.png").write_bytes(whole[: len(whole) // 2])
    whole = cv2.imencode(".tif", even)[1].tobytes()
    (folder / "half.tif").write_bytes(whole[: len(whole) // 2])
    for name in ("text.png", "empty.png", "cut.png", "half.png", "half.tif"):
        made[name] = (folder / name, "not an image")
    made["missing"] = (folder / "missing.png", "No such file")
    made["a folder"] = (folder, "directory")
    made["endless"] = (Path("/dev/zero"), "device or pipe, expected a file: PNG or TIFF")
    os.mkfifo(folder / "pipe.png")
    made["a pipe"] = (folder / "pipe.png", "device or pipe")
    with (folder / "huge.tif").open("wb") as huge:
        huge.truncate(2 * LARGEST_BYTES)
    made["huge"] = (folder / "huge.tif", "has 512 MiB, expected at most 256 MiB")
    return made


def test_wrong_images_are_refused_in_one_line(
    pair: tuple[Path, Path], tmp_path: Path, capfd: pytest.CaptureFixture[str]
):
    for path, reason in wrong_images(tmp_path).values():
        done = detect(pair[0], path, "--rig", RIG)
        assert_refused(done, reason)
        assert str(path) in done.stderr
    assert capfd.readouterr().err == "", "decoders speak past Python's stderr"


def test_wrong_rigs_are_refused_in_one_line(pair: tuple[Path, Path], tmp_path: Path):
    assert_refused(detect(*pair, "--rig", "thesis"), "is for 640x480 px")
    assert_refused(detect(*pair, "--rig", tmp_path / "none.toml"), "none.toml: No such file")
    bad = tmp_path / "bad.toml"
    bad.write_text((PRESETS / "wide-angle.toml").read_text().replace("639.5", "nan", 1))
    assert_refused(detect(*pair, "--rig", bad), "nan")


def test_a_crowded_image_is_refused(tmp_path: Path):
    path = tmp_path / "stars.png"
    image = np.zeros((1024, 1280), np.uint8)
    image[4::8, 4::8] = 200
    cv2.imwrite(str(path), image)
    assert_refused(detect(path, path, "--rig", RIG), "more than 1024 bright places")


@pytest.mark.parametrize("arguments", [[], ["a.png"], ["a.png", "b.png"], ["a", "b", "--what"]])
def test_wrong_usage(arguments: list[str]):
    assert detect(*arguments).exit_code == 2


def test_every_option_and_flag_is_on_the_page():
    options = {name for parameter in command.params for name in parameter.opts if "--" in name}
    assert options == set(re.findall(r"^\| `(--[a-z-]+)", PAGE, re.MULTILINE))
    assert {name.lower() for name in Flag.__members__} <= set(
        re.findall(r"^\| `([a-z_]+)`", PAGE, re.MULTILINE)
    )


def test_the_rig_file_on_the_page_is_one(tmp_path: Path):
    block = PAGE.split("## Rig files")[1].split("The thesis rig")[0]
    text = "\n".join(line.strip() for line in block.splitlines())
    rig = text + "\n" + text.split("[left]")[1].split("[T_right_left]")[0].join(["[right]", ""])
    rig = rig.replace("# and [right]", "")
    (tmp_path / "rig.toml").write_text(rig)
    assert read_rig(tmp_path / "rig.toml").left.fx_px == 1629.3
