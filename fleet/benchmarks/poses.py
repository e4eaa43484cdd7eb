"""Poses from tags: how fast beside PoseLib and scipy, how honest about their errors.

A peer is called the way its users call it, one view after another from Python; ours takes the same
views as one batch. All on one thread, in turns, in processor time.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fleet.benchmarks import pose_peers
from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite
from fleet.simulation.views import WIDE_RIG, Places, noisy, places
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.camera import undistort

SIGMA_PX = 0.2
TAGS, MORE_TAGS = 4, 6
ROUNDS = 9
BATCH, SINGLE = 20_000, 500
_WEIGHT = (WIDE_RIG.left.fx_px / SIGMA_PX) ** 2
HONEST = tuple((n, True) for n in range(3, 9)) + tuple((n, False) for n in range(4, 9))
PEERS = {
    "p3p_by_poselib": "p3p_s",
    "refine_by_poselib": "refine_s",
    "align_by_scipy": "align_s",
}


@dataclass(frozen=True, slots=True)
class Scenes:
    """Noisy rays (S, N, 2) of the left image, and starts beside the truth, T (S, 4, 4)."""

    true: Places
    z_px: Array
    rays: Array
    starts: Array

    @property
    def p_cam(self) -> Array:
        T_cam_map = se3.inverse(self.true.T_map_cam)[:, None]
        return se3.act(T_cam_map, self.true.p_map)

    def __len__(self) -> int:
        return len(self.rays)


def measure(plan: Plan) -> dict[str, list[float] | str]:
    rng = np.random.default_rng(0)
    count = 200 if plan.sample else BATCH
    scenes, more = _scenes(rng, count, TAGS), _scenes(rng, count, MORE_TAGS)
    runs: dict[str, list[float] | str] = {}
    ours = {
        "stereo_s": _stereo(scenes),
        "stereo_6_s": _stereo(more),
        "p3p_s": _p3p(scenes),
        "refine_s": _refine(scenes),
        "align_s": _align(scenes),
    }
    theirs = _peers(scenes)
    for _ in range(1 if plan.sample else ROUNDS):
        took = {key: _seconds(run) / count for key, run in ours.items()}
        for key, each_s in took.items():
            _append(runs, key, each_s)
        for key, run in theirs.items():
            _append(runs, key, _seconds(run) / min(SINGLE, count) / took[PEERS[key]])
    runs |= _refinement(scenes, runs["refine_s"])
    for n, stereo in HONEST:
        runs |= _honesty(rng, n, stereo, 500 if plan.sample else 10_000)
    return {metric.key: runs.get(metric.key, pose_peers.NO_POSELIB) for metric in METRICS}


def _peers(scenes: Scenes) -> dict[str, Callable[[], None]]:
    p_map = scenes.true.p_map[:SINGLE]
    found = {"align_by_scipy": pose_peers.scipy_align(p_map, scenes.p_cam[:SINGLE])}
    if pose_peers.HAS_POSELIB:
        found["p3p_by_poselib"] = pose_peers.p3p(_unit(scenes)[:SINGLE], p_map[:, :3])
        found["refine_by_poselib"] = _their_refinement(scenes).run
    return found


def _their_refinement(scenes: Scenes) -> pose_peers.Refinement:
    p_map = scenes.true.p_map[:SINGLE]
    return pose_peers.Refinement(scenes.rays[:SINGLE], p_map, scenes.starts[:SINGLE])


def _append(runs: dict[str, list[float] | str], key: str, value: float) -> None:
    found = runs.setdefault(key, [])
    assert isinstance(found, list)
    found.append(value)


def _seconds(run: Callable[[], None]) -> float:
    """Of processor time: what else runs on the machine does not count."""
    began_s = time.process_time()
    run()
    return time.process_time() - began_s


def _scenes(rng: np.random.Generator, count: int, tags: int) -> Scenes:
    true = places(rng, "room", count, tags)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    nearby = true.T_map_cam @ se3.exp(0.02 * rng.standard_normal((count, 6)))
    return Scenes(true, z, undistort(WIDE_RIG.left, z[..., :2]), nearby)


def _stereo(scenes: Scenes) -> Callable[[], None]:
    """The whole way from raw pixels, lens and all, to pose, covariance and doubts."""
    from tagmap.localisation.pose import locate
    from tagmap.localisation.view import Views, isotropic

    seen = np.ones((1, scenes.z_px.shape[1], 2))
    views = Views(scenes.true.p_map, scenes.z_px, isotropic(seen, SIGMA_PX))
    return _warm(lambda: locate(WIDE_RIG, views))


def _warm(run: Callable[[], object]) -> Callable[[], None]:
    run()

    def again() -> None:
        run()

    return again


def _p3p(scenes: Scenes) -> Callable[[], None]:
    from tagmap.localisation.kernels import p3p

    rays, p_map = _unit(scenes), np.ascontiguousarray(scenes.true.p_map[:, :3])
    T, n = np.zeros((len(rays), 4, 4, 4)), np.zeros(len(rays), dtype=np.int64)
    return _warm(lambda: p3p.batch(rays, p_map, T, n))


def _unit(scenes: Scenes) -> Array:
    rays = scenes.rays[:, :3]
    rays = np.concatenate([rays, np.ones((*rays.shape[:2], 1))], axis=-1)
    unit: Array = rays / np.sqrt((rays * rays).sum(-1, keepdims=True))
    return unit


def _refine(scenes: Scenes) -> Callable[[], None]:
    return _warm(lambda: _refined(scenes))


def _refined(scenes: Scenes) -> Array:
    """T_map_cam (S, 1, 4, 4) of optima for the left image."""
    from tagmap.localisation.kernels import refine

    T, chi2 = scenes.starts[:, None].copy(), np.empty(len(scenes))
    T_rl = np.ascontiguousarray(WIDE_RIG.T_right_left[:3])
    ray = np.concatenate([scenes.rays, np.zeros_like(scenes.rays)], axis=-1)
    information = _WEIGHT * np.tile(np.diag([1.0, 1.0, 0.0, 0.0]), (1, ray.shape[1], 1, 1))
    refine.batch(scenes.true.p_map, ray, information, T_rl, T, chi2)
    return T


def _refinement(scenes: Scenes, each_s: list[float] | str) -> dict[str, list[float] | str]:
    """Beside PoseLib's time without that of the call, and with its optima."""
    if not pose_peers.HAS_POSELIB or isinstance(each_s, str):
        return {}
    theirs, count = _their_refinement(scenes), min(SINGLE, len(scenes))
    steps = []
    for own_s in each_s:
        took_s = _seconds(theirs.run) - _seconds(theirs.run_without_steps)
        steps.append(took_s / count / own_s)
    above = _chi2(scenes, _refined(scenes)[:count, 0]) - _chi2(scenes, theirs.optima())
    return {"refine_by_poselib_steps": list(steps), "refine_chi2_above": [float(above.max())]}


