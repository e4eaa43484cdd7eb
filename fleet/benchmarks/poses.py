"""Poses from tags: how fast beside PoseLib and scipy, how honest about their errors.

A peer is called the way its users call it, one view after another from Python; ours takes the same
views as one batch. All on one thread, in turns, in processor time.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite
from fleet.simulation.views import WIDE_RIG, Places, noisy, places
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.geometry.camera import undistort

SIGMA_PX = 0.2
TAGS = 4
ROUNDS = 9
BATCH, SINGLE = 20_000, 500
HONEST = ((3, True), (4, True), (4, False), (5, False))
NO_PEER = "poselib is not installed: pip install tagmap[bench]"


@dataclass(frozen=True, slots=True)
class Scenes:
    """Noisy rays (S, N, 2) of the left image, and starts beside the truth, T (S, 4, 4)."""

    true: Places
    z_px: Array
    rays: Array
    starts: Array


def measure(plan: Plan) -> dict[str, list[float] | str]:
    rng = np.random.default_rng(0)
    count = 200 if plan.sample else BATCH
    scenes = _scenes(rng, count)
    runs: dict[str, list[float] | str] = {}
    ours = {
        "stereo_s": _stereo(scenes),
        "p3p_s": _p3p(scenes),
        "refine_s": _refine(scenes),
        "align_s": _align(scenes),
    }
    peers = {
        "p3p_by_poselib": "p3p_s",
        "refine_by_poselib": "refine_s",
        "align_by_scipy": "align_s",
    }
    theirs: dict[str, Callable[[], None]] = {"align_by_scipy": _scipy_align(scenes)}
    if find_spec("poselib"):
        theirs["p3p_by_poselib"] = _poselib_p3p(scenes)
        theirs["refine_by_poselib"] = _poselib_refine(scenes)
    for _ in range(1 if plan.sample else ROUNDS):
        for key, run in ours.items():
            _append(runs, key, _seconds(run) / count)
        for key, run in theirs.items():
            each_s = _seconds(run) / min(SINGLE, count)
            own = runs[peers[key]]
            assert isinstance(own, list)
            _append(runs, key, each_s / own[-1])
    for key in peers:
        runs.setdefault(key, NO_PEER)
    for n, stereo in HONEST:
        runs |= _honesty(rng, n, stereo, 500 if plan.sample else 10_000)
    return runs


def _append(runs: dict[str, list[float] | str], key: str, value: float) -> None:
    found = runs.setdefault(key, [])
    assert isinstance(found, list)
    found.append(value)


def _seconds(run: Callable[[], None]) -> float:
    """Of processor time: what else runs on the machine does not count."""
    began_s = time.process_time()
    run()
    return time.process_time() - began_s


def _scenes(rng: np.random.Generator, count: int) -> Scenes:
    true = places(rng, "room", count, TAGS)
    z = noisy(rng, true.stereo_px, SIGMA_PX)
    nearby = true.T_map_cam @ se3.exp(0.02 * rng.standard_normal((count, 6)))
    return Scenes(true, z, undistort(WIDE_RIG.left, z[..., :2]), nearby)


def _stereo(scenes: Scenes) -> Callable[[], None]:
    """The whole way from raw pixels, lens and all, to pose, covariance and doubts."""
    from tagmap.localisation.pose import locate
    from tagmap.localisation.view import Views, isotropic

    views = Views(scenes.true.p_map, scenes.z_px, isotropic(np.ones((1, TAGS, 2)), SIGMA_PX))
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
    from tagmap.localisation.kernels import refine

    p_map, ray, information = scenes.true.p_map, *_one_image(scenes)
    T_rl = np.ascontiguousarray(WIDE_RIG.T_right_left[:3])
    chi2 = np.empty(len(ray))
    return _warm(
        lambda: refine.batch(p_map, ray, information, T_rl, scenes.starts[:, None].copy(), chi2)
    )


def _one_image(scenes: Scenes) -> tuple[Array, Array]:
    """Rays (S, N, 4) of which the left image sees the first two, information (1, N, 4, 4)."""
    ray = np.concatenate([scenes.rays, np.zeros_like(scenes.rays)], axis=-1)
    weight = (WIDE_RIG.left.fx_px / SIGMA_PX) ** 2 * np.diag([1.0, 1.0, 0.0, 0.0])
    return ray, np.tile(weight, (1, TAGS, 1, 1))


def _align(scenes: Scenes) -> Callable[[], None]:
    from tagmap.geometry.kernels import rigid

    p_cam = se3.act(se3.inverse(scenes.true.T_map_cam)[:, None], scenes.true.p_map)
    weight, T = np.ones(TAGS), np.zeros((len(p_cam), 3, 4))
    return _warm(lambda: rigid.batch_align(p_cam, scenes.true.p_map, weight, T))


def _scipy_align(scenes: Scenes) -> Callable[[], None]:
    from scipy.spatial.transform import Rotation

    p_cam = se3.act(se3.inverse(scenes.true.T_map_cam)[:, None], scenes.true.p_map)[:SINGLE]
    pairs = list(zip(scenes.true.p_map, p_cam, strict=False))

    def run() -> None:
        for p_map, seen in pairs:
            Rotation.align_vectors(p_map - p_map.mean(0), seen - seen.mean(0))

    return run


def _poselib_p3p(scenes: Scenes) -> Callable[[], None]:
    import poselib

    pairs = list(zip(_unit(scenes)[:SINGLE], scenes.true.p_map[:, :3], strict=False))

    def run() -> None:
        for rays, p_map in pairs:
            poselib.p3p(rays, p_map)

    return run


def _poselib_refine(scenes: Scenes) -> Callable[[], None]:
    import poselib

    camera = {"model": "PINHOLE", "width": 1, "height": 1, "params": [1.0, 1.0, 0.0, 0.0]}
    starts = []
    for T_cam_map in se3.inverse(scenes.starts[:SINGLE]):
        start = poselib.CameraPose()
        start.R, start.t = T_cam_map[:3, :3], T_cam_map[:3, 3]
        starts.append(start)
    views = list(zip(scenes.rays, scenes.true.p_map, starts, strict=False))

    def run() -> None:
        for rays, p_map, start in views:
            poselib.refine_absolute_pose(rays, p_map, start, camera, {})

    return run


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
    Metric("p3p_s", "s", "lower", "all roots of P3P"),
    Metric("refine_s", "s", "lower", "refinement of one image's pose, 4 tags"),
    Metric("align_s", "s", "lower", "rigid alignment, 4 points"),
    Metric("p3p_by_poselib", "x", "higher", "PoseLib's time by ours", tolerance=0.5, reach=5.0),
    Metric("refine_by_poselib", "x", "higher", "PoseLib's time by ours", tolerance=0.5, reach=5.0),
    Metric("align_by_scipy", "x", "higher", "scipy's time by ours", tolerance=0.5),
    *(metric for case in HONEST for metric in _of_honesty(*case)),
)
SUITE = Suite("poses", "poses from tags: speed and honesty", METRICS, measure)
