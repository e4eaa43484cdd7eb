"""Files of samples: whatever is wrong is said with file, line, what is there and what should be."""

from pathlib import Path

import numpy as np
import pytest

from robot_agent.calibration.scanner.samples import read_samples
from tagmap.errors import DataError

HEADER = "theta1_rad,theta2_rad,x_m,y_m,z_m"
GOOD = "0.1,-0.05,0.5,0.25,3.0"


def written(folder: Path, *lines: str) -> Path:
    path = folder / "samples.csv"
    path.write_text("\n".join(lines) + "\n")
    return path


def test_columns_are_mirror_angles_and_targets(tmp_path: Path) -> None:
    path = written(tmp_path, "theta1_rad, theta2_rad, x_m,y_m,z_m", GOOD, "", " 0,0, 0,0,5 ")
    samples = read_samples(path)
    np.testing.assert_array_equal(samples.theta, [[0.1, -0.05], [0.0, 0.0]])
    np.testing.assert_array_equal(samples.p_cam, [[0.5, 0.25, 3.0], [0.0, 0.0, 5.0]])
    assert samples.lines.tolist() == [2, 4]


WRONG = {
    "another header": (["theta1,theta2,x,y,z", GOOD], r"line 1: header 'theta1,.*', expected"),
    "empty": ([""], r"line 1: header '', expected"),
    "a column too few": ([HEADER, "0,0,1,2"], r"line 2: 4 columns, expected 5"),
    "no number": ([HEADER, GOOD, "0,0,x,0,3"], r"line 3: x_m is 'x', expected a finite number"),
    "not finite": ([HEADER, "0,nan,0,0,3"], r"line 2: theta2_rad is 'nan', expected a finite"),
    "degrees": ([HEADER, "5.7,0,0,0,3"], r"line 2: theta1_rad is 5\.7, expected -0\.7 to 0\.7 rad"),
    "mm": ([HEADER, "0,0,0,0,3000"], r"line 2: a target 3000 m from cam, expected 0\.1 to 200 m"),
    "at the camera": ([HEADER, "0,0,0,0,0"], r"line 2: a target 0 m from cam, expected 0\.1 to"),
    "a line twice": ([HEADER, GOOD, "0,0,0,0,3", GOOD], r"line 4 repeats line 2, expected another"),
}  # fmt: skip


@pytest.mark.parametrize("what", WRONG)
def test_what_is_wrong_is_said(what: str, tmp_path: Path) -> None:
    lines, message = WRONG[what]
    path = written(tmp_path, *lines)
    with pytest.raises(DataError, match=message) as caught:
        read_samples(path)
    assert str(caught.value).startswith(f"{path}: ")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"none\.csv: cannot be read: No such file"):
        read_samples(tmp_path / "none.csv")
    (tmp_path / "image.csv").write_bytes(b"\x89PNG\xff")
    with pytest.raises(DataError, match=r"image\.csv: cannot be read: not UTF-8 text"):
        read_samples(tmp_path / "image.csv")
