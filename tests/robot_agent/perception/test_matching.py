"""Stereo matching: true pairs are kept, one spot is one tag, and open questions stay open."""

from dataclasses import replace

import numpy as np
import pytest

from fleet.simulation.image import Sensor, add_spots, dark, expose, flux_of_peak
from robot_agent.perception.matching import Candidates, Matches, View, candidates, match
from robot_agent.perception.spots import detect
from tagmap.conventions import Array
from tagmap.geometry import stereo
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

SIGMA_PX = 0.05
RIGS = {name: stereo_rig(find_rig(name)) for name in ("thesis", "wide-angle")}
WIDE = RIGS["wide-angle"]


def view(px: Array, camera) -> tuple[View, Array]:
    """The spots inside the image, and their indices (K,)."""
    inside = ((px > 0.0) & (px < [camera.width_px - 1, camera.height_px - 1])).all(-1)
    seen = np.flatnonzero(inside)
    cov = np.broadcast_to(SIGMA_PX**2 * np.eye(2), (len(seen), 2, 2))
    return View(px[seen], cov, np.ones(len(seen), np.bool_)), seen


def look(rig, p_cam: Array, rng, noise_px: float = SIGMA_PX):
    """Views of points (N, 3) in shuffled order, and which point each spot is."""
    px, _ = stereo.project(rig, p_cam)
    views = []
    for side, camera in ((px[:, :2], rig.left), (px[:, 2:], rig.right)):
        order = rng.permutation(len(side))
        noisy = side[order] + noise_px * rng.standard_normal(side.shape)
        one, seen = view(noisy, camera)
        views.append((one, order[seen]))
    return views


def pairs_of(matches: Matches) -> set[tuple[int, int]]:
    return {(int(i), int(j)) for i, j in matches.chosen.pairs}


def scattered(rig, rng, n: int) -> Array:
    """Points around where both cameras look."""
    z = rng.uniform(2.0, 7.0, n)
    half = 0.6 * rig.left.width_px / rig.left.fx_px * z
    return np.stack([rng.uniform(-half, half), rng.uniform(-half, half), z], axis=-1)


@pytest.mark.parametrize("name", RIGS)
def test_true_pairs_are_found_though_many_spots_have_no_partner(name: str):
    rig, rng = RIGS[name], np.random.default_rng(1)
    true = found = wrong_and_sure = 0
    for _ in range(60):
        p_cam = scattered(rig, rng, 8)
        (left, in_left), (right, in_right) = look(rig, p_cam, rng)
        matches = match(rig, left, right)
        truth = {(i, j) for i, p in enumerate(in_left) for j, q in enumerate(in_right) if p == q}
        true += len(truth)
        found += len(truth & pairs_of(matches))
        unsure = dict(
            zip(map(tuple, matches.chosen.pairs.tolist()), matches.ambiguous, strict=True)
        )
        wrong_and_sure += sum(
            1 for pair in pairs_of(matches) - truth
            if not unsure[pair] and any(i == pair[0] or j == pair[1] for i, j in truth)
        )  # fmt: skip
        assert truth <= set(map(tuple, matches.hypotheses.pairs.tolist()))
    assert true > 50
    assert found / true > 0.95
    assert wrong_and_sure == 0


def test_each_spot_is_used_once_and_the_rest_is_listed():
    rng = np.random.default_rng(2)
    (left, _), (right, _) = look(WIDE, scattered(WIDE, rng, 30), rng)
    matches = match(WIDE, left, right)
    for side, unmatched, view_ in (
        (0, matches.unmatched_left, left),
        (1, matches.unmatched_right, right),
    ):
        matched = matches.chosen.pairs[:, side]
        assert len(set(matched.tolist())) == len(matched)
        assert sorted([*matched, *unmatched]) == list(range(len(view_.px)))


