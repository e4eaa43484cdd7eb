"""Protection levels hold whichever tag is wrong, are no larger than they must, and say when they
cannot be given."""

import numpy as np
import pytest

from fleet.benchmarks.integrity import try_out
from fleet.simulation.tag_faults import FAULTS, mapped
from fleet.simulation.views import WIDE_RIG, noisy, places
from tagmap.errors import ConfigError
from tagmap.geometry import se3, stereo
from tagmap.localisation.integrity import fits as fits_module
from tagmap.localisation.integrity.fits import fit
from tagmap.localisation.integrity.hypotheses import hypotheses
from tagmap.localisation.integrity.judge import judge
from tagmap.localisation.integrity.parts import without
from tagmap.localisation.integrity.promise import Promise, radius
from tagmap.localisation.integrity.swaps import swap_ambiguities
from tagmap.localisation.pose import locate
from tagmap.localisation.view import NOTHING, Known, Views, isotropic

SIGMA_PX = 0.2
BOTH, LEFT = [True, True], [True, False]
# Rates that a thousand views can show; one tag in fifty is wrong, so one at a time counts.
LOOSE = Promise(risk=0.1, p_false_alarm=0.02, p_wrong=0.02, p_swapped=0.001)


def views_of(seed, n, fault="none", count=300, seen=BOTH, building="room"):
    rng = np.random.default_rng([seed, n])
    true = places(rng, building, count, n)
    on_map = mapped(rng, true, fault)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    return Views(on_map.p_map, z, isotropic(np.tile(seen, (1, n, 1)), SIGMA_PX)), true, on_map


def errors_m(views, verdict, true, known=NOTHING):
    poses = locate(WIDE_RIG, without(views, verdict.excluded), known)
    return np.linalg.norm(poses.T_map_cam[:, :3, 3] - true.T_map_cam[:, :3, 3], axis=1)


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize(("n", "stereo"), [(4, True), (5, True), (7, True), (5, False), (7, False)])
def test_no_error_exceeds_its_level(n, stereo, fault):
    tried = try_out(n, stereo, fault, 100, 0)
    assert not tried.beyond.any()
    if fault == "none":
        assert not tried.alarmed.any()
        assert tried.has_level.mean() > (0.7 if n == 4 else 0.9)


@pytest.mark.parametrize("fault", FAULTS)
def test_at_a_large_risk_levels_are_exceeded_but_not_more_often(fault):
    views, true, _ = views_of(1, 5, fault, 400)
    verdict = judge(WIDE_RIG, views, promise=LOOSE)
    has_level = np.isfinite(verdict.level_m)
    assert has_level.mean() > (0.3 if fault == "swapped" else 0.6)
    beyond = errors_m(views, verdict, true)[has_level] > verdict.level_m[has_level]
    # Three standard deviations of the count.
    assert beyond.mean() < LOOSE.risk + 3.0 * np.sqrt(LOOSE.risk / has_level.sum())


def test_without_faults_to_expect_the_level_is_the_confidence_ball():
    sure = Promise(risk=0.01, p_false_alarm=1e-4, p_wrong=0.0, p_swapped=0.0)
    views, true, _ = views_of(2, 4, count=4000)
    verdict = judge(WIDE_RIG, views, promise=sure)
    beyond = errors_m(views, verdict, true) > verdict.level_m
    assert 0.0002 < beyond.mean() < 0.01 + 3.0 * np.sqrt(0.01 / 4000)


def test_false_alarms_come_at_their_rate():
    views, _, _ = views_of(3, 6, count=3000)
    alarmed = judge(WIDE_RIG, views, promise=LOOSE).excluded.any(axis=1)
    assert alarmed.mean() == pytest.approx(0.02, abs=4.0 * np.sqrt(0.02 / 3000))


@pytest.mark.parametrize("fault", ["moved", "wrong", "swapped"])
def test_large_faults_are_found_and_only_they(fault):
    views, true, on_map = views_of(4, 7, fault, 200)
    verdict = judge(WIDE_RIG, views)
    large = on_map.size_m > 0.3
    assert (verdict.excluded == on_map.faulty).all(axis=1)[large].mean() > 0.95
    assert verdict.settled[large].mean() > 0.95
    assert errors_m(views, verdict, true)[large].max() < 0.1


