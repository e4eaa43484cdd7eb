from pathlib import Path

import numpy as np
import pytest

from fleet.evaluation.mrclam import read_truth
from fleet.evaluation.truth import TrueTrack, at
from tagmap.errors import DataError
from tagmap.geometry import se2

MS = 1_000_000


def track(t_ms: list[int]) -> TrueTrack:
    """1 m/s along x, turning 1 rad/s."""
    t_s = np.array(t_ms) * 1e-3
    T = se2.from_p_theta(np.stack([t_s, 0 * t_s], axis=-1), t_s)
    return TrueTrack(np.array(t_ms, dtype=np.int64) * MS, T)


def test_dense_truth_is_interpolated_and_never_extrapolated():
    t_ns = np.array([-50, 0, 105, 200, 250], dtype=np.int64) * MS
    T, known = at("planar", track([0, 100, 200]), t_ns)
    assert known.tolist() == [1, 2, 3]
    np.testing.assert_allclose(se2.to_p_theta(T)[1], [0.0, 0.105, 0.2], atol=1e-12)


def test_sparse_truth_counts_only_at_its_samples():
    t_ns = np.array([0, 500, 1000, 2999], dtype=np.int64) * MS
    T, known = at("planar", track([0, 1000, 3000]), t_ns)
    assert known.tolist() == [0, 2, 3]
    np.testing.assert_allclose(T[2], track([3000]).T[0], atol=1e-12)


@pytest.mark.parametrize("samples", [[], [70]])
def test_hardly_any_truth(samples: list[int]):
    T, known = at("planar", track(samples), np.array([70, 71, 80], dtype=np.int64) * MS)
    assert known.tolist() == ([0, 1] if samples else [])
    assert len(T) == len(known)


def test_mrclam_truth_dense_sparse_swapped(mrclam_folder: Path, tmp_path: Path):
    sparse = tmp_path / "sparse.csv"
    sparse.write_text("# robot,time_s,x_m,y_m,theta_rad,n\n2,1248272001.000,1.5,-2.0,0.25,7\n")
    truth = read_truth(mrclam_folder, sparse, swaps=(("6", "8"),))
    assert sorted(truth.tracks) == [1, 2]
    assert truth.tracks[2].t_ns.tolist() == [1_248_272_001_000_000_000]
    np.testing.assert_allclose(truth.landmarks["6"], [1.5, 2.0])
    np.testing.assert_allclose(truth.landmarks["8"], [2.0, 1.0])


def test_mrclam_without_truth(mrclam_folder: Path):
    for file in mrclam_folder.glob("*Groundtruth*"):
        file.unlink()
    truth = read_truth(mrclam_folder)
    assert (truth.landmarks, truth.tracks) == ({}, {})


def test_swapping_what_is_not_there(mrclam_folder: Path):
    with pytest.raises(DataError, match="no landmark 99"):
        read_truth(mrclam_folder, swaps=(("6", "99"),))
