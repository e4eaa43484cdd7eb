"""How fast spots are found and how well they are placed, beside OpenCV and SExtractor."""

import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, TypeAlias

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite

Find: TypeAlias = Callable[[Any], Any]

SIGMA_PX, PEAK, AMBIENT, DIM = 1.2, 100.0, 20, 16.0
NOISE = 2.0
THRESHOLD = 30
KNOWN = (float(AMBIENT), NOISE, SIGMA_PX)
"""The others are told about background, noise and size, which detection has to find out."""

SIZES = {"vga_8": (640, 480, 4, 2), "mega_30": (1280, 1024, 6, 5)}
"""Width, height, and columns and rows of spots."""

IMAGES = {"vga_8": 32, "mega_30": 16}
"""Taken in turns: like a camera's, the next image is not in the fast caches yet."""

ROUNDS, PASSES = 15, 5
GRIDS, DIM_GRIDS = 95, 300
SEP_MISSING = "sep is not installed: pip install 'tagmap[bench]'"


def measure(plan: Plan) -> dict[str, list[float] | str]:
    """Every round does the same images with all; of a few passes each image's fastest counts."""
    from fleet.benchmarks.spot_peers import sep_available

    runs: dict[str, list[float] | str] = {}
    peers = sep_available()
    for name in SIZES:
        runs |= _times(plan, name, peers)
    runs |= _errors(plan, peers)
    runs |= _missed(plan)
    return runs


def _times(plan: Plan, name: str, peers: bool) -> dict[str, list[float] | str]:
    import numpy as np

    from fleet.benchmarks.spot_peers import opencv, sep_windowed
    from fleet.simulation.image import Sensor
    from fleet.simulation.spot_grid import spot_grid
    from robot_agent.perception.spots import detect

    width, height, columns, rows = SIZES[name]
    rng = np.random.default_rng(0)
    sensor = Sensor(width, height, NOISE)
    images = [spot_grid(rng, PEAK, sensor, columns, rows)[0] for _ in range(IMAGES[name])]
    into = np.empty_like(images[0])
    finders: dict[str, Find] = {
        "copy": partial(np.copyto, into),
        "detect": detect,
        "opencv": partial(opencv, threshold=THRESHOLD, ambient=AMBIENT),
    }
    if peers:
        finders["sep"] = lambda image: sep_windowed(image, *KNOWN)
    times: dict[str, list[float]] = {key: [] for key in finders}
    for find in finders.values():
        find(images[0])
    for n in range(1 if plan.sample else ROUNDS):
        plan.tell(f"spots: {name}, round {n + 1}")
        for key, find in finders.items():
            times[key].append(_fastest_ms(find, images, 1 if plan.sample else PASSES))
    return _ratios(name, times)


def _fastest_ms(find: Find, images: Sequence[Any], passes: int) -> float:
    """Mean over all images of each one's fastest pass.

    Passes go through all of them. Of each image, as a slow finder's whole pass would never go
    without another process in between, which would be to its disadvantage.
    """
    fastest_s = [float("inf")] * len(images)
    for _ in range(passes):
        for k, image in enumerate(images):
            began_s = time.perf_counter()
            find(image)
            fastest_s[k] = min(fastest_s[k], time.perf_counter() - began_s)
    return 1e3 * sum(fastest_s) / len(images)


def _ratios(name: str, times: dict[str, list[float]]) -> dict[str, list[float] | str]:
    runs: dict[str, list[float] | str] = {
        f"{name}_{key}_ms": times.get(key, SEP_MISSING)
        for key in ("copy", "detect", "opencv", "sep")
    }
    ours = times["detect"]
    runs[f"{name}_detect_by_copy"] = _by(ours, times["copy"])
    runs[f"{name}_opencv_by_detect"] = _by(times["opencv"], ours)
    runs[f"{name}_sep_by_detect"] = _by(times["sep"], ours) if "sep" in times else SEP_MISSING
    return runs


def _by(above: list[float], below: list[float]) -> list[float]:
    return [a / b for a, b in zip(above, below, strict=True)]