def nees_of_positions(noise_px: float) -> list[float]:
    """Squared errors by the covariances stated for SIGMA_PX, of spots off by `noise_px`."""
    rng = np.random.default_rng(3)
    nees = []
    for _ in range(150):
        p_cam = scattered(WIDE, rng, 3)
        (left, in_left), (right, in_right) = look(WIDE, p_cam, rng, noise_px)
        chosen = match(WIDE, left, right).chosen
        for (i, j), p, cov in zip(chosen.pairs, chosen.p_cam, chosen.cov, strict=True):
            if in_left[i] == in_right[j]:
                error = p - p_cam[in_left[i]]
                nees.append(error @ np.linalg.solve(cov, error))
    return nees


def assert_consistent(nees: list[float]) -> None:
    """Their mean, of three degrees of freedom each, is in its 95 % band."""
    assert abs(np.mean(nees) - 3.0) < 1.96 * np.sqrt(6.0 / len(nees))


def test_positions_scatter_as_their_covariance_says():
    nees = nees_of_positions(SIGMA_PX)
    assert len(nees) > 200
    assert_consistent(nees)


def test_no_pair_is_lost_to_a_rig_that_is_off_by_its_sigma():
    """Though its errors are none of the spots' noise, and not in the covariance of a position."""
    off_px = float(np.hypot(SIGMA_PX, WIDE.sigma_px))
    assert len(nees_of_positions(off_px)) == len(nees_of_positions(SIGMA_PX))


def test_positions_from_images_scatter_as_their_covariance_says():
    rng, nees = np.random.default_rng(9), []
    for _ in range(5):
        p_cam, found = rendered(rng)
        for p, cov in zip(found.p_cam, found.cov, strict=True):
            error = p_cam - p
            error = error[np.linalg.norm(error, axis=-1).argmin()]
            nees.append(float(error @ np.linalg.solve(cov, error)))
    assert len(nees) > 150
    assert_consistent(nees)


def rendered(rng: np.random.Generator) -> tuple[Array, Candidates]:
    """Tags (N, 3) on a grid that no two share an epipolar line of, and what two images say."""
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 6), np.linspace(-1.2, 1.2, 6))
    p_cam = np.stack([x.ravel(), (y + 0.08 * x).ravel(), np.full(x.size, 3.5)], axis=-1)
    p_cam += rng.uniform(-0.01, 0.01, p_cam.shape)
    px, _ = stereo.project(WIDE, p_cam)
    views = []
    for side, camera in ((0, WIDE.left), (2, WIDE.right)):
        sensor = Sensor(camera.width_px, camera.height_px, read_noise=2.0)
        light = dark(sensor, 20.0)
        add_spots(light, px[:, side : side + 2], flux_of_peak(60.0, 1.2))
        spots = detect(expose(light, sensor, rng))
        views.append(View(spots.px, spots.cov_px2, spots.usable))
    matches = match(WIDE, *views)
    return p_cam, matches.chosen.at(~matches.ambiguous)


def on_one_epipolar_line():
    """Two tags at one height: parallel cameras see both in one row."""
    p_cam = np.array([[0.0, 0.2, 3.0], [0.5, 0.25, 3.75]])
    px, _ = stereo.project(replace(WIDE), p_cam)
    left, right = view(px[:, :2], WIDE.left)[0], view(px[:, 2:], WIDE.right)[0]
    return p_cam, left, right


def test_two_spots_on_one_epipolar_line_are_ambiguous():
    _, left, right = on_one_epipolar_line()
    matches = match(WIDE, left, right)
    assert len(matches.chosen) == 2
    assert matches.ambiguous.all()
    assert len(matches.hypotheses) == 3


def test_once_a_match_is_proven_false_the_other_follows():
    p_cam, left, right = on_one_epipolar_line()
    for false in ((0, 1), (1, 0)):
        matches = match(WIDE, left, right, false_pairs=[false])
        assert pairs_of(matches) == {(0, 0), (1, 1)}
        order = matches.chosen.pairs[:, 0].argsort()
        np.testing.assert_allclose(matches.chosen.p_cam[order], p_cam, atol=1e-6)
    matches = match(WIDE, left, right, false_pairs=[(0, 0), (1, 0)])
    assert all(j == 1 for _, j in pairs_of(matches))


