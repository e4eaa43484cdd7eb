"""Small data sets in the forms of the real ones, written here, so that nothing is needed."""

from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from fleet.replay.mrclam_calibration import MrclamCalibration
from tagmap.geometry import se2
from tagmap.records.arrays import matrix


def _table(path: Path, rows: list[tuple[float, ...]]) -> None:
    lines = ["# made for a test", *("  ".join(f"{x:.3f}" for x in row) + " \t" for row in rows)]
    path.write_text("\n".join(lines) + "\n")


T0_S = 1_248_272_000.0
MRCLAM_LANDMARKS = {6: (2.0, 1.0), 7: (3.0, -1.0), 8: (1.5, 2.0), 9: (4.0, 0.5), 10: (2.5, -1.4)}
BARCODES = {6: 72, 7: 27, 8: 54, 9: 70, 10: 36}


def driven_m(t_s: float) -> float:
    """How far robot 1 is when it is told to drive 0.1 m/s from T0_S on."""
    calibration = MrclamCalibration()
    return 0.1 * calibration.drive_gain * max(t_s - calibration.latency_s, 0.0)


def _depth_and_bearing(robot: int, p_base: tuple[float, float]) -> tuple[float, float]:
    """What the robot's camera says of a point."""
    camera = MrclamCalibration().cameras[robot]
    x, y = se2.act(se2.inverse(matrix(camera.T_base_cam)), np.array(p_base))
    return camera.depth_scale * x, np.arctan2(y, x)


@pytest.fixture
def mrclam_folder(tmp_path: Path) -> Path:
    """Robot 1 is told to drive along x from the origin; robot 2 stands and has no odometry."""
    folder = tmp_path / "MRCLAM_Dataset99"
    folder.mkdir()
    _table(folder / "Barcodes.dat", [(1, 5), (2, 14), *BARCODES.items()])
    landmarks = [(k, *p, 0.001, 0.001) for k, p in MRCLAM_LANDMARKS.items()]
    _table(folder / "Landmark_Groundtruth.dat", landmarks)
    _table(folder / "Robot1_Odometry.dat", [(T0_S + 0.01 * k, 0.1, 0.0) for k in range(1000)])
    truth = [(T0_S + 0.01 * k, driven_m(0.01 * k), 0.0, 0.0) for k in range(1000)]
    _table(folder / "Robot1_Groundtruth.dat", truth)
    sightings: list[tuple[float, ...]] = []
    for t in (1.0, 2.0, 3.5):
        for subject in (6, 7, 9, 10):
            x, y = MRCLAM_LANDMARKS[subject]
            seen = _depth_and_bearing(1, (x - driven_m(t), y))
            sightings.append((T0_S + t, BARCODES[subject], *seen))
    sightings += [(T0_S + 3.6, 14, 1.0, 0.0), (T0_S + 3.7, 99, 1.0, 0.0)]
    _table(folder / "Robot1_Measurement.dat", sightings)
    _table(
        folder / "Robot2_Measurement.dat", [(T0_S + 1.0, 54, 2.5, 0.5), (T0_S + 2.0, 54, 2.5, 0.5)]
    )
    return folder


@pytest.fixture
def starry_night_file(tmp_path: Path) -> Path:
    """Four points seen from a vehicle that moves 0.1 m/s along its x and turns 0.2 rad/s about z.

    Its camera looks along +x: x_cam = -y, y_cam = -z, z_cam = x.
    """
    k = np.arange(20)
    t = 0.1 * k
    points = np.array([[4.0, 0.5, 0.2], [5.0, -1.0, 0.5], [4.5, 1.0, -0.5], [6.0, 0.0, 0.0]])
    heading = 0.2 * t
    r = np.stack([0.5 * np.sin(heading), 0.5 * (1.0 - np.cos(heading)), 0 * t])
    C_cv = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
    rho = np.array([0.1, 0.0, 0.2])
    f, cu, cv, b = 500.0, 320.0, 240.0, 0.25
    y = np.full((4, len(k), len(points)), -1.0)
    for i in range(len(k)):
        c, s = np.cos(heading[i]), np.sin(heading[i])
        C_vi = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
        X, Y, Z = C_cv @ (C_vi @ (points.T - r[:, [i]]) - rho[:, None])
        y[:, i] = f * X / Z + cu, f * Y / Z + cv, f * (X - b) / Z + cu, f * Y / Z + cv
    y[:, 3, 0] = -1.0
    file = tmp_path / "stars.mat"
    savemat(
        file,
        {
            "t": t[None],
            "y_k_j": y,
            "v_vk_vk_i": np.outer([0.1, 0.0, 0.0], np.ones(len(k))),
            "w_vk_vk_i": np.outer([0.0, 0.0, 0.2], np.ones(len(k))),
            "theta_vk_i": np.stack([0 * t, 0 * t, heading]),
            "r_i_vk_i": r,
            "rho_i_pj_i": points.T,
            "C_c_v": C_cv,
            "rho_v_c_v": rho[:, None],
            **{"fu": f, "fv": f, "cu": cu, "cv": cv, "b": b},
            "y_var": np.array([[1.0], [1.5], [1.0], [1.5]]),
            "v_var": np.full((3, 1), 1e-4),
            "w_var": np.full((3, 1), 1e-4),
        },
    )
    return file