def _chi2(scenes: Scenes, T_map_cam: Array) -> Array:
    """(M,) of the first M views at T_map_cam (M, 4, 4)."""
    p = se3.act(se3.inverse(T_map_cam)[:, None], scenes.true.p_map[: len(T_map_cam)])
    off = p[..., :2] / p[..., 2:] - scenes.rays[: len(T_map_cam)]
    square: Array = _WEIGHT * (off * off).sum((1, 2))
    return square


def _align(scenes: Scenes) -> Callable[[], None]:
    from tagmap.geometry.kernels import rigid

    p_cam = scenes.p_cam
    weight, T = np.ones(p_cam.shape[1]), np.zeros((len(p_cam), 3, 4))
    return _warm(lambda: rigid.batch_align(p_cam, scenes.true.p_map, weight, T))


def _honesty(
    rng: np.random.Generator, n: int, stereo: bool, count: int
) -> dict[str, list[float] | str]:
    """Whitened RMS error of the poses that no flag doubts, and the share of the others."""
    from tagmap.localisation.pose import locate
    from tagmap.localisation.view import Views, isotropic

    true = places(rng, "room", count, n)
    seen = np.tile([True, stereo], (1, n, 1))
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    poses = locate(WIDE_RIG, Views(true.p_map, z, isotropic(seen, SIGMA_PX)))
    good = poses.doubt == 0
    xi = se3.log(se3.inverse(poses.T_map_cam[good]) @ true.T_map_cam[good])
    white = np.linalg.solve(np.linalg.cholesky(poses.cov[good]), xi[..., None])
    name = f"{'stereo' if stereo else 'single'}_{n}"
    return {
        f"{name}_rms_off": [abs(float(np.sqrt((white**2).mean())) - 1.0)],
        f"{name}_flagged": [1.0 - float(good.mean())],
    }


def _of_honesty(n: int, stereo: bool) -> tuple[Metric, Metric]:
    name, what = f"{'stereo' if stereo else 'single'}_{n}", "two images" if stereo else "one image"
    return (
        Metric(
            f"{name}_rms_off", "1", "lower", f"{n} tags, {what}: |whitened RMS - 1|", reach=0.02
        ),
        Metric(f"{name}_flagged", "1", "lower", f"{n} tags, {what}: share flagged"),
    )


METRICS = (
    Metric("stereo_s", "s", "lower", "4 tags, raw stereo pixels to a judged pose", reach=2e-6),
    Metric("stereo_6_s", "s", "lower", "the same with 6 tags", reach=2e-6),
    Metric("p3p_s", "s", "lower", "all roots of P3P"),
    Metric("refine_s", "s", "lower", "refinement of one image's pose, 4 tags"),
    Metric("align_s", "s", "lower", "rigid alignment, 4 points"),
    Metric("p3p_by_poselib", "x", "higher", "PoseLib's time by ours", tolerance=0.5, reach=5.0),
    Metric("refine_by_poselib", "x", "higher", "PoseLib's time by ours", tolerance=0.5, reach=5.0),
    Metric(
        "refine_by_poselib_steps",
        "x",
        "higher",
        "PoseLib's time, without that of a call that takes no step, by ours",
        tolerance=0.5,
    ),
    Metric(
        "refine_chi2_above",
        "1",
        "lower",
        "largest of our chi2 less that at PoseLib's optimum",
        reach=0.01,
    ),
    Metric("align_by_scipy", "x", "higher", "scipy's time by ours", tolerance=0.5),
    *(metric for case in HONEST for metric in _of_honesty(*case)),
)
SUITE = Suite("poses", "poses from tags: speed and honesty", METRICS, measure)