def test_a_lone_pair_is_not_ambiguous():
    rng = np.random.default_rng(4)
    (left, _), (right, _) = look(WIDE, np.array([[0.1, -0.3, 3.0]]), rng)
    matches = match(WIDE, left, right)
    assert pairs_of(matches) == {(0, 0)}
    assert not matches.ambiguous.any()


def test_all_pairs_on_demand():
    rng = np.random.default_rng(5)
    p_cam = np.stack([np.linspace(-1, 1, 4), np.linspace(-0.8, 0.8, 4), np.full(4, 4.0)], axis=-1)
    (left, in_left), (right, in_right) = look(WIDE, p_cam, rng)
    every = candidates(WIDE, left, right)
    assert (np.diff(every.chi2) >= 0.0).all()
    assert len(every) > 4
    best = {(int(in_left[i]), int(in_right[j])) for i, j in every.pairs[:4]}
    assert best == {(k, k) for k in range(4)}


def test_unusable_spots_take_no_part():
    rng = np.random.default_rng(6)
    (left, _), (right, _) = look(WIDE, np.array([[0.1, -0.3, 3.0]]), rng)
    blind = replace(left, usable=np.zeros(1, np.bool_), cov=np.full((1, 2, 2), np.nan))
    matches = match(WIDE, blind, right)
    assert len(matches.chosen) == len(matches.unmatched_left) == 0
    assert matches.unmatched_right.tolist() == [0]


@pytest.mark.parametrize(("n", "m"), [(0, 0), (0, 3), (2, 0)])
def test_nothing_to_match(n: int, m: int):
    def some(k: int) -> View:
        return View(np.full((k, 2), 100.0), np.tile(np.eye(2), (k, 1, 1)), np.ones(k, np.bool_))

    matches = match(WIDE, some(n), some(m))
    assert len(matches.chosen) == 0
    assert (len(matches.unmatched_left), len(matches.unmatched_right)) == (n, m)
    assert len(candidates(WIDE, some(n), some(m))) == 0


def test_points_behind_the_rig_or_out_of_range_are_no_candidates():
    """Rays that diverge meet behind the cameras."""
    left = View(np.array([[600.0, 511.5]]), 0.01 * np.eye(2)[None], np.ones(1, np.bool_))
    right = View(np.array([[700.0, 511.5]]), 0.01 * np.eye(2)[None], np.ones(1, np.bool_))
    assert len(match(WIDE, left, right).hypotheses) == 0
    assert len(candidates(WIDE, left, right)) == 0


ORIENTATIONS = {
    "across the view": ((1.0, 0.0, 0.0), 0.010),
    "at 45 degrees": ((np.sqrt(0.5), 0.0, np.sqrt(0.5)), 0.035),
    "along the view": ((0.0, 0.0, 1.0), 0.050),
}


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_distance_between_two_tags_at_7_m(orientation: str):
    """Thesis rig, 0.2 px per coordinate: 20 mm at equal depth (thesis 3.2.2); RMS at the bound."""
    rig, rng = RIGS["thesis"], np.random.default_rng(7)
    direction, at_most_m = ORIENTATIONS[orientation]
    # The middle of the strip that both cameras see at 7 m.
    centre = np.array([-0.77, 0.0, 7.0])
    ends = centre + np.outer([-0.5, 0.5], direction)
    px, J = stereo.project(rig, ends)
    assert ((px > 0.0) & (px < [639.0, 479.0] * 2)).all()
    cov_px = 0.04 * np.eye(4)
    measured = px + 0.2 * rng.standard_normal((4000, 2, 4))
    p_cam, _, _ = stereo.triangulate(rig, measured, cov_px)
    distance_m = np.linalg.norm(p_cam[:, 1] - p_cam[:, 0], axis=-1)
    rms_m = np.sqrt(np.mean((distance_m - 1.0) ** 2))
    cov_m2 = np.linalg.inv(np.swapaxes(J, -1, -2) @ J / 0.04).sum(0)
    bound_m = np.sqrt(np.array(direction) @ cov_m2 @ np.array(direction))
    assert rms_m < at_most_m
    assert rms_m / bound_m == pytest.approx(1.0, abs=0.05)
