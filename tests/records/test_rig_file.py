"""Rig files: presets are good, and whatever is wrong with a file is said with its name and key."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest

from tagmap.errors import ConfigError
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import PRESETS, find_rig, presets, read_rig, write_rig

THESIS = (PRESETS / "thesis.toml").read_text()


def test_there_are_presets():
    assert presets() == ["thesis", "wide-angle"]
    for name in presets():
        rig = find_rig(name)
        assert rig.by
        assert rig.made


def test_the_thesis_rig_converges_as_the_thesis_says():
    rig = stereo_rig(find_rig("thesis"))
    R, p = rig.T_right_left[:3, :3], rig.T_right_left[:3, 3]
    printed = [[0.9659, 0.0063, 0.2589], [-0.0056, 1.0, -0.0033], [-0.2589, 0.0017, 0.9659]]
    np.testing.assert_allclose(R, printed, atol=5e-5)
    assert np.degrees(np.arccos(R[2, 2])) == pytest.approx(15.0, abs=0.1)
    # The optical axes are closest 1.12 m ahead: the left axis, x = 0, in the right camera.
    assert -p[0] / R[0, 2] == pytest.approx(1.12, abs=0.01)


def test_a_file_before_a_preset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    Path("thesis").write_text(THESIS.replace("sigma_px = 0.2", "sigma_px = 0.7"))
    assert find_rig("thesis").sigma_px == 0.7


WRONG = {
    "not TOML": (THESIS + "\n[", "not TOML"),
    "a NaN": (THESIS.replace("1629.3", "nan"), r"left\.fx_px is nan"),
    "infinite": (THESIS.replace("317.68", "inf"), r"left\.cx_px is inf"),
    "a negative focal length": (THESIS.replace("1629.3", "-1629.3"), r"left\.fx_px"),
    "a text": (THESIS.replace("1629.3", "'1629.3'"), r"left\.fx_px"),
    "no right camera": (THESIS.split("[right]")[0], "right"),
    "four coefficients": (
        THESIS.replace("[-0.37199, 0.038818, 0.0, 0.0, 0.0]", "[-0.37199, 0.038818, 0.0, 0.0]"),
        "dist has 4 numbers, expected 5",
    ),
    "no unit quaternion": (THESIS.replace("0.991434060", "0.9"), "norm"),
    "a baseline in mm": (
        THESIS.replace("[-0.2909523,", "[-290.9523,"),
        r"a baseline of 290\.952 m, expected 0\.001 to 10 m",
    ),
    "no baseline": (
        THESIS.replace("[-0.2909523, 0.0026767, 0.0193497]", "[0, 0, 0]"),
        r"a baseline of 0 m, expected 0\.001 to 10 m",
    ),
    "a misspelt key": (THESIS.replace("sigma_px", "sigma"), "unknown key sigma,"),
    "a misspelt coefficient": (THESIS.replace("dist =", "distortion =", 1), "left.distortion"),
    "empty": ("", "missing"),
}


@pytest.mark.parametrize("what", WRONG)
def test_refused_with_file_and_reason(what: str, tmp_path: Path):
    text, reason = WRONG[what]
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=reason) as caught:
        read_rig(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_cannot_be_read(tmp_path: Path):
    with pytest.raises(ConfigError, match="No such file"):
        read_rig(tmp_path / "none.toml")
    with pytest.raises(ConfigError, match="thesis, wide-angle"):
        find_rig("thesys")
    with pytest.raises(ConfigError, match="directory"):
        read_rig(tmp_path)
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match="not TOML"):
        read_rig(tmp_path / "binary.toml")


@pytest.mark.parametrize("name", presets())
def test_written_files_are_read_back(name: str, tmp_path: Path):
    path = tmp_path / "rig.toml"
    remarks = {"": "on top\n\nof it", "left.fx_px": "sigma 0.3", "sigma_px": "noise"}
    write_rig(path, find_rig(name), remarks)
    assert read_rig(path) == find_rig(name)
    assert path.read_text().startswith("# on top\n#\n# of it\n")
    assert "  # sigma 0.3\n" in path.read_text()
    with pytest.raises(ConfigError, match="No such file"):
        write_rig(tmp_path / "no" / "rig.toml", find_rig(name), {})


def test_a_rig_is_replaced_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "rig.toml"
    write_rig(path, find_rig("thesis"), {})
    before = path.read_bytes()

    def full(_: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as broken:
        broken.setattr(os, "fsync", full)
        with pytest.raises(ConfigError, match=r"rig\.toml: No space left"):
            write_rig(path, find_rig("wide-angle"), {})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    write_rig(link, find_rig("wide-angle"), {})
    assert link.is_symlink()
    assert read_rig(path) == find_rig("wide-angle")
