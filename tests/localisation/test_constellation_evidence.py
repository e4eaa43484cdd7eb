"""The kernels of the constellation search against central differences and the truth."""

import numpy as np

from fleet.simulation.ceilings import ceiling, frame, look_up, pitch_for
from tagmap.geometry import se3, so3
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.identify import as_sky
from tagmap.localisation.constellation.kernels import evidence
from tagmap.localisation.constellation.kernels.windows import windows
from tagmap.localisation.view import NOTHING, Known


def test_gradient_and_information_are_those_of_chi2():
    rng = np.random.default_rng(1)
    above = ceiling(rng, "random", 60, pitch_for(8))
    spots, chart = look_up(rng, above, 6, 1), Catalogue.of(above.tags()).chart
    up = spots.T_map_cam[2:3, :3]
    known = Known(up_cam=up, height_m=spots.T_map_cam[2:3, 3] + 0.01)
    sky = as_sky(spots.p_cam, spots.cov, None, known)
    desk = evidence.new_desk(7)

    def chi2_at(T: np.ndarray) -> float:
        desk.T[:] = T[:3]
        return float(evidence.linearise(sky, chart, spots.tag, 0.0, desk)[0])

    T = spots.T_map_cam @ se3.exp(0.01 * rng.standard_normal(6))
    steps = 1e-6 * np.eye(6)
    slope = [(chi2_at(T @ se3.exp(s)) - chi2_at(T @ se3.exp(-s))) / 2e-6 for s in steps]
    chi2_at(T)
    np.testing.assert_allclose(-2.0 * desk.g, slope, rtol=1e-4, atol=1e-2)
    g = desk.g.copy()
    change = []
    for s in steps:
        chi2_at(spots.T_map_cam @ se3.exp(s))
        ahead = desk.g.copy()
        chi2_at(spots.T_map_cam @ se3.exp(-s))
        change.append((desk.g - ahead) / 2e-6)
    chi2_at(spots.T_map_cam)
    assert np.abs(desk.H - np.array(change)).max() < 0.02 * np.abs(desk.H).max()
    assert np.abs(g).max() > 0.0


def test_chi2_of_the_truth_has_its_degrees_of_freedom():
    rng = np.random.default_rng(2)
    above = ceiling(rng, "random", 200, pitch_for(8))
    chart, chi2 = Catalogue.of(above.tags()).chart, []
    for _ in range(150):
        spots = look_up(rng, above, 8, 0)
        sky, desk = as_sky(spots.p_cam, spots.cov, frame(), NOTHING), evidence.new_desk(8)
        assert evidence.lay(sky, chart, spots.tag, desk)
        good, value, _ = evidence.refine(sky, chart, spots.tag, 0.0, 1e3, desk)
        assert good
        chi2.append(value)
    # One map serves all views: its errors make 150 sums of 18 a little less than independent.
    assert abs(np.mean(chi2) - 18.0) < 5.0 * np.sqrt(36.0 / 150)


def test_evidence_is_the_integral_over_poses():
    """By importance sampling around the optimum."""
    rng = np.random.default_rng(3)
    above = ceiling(rng, "random", 60, pitch_for(6))
    spots, chart = look_up(rng, above, 5, 0), Catalogue.of(above.tags()).chart
    sky, desk = as_sky(spots.p_cam, spots.cov, None, NOTHING), evidence.new_desk(5)
    evidence.lay(sky, chart, spots.tag, desk)
    _, _, ln_evidence = evidence.refine(sky, chart, spots.tag, 0.0, 1e3, desk)
    T, H = np.vstack([desk.T, [0.0, 0.0, 0.0, 1.0]]), desk.H.copy()
    L = np.linalg.cholesky(np.linalg.inv(H))
    ln_ratio = []
    for _ in range(4000):
        z = rng.standard_normal(6)
        desk.T[:] = (T @ se3.exp(L @ z))[:3]
        chi2, ln_density = evidence.linearise(sky, chart, spots.tag, 0.0, desk)
        ln_ratio.append(ln_density - 0.5 * chi2 + 0.5 * z @ z)
    ln_proposal = 3.0 * np.log(2.0 * np.pi) - 0.5 * np.linalg.slogdet(H)[1]
    integral = np.log(np.mean(np.exp(np.array(ln_ratio) - max(ln_ratio)))) + max(ln_ratio)
    assert abs(ln_evidence - integral - ln_proposal) < 0.1


def test_windows_hold_the_true_distances():
    rng = np.random.default_rng(4)
    p = rng.uniform([-2.0, -2.0, 3.0], [2.0, 2.0, 6.0], (12, 3))
    R = so3.exp(rng.standard_normal((12, 3)))
    cov = R @ np.diag([1e-6, 1e-6, 4e-3]) @ R.swapaxes(-1, -2)
    distance = np.linalg.norm(p[:, None] - p[None], axis=-1)
    low, high = np.zeros((12, 12)), np.zeros((12, 12))
    outside = 0
    for _ in range(200):
        noise = (np.linalg.cholesky(cov) @ rng.standard_normal((12, 3, 1)))[..., 0]
        sky = as_sky(p + noise, cov, None, NOTHING)
        windows(sky, 0.0, 4.5, low, high)
        outside += int(((distance < low) | (distance > high)).sum())
    assert outside == 0