def test_the_level_grows_with_what_a_hidden_fault_can_do():
    """Faults too small to find move the pose: covered, though nobody noticed."""
    views, true, on_map = views_of(5, 5, "moved", 600)
    verdict = judge(WIDE_RIG, views)
    hidden = (on_map.size_m < 0.03) & ~verdict.excluded.any(axis=1) & np.isfinite(verdict.level_m)
    poses = locate(WIDE_RIG, views)
    error = np.linalg.norm(poses.T_map_cam[:, :3, 3] - true.T_map_cam[:, :3, 3], axis=1)
    ball = radius(poses.cov[:, :3, :3], np.array(1e-4))
    assert hidden.sum() > 20
    assert (error > ball)[hidden].any()
    assert (error <= verdict.level_m)[hidden].all()


def test_three_tags_have_no_level_and_say_so():
    views, true, _ = views_of(6, 3, count=50)
    verdict = judge(WIDE_RIG, views)
    assert np.isnan(verdict.level_m).all()
    assert verdict.needed.all()
    sure = Promise(p_wrong=1e-6)
    level = judge(WIDE_RIG, views, promise=sure).level_m
    assert np.isfinite(level).mean() > 0.7
    assert (errors_m(views, judge(WIDE_RIG, views, promise=sure), true) <= level)[level > 0].all()


def test_a_pose_from_odometry_checks_three_tags():
    views, true, _ = views_of(7, 3, "moved", 100)
    rng = np.random.default_rng(7)
    sigma = np.array([0.05, 0.05, 0.05, 0.01, 0.01, 0.01])
    T = true.T_map_cam @ se3.exp(sigma * rng.standard_normal((100, 6)))
    known = Known(T_map_cam=T, information=np.diag(sigma**-2.0)[None])
    verdict = judge(WIDE_RIG, views, known)
    has_level = np.isfinite(verdict.level_m)
    assert has_level.mean() > 0.2
    assert (errors_m(views, verdict, true, known) <= verdict.level_m)[has_level].all()


def test_two_wrong_tags_of_eight_are_found():
    rng = np.random.default_rng(8)
    views, _, _ = views_of(8, 8, count=60)
    p = views.p_map.copy()
    p[:, :2] += rng.uniform(0.5, 2.0, (60, 2, 3))
    verdict = judge(WIDE_RIG, Views(p, views.z_px, views.information))
    assert (verdict.excluded == (np.arange(8) < 2)).all(axis=1).mean() > 0.95


def test_too_many_wrong_tags_leave_no_pose():
    rng = np.random.default_rng(9)
    views, _, _ = views_of(9, 6, count=60)
    p = views.p_map.copy()
    p[:, :4] += rng.uniform(0.5, 2.0, (60, 4, 3))
    verdict = judge(WIDE_RIG, Views(p, views.z_px, views.information))
    assert not verdict.agreed.any()
    assert np.isnan(verdict.level_m).all()


def test_uncertain_tags_widen_the_level():
    views, true, _ = views_of(10, 6, count=300)
    rng = np.random.default_rng(10)
    cov = np.broadcast_to(1e-4 * np.eye(3), (1, 6, 3, 3)).copy()
    shaken = views.p_map + 0.01 * rng.standard_normal(views.p_map.shape)
    soft = Views(shaken, views.z_px, views.information, cov)
    verdict, exact = judge(WIDE_RIG, soft), judge(WIDE_RIG, views)
    assert not verdict.excluded.any()
    assert np.nanmedian(verdict.level_m) > 2.0 * np.nanmedian(exact.level_m)
    assert (errors_m(soft, verdict, true) <= verdict.level_m)[np.isfinite(verdict.level_m)].all()


def test_the_quick_look_passes_over_no_swap_that_fits(monkeypatch):
    """Every swap solved, or only those that the screen lets through: the same are possible."""
    hyps = hypotheses(6, 2, True)
    for seen, fault in ((BOTH, "none"), (BOTH, "swapped"), (LEFT, "none"), (LEFT, "swapped")):
        views, _, _ = views_of(11, 6, fault, 60, seen)
        quick = fit(WIDE_RIG, views, NOTHING, hyps, 1e-5)
        with monkeypatch.context() as patch:
            patch.setattr(fits_module, "_hopeful", lambda *_: True)
            full = fit(WIDE_RIG, views, NOTHING, hyps, 1e-5)
        np.testing.assert_array_equal(quick.possible, full.possible)