def _errors(plan: Plan, peers: bool) -> dict[str, list[float] | str]:
    """RMS error by the Cramér-Rao bound over the same spots, and whether covariances are honest."""
    import numpy as np

    squares, nees = _squares(plan, peers)
    runs: dict[str, list[float] | str] = {
        f"{key}_error_by_bound": [float(np.sqrt(np.mean(values)))] if values else SEP_MISSING
        for key, values in squares.items()
    }
    by_ours = np.sqrt(np.mean(squares["sep"]) / np.mean(squares["detect"])) if peers else None
    runs["sep_error_by_detect"] = SEP_MISSING if by_ours is None else [float(by_ours)]
    return runs | {"nees_by_2": [float(np.mean(nees)) / 2.0]}


def _squares(plan: Plan, peers: bool) -> tuple[dict[str, list[Any]], list[float]]:
    """Squared errors by their bounds, of each finder, and ours by their covariances."""
    import numpy as np

    from fleet.benchmarks.spot_peers import opencv, sep_windowed
    from fleet.evaluation.spot_bound import position_bound
    from fleet.simulation.image import Sensor, flux_of_peak
    from fleet.simulation.spot_grid import nearest, spot_grid
    from robot_agent.perception.spots import detect

    rng, sensor = np.random.default_rng(1), Sensor(read_noise=NOISE)
    squares: dict[str, list[Any]] = {"detect": [], "opencv": [], "sep": []}
    nees: list[float] = []
    for _ in range(2 if plan.sample else GRIDS):
        image, px = spot_grid(rng, PEAK, sensor)
        bound = position_bound(px, flux_of_peak(PEAK, SIGMA_PX), SIGMA_PX, sensor, AMBIENT)
        least = np.trace(bound, axis1=1, axis2=2)
        spots = detect(image)
        found = {"detect": spots.px, "opencv": opencv(image, THRESHOLD, AMBIENT)}
        if peers:
            found["sep"] = sep_windowed(image, *KNOWN)
        for key, places in found.items():
            index, distance = nearest(places, px)
            squares[key].append(np.minimum(distance, 1.0) ** 2 / least)
            if key == "detect":
                e, cov = places[index] - px, spots.cov_px2[index]
                nees += np.einsum("na,nab,nb->n", e, np.linalg.inv(cov), e).tolist()
    return squares, nees


def _missed(plan: Plan) -> dict[str, list[float] | str]:
    import numpy as np

    from fleet.simulation.spot_grid import nearest, spot_grid
    from robot_agent.perception.spots import detect

    rng = np.random.default_rng(2)
    missed = extra = total = 0
    images = 2 if plan.sample else DIM_GRIDS
    for _ in range(images):
        image, px = spot_grid(rng, DIM)
        spots = detect(image)
        found = spots.px[spots.usable]
        missed += int((nearest(found, px)[1] > 2.0).sum())
        extra += int((nearest(px, found)[1] > 3.0).sum())
        total += len(px)
    return {"missed_per_1000": [1000.0 * missed / total], "extra_per_image": [extra / images]}


def _of_size(name: str, by_copy: float) -> tuple[Metric, ...]:
    return (
        Metric(f"{name}_copy_ms", "ms", "lower", "copying the image, the reference"),
        Metric(f"{name}_detect_ms", "ms", "lower", "detect"),
        Metric(f"{name}_opencv_ms", "ms", "lower", "OpenCV: threshold, contours, moments"),
        Metric(f"{name}_sep_ms", "ms", "lower", "sep: extraction, windowed centroids"),
        Metric(f"{name}_detect_by_copy", "x", "lower", "detect by copy", 0.3, by_copy),
        Metric(f"{name}_opencv_by_detect", "x", "higher", "OpenCV by detect", 0.3, 4.0),
        Metric(f"{name}_sep_by_detect", "x", "higher", "sep by detect", 0.3, 40.0),
    )


METRICS = (
    *_of_size("vga_8", 3.5),
    *_of_size("mega_30", 1.8),
    Metric("detect_error_by_bound", "1", "lower", "RMS error by the bound", 0.01, 1.02),
    Metric("opencv_error_by_bound", "1", "lower", "the same of OpenCV"),
    Metric("sep_error_by_bound", "1", "lower", "the same of sep"),
    Metric("sep_error_by_detect", "1", "higher", "RMS error of sep by ours", 0.01, 1.0),
    Metric("nees_by_2", "1", "lower", "squared error by covariance; 1 is honest", 0.03, 1.04),
    Metric("missed_per_1000", "1", "lower", "spots with a peak of 8 sigmas", reach=1.0),
    Metric("extra_per_image", "1", "lower", "places that are none, in the same images", reach=0.01),
)
SUITE = Suite("spots", "how fast and how well spots are placed", METRICS, measure)
