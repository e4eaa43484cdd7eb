import numpy as np
import pytest
from hypothesis import given

from tagmap.conventions import Array, Kind
from tagmap.geometry import se2, se3, stereo
from tagmap.records import CameraCalibration, Measurement, RigCalibration, Transform, arrays
from tests.geometry.lie import tangents


@given(tangents(6, max_angle_rad=np.pi, batch=()))
def test_spatial_transforms_survive_the_edge(xi: np.ndarray) -> None:
    T = se3.exp(xi)
    record = arrays.transform(T)
    assert record.kind == "spatial"
    np.testing.assert_allclose(arrays.matrix(record), T, atol=1e-13)


@given(tangents(3, max_angle_rad=np.pi, batch=()))
def test_planar_transforms_survive_the_edge(xi: np.ndarray) -> None:
    T = se2.exp(xi)
    record = arrays.transform(T)
    assert record.kind == "planar"
    np.testing.assert_allclose(arrays.matrix(record), T, atol=1e-13)


def test_covariances() -> None:
    packed = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
    cov = arrays.covariance(packed)
    np.testing.assert_array_equal(cov, [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]])
    assert arrays.upper(cov) == packed


def test_rig() -> None:
    left = CameraCalibration(
        width_px=1280,
        height_px=800,
        fx_px=600.0,
        fy_px=601.0,
        cx_px=640.0,
        cy_px=400.0,
        dist=(0.1, 0.2, 0.3, 0.4, 0.5),
    )
    moved = Transform(p_m=(-0.2, 0.0, 0.0), q_wxyz=(1.0, 0.0, 0.0, 0.0))
    rig = arrays.stereo_rig(RigCalibration(left=left, right=left, T_right_left=moved, sigma_px=0.4))
    assert rig.sigma_px == 0.4
    assert (rig.left.fy_px, rig.right.width_px) == (601.0, 1280)
    px, _ = stereo.project(rig, np.array([0.0, 0.0, 6.0]))
    np.testing.assert_allclose(px[:2], [640.0, 400.0])
    assert px[0] > px[2]


def test_measurements_are_stacked_by_form_and_keep_their_places() -> None:
    point = Measurement(point_cam_m=(1.0, 2.0), cov=(1.0, 0.5, 2.0))
    polar = Measurement(range_m=3.0, bearing_rad=0.1, cov=(0.1, 0.0, 0.2))
    blocks = {block.form: block for block in arrays.measurement_blocks([polar, point, polar])}
    assert blocks["range_bearing"].index.tolist() == [0, 2]
    assert blocks["point_cam_m"].index.tolist() == [1]
    np.testing.assert_array_equal(blocks["range_bearing"].z, [[3.0, 0.1], [3.0, 0.1]])
    np.testing.assert_array_equal(blocks["point_cam_m"].cov, [[[1.0, 0.5], [0.5, 2.0]]])
    assert arrays.measurement_blocks([]) == []


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6])
def test_covariance_sizes_are_recognised(n: int) -> None:
    assert arrays.covariance([1.0] * (n * (n + 1) // 2)).shape == (n, n)


@pytest.mark.parametrize("kind", ["planar", "spatial"])
def test_many_matrices_at_once_are_those_one_by_one(kind: Kind) -> None:
    T = np.stack([_example(kind, turn) for turn in (0.0, 1.0, -3.0)])
    transforms = [arrays.transform(one) for one in T]
    np.testing.assert_allclose(arrays.matrices(kind, transforms), T, atol=1e-12)
    assert arrays.matrices(kind, []).shape == (0, *T.shape[1:])


def _example(kind: Kind, turn: float) -> Array:
    if kind == "planar":
        return se2.from_p_theta(np.array([1.0, 2.0]), turn)
    return se3.exp(np.array([1.0, 2.0, 3.0, turn, 0.1, 0.2]))
