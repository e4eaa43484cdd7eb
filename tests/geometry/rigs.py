"""A wide-angle rig a person can picture: two 1280 x 800 cameras, 20 cm apart, toed in a little."""

import numpy as np

from tagmap.geometry import se3
from tagmap.geometry.camera import Camera
from tagmap.geometry.stereo import StereoRig

DISTORTION = np.array([-0.28, 0.09, 1.2e-3, -8e-4, -0.012])
LEFT = Camera(1280, 800, 620.0, 622.0, 641.3, 397.8, DISTORTION)
RIGHT = Camera(1280, 800, 618.0, 619.5, 636.0, 402.1, 0.9 * DISTORTION)
IDEAL = Camera(1280, 800, 600.0, 600.0, 639.5, 399.5, np.zeros(5))

TOED_IN = StereoRig(
    left=LEFT,
    right=RIGHT,
    T_right_left=se3.exp(np.array([-0.2, 0.002, 0.001, 0.004, 0.03, -0.006])),
    sigma_px=0.3,
)
PARALLEL = StereoRig(
    left=IDEAL,
    right=IDEAL,
    T_right_left=se3.exp(np.array([-0.2, 0.0, 0.0, 0.0, 0.0, 0.0])),
    sigma_px=0.3,
)


def points_in_view(rng: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Points (*shape, 3), 1 to 10 m in front of the rig, within 40 degrees of its axis."""
    z = rng.uniform(1.0, 10.0, size=shape)
    return np.stack([z * rng.uniform(-0.8, 0.8, shape), z * rng.uniform(-0.5, 0.5, shape), z], -1)


def central_differences(f, x: np.ndarray, step: float) -> np.ndarray:  # type: ignore[no-untyped-def]
    """(..., k, n) of f by its argument x (..., n)."""
    columns = [(f(x + step * e) - f(x - step * e)) / (2.0 * step) for e in np.eye(x.shape[-1])]
    return np.stack(columns, axis=-1)