def isosceles(difference_m):
    """Three tags 2 m above; two sides differ by `difference_m`."""
    p = np.array([[-0.5, 0.0, 2.0], [0.5, 0.0, 2.0], [0.0, 0.9, 2.1]])
    p[2, 0] += difference_m / 2.0 / 0.5 * np.hypot(0.5, 0.9) / 2.0
    return p


def test_near_symmetric_sets_are_known_before_the_shot():
    T = se3.exp(np.array([0.05, 0.1, 0.0, 0.02, -0.01, 0.3]))
    seen = np.tile(BOTH, (3, 1))
    for difference_m, caught in ((0.0, True), (0.005, True), (0.3, False)):
        pairs = swap_ambiguities(WIDE_RIG, isosceles(difference_m), T, seen, SIGMA_PX)
        assert bool(pairs) is caught
        if caught:
            assert (pairs[0].i, pairs[0].j) == (0, 1)
            assert pairs[0].p_unnoticed > 0.5
            assert pairs[0].shift_m > 0.5


def test_the_chance_of_an_unnoticed_swap_is_what_geometry_says():
    """Of pairs in between, by trial: the chi-square test of the swapped names."""
    T, promise = np.eye(4), Promise(risk=1e-3, p_false_alarm=1e-4)
    seen, rng = np.tile(BOTH, (3, 1)), np.random.default_rng(12)
    tested = 0
    for difference_m in (0.0025, 0.003, 0.0035, 0.004):
        p = isosceles(difference_m)
        unsure = swap_ambiguities(WIDE_RIG, p, T, seen, SIGMA_PX, promise=promise)
        found = {(one.i, one.j): one for one in unsure}
        if (0, 1) not in found or not 0.1 < found[0, 1].p_unnoticed < 0.9:
            continue
        z, _ = stereo.project(WIDE_RIG, se3.act(se3.inverse(T), p))
        z = noisy(rng, np.tile(z, (1000, 1, 1)), SIGMA_PX)
        views = Views(p[None, [1, 0, 2]], z, isotropic(seen[None], SIGMA_PX))
        passes = fit(WIDE_RIG, views, NOTHING, hypotheses(3, 0, False), 1e-4).possible[:, 0]
        assert passes.mean() == pytest.approx(found[0, 1].p_unnoticed, abs=0.06)
        tested += 1
    assert tested


def test_what_cannot_be_told_apart_is_covered_or_open():
    """A swap that fits as well as the truth: the level reaches from one pose to the other."""
    certain = Promise(p_wrong=0.0)
    p, T = isosceles(0.0), np.eye(4)
    z, _ = stereo.project(WIDE_RIG, p)
    views = Views(p[None, [1, 0, 2]], z[None], isotropic(np.tile(BOTH, (1, 3, 1)), SIGMA_PX))
    verdict = judge(WIDE_RIG, views, promise=certain)
    poses = locate(WIDE_RIG, views)
    error = np.linalg.norm(poses.T_map_cam[0, :3, 3] - T[:3, 3])
    assert error > 0.5
    assert verdict.exchangeable[0].tolist() == [True, True, False]
    assert not verdict.level_m[0] < error


def test_balls_hold_what_they_say():
    rng = np.random.default_rng(13)
    for sigma in ([1.0, 1.0, 1.0], [1.0, 0.1, 0.1], [1.0, 1.0, 0.01]):
        error = np.sqrt((sigma * rng.standard_normal((200_000, 3))) ** 2 @ np.ones(3))
        outside = (error > radius(np.diag(np.square(sigma)), np.array(0.01))).mean()
        assert 0.001 < outside < 0.0107


@pytest.mark.parametrize(
    "wrong", [{"risk": 0.0}, {"p_false_alarm": 1e-3}, {"p_wrong": 1.0}, {"p_swapped": -0.1}]
)
def test_promises_that_cannot_be_are_refused(wrong):
    with pytest.raises(ConfigError, match=next(iter(wrong))):
        Promise(**wrong)
