"""A scanner on a robot: its mirrors, where they are, and how well both are known."""

from dataclasses import dataclass, replace

import numpy as np

from tagmap.conventions import Array, Index
from tagmap.geometry import se3
from tagmap.geometry.scanner.mirrors import PARAMETERS, Mirrors
from tagmap.geometry.scanner.miss import paired

MODELS: dict[str, tuple[str, ...]] = {
    "pinhole": (),
    "simplified": ("separation_m",),
    "full": tuple(name for name in PARAMETERS if not name.startswith("neutral")),
}
"""Which of PARAMETERS a calibration determines, beside the six of T_cam_laser. The neutral angles
are pure gauge: no beam tells the one of X from the pitch of the incident ray, nor the one of Y from
a turn of T_cam_laser about x. They are fixed. A pinhole is there for comparison."""


@dataclass(frozen=True, slots=True)
class Scanner:
    """`free`: those of PARAMETERS that were determined; `cov` (6 + n, 6 + n): covariance of delta
    in T_cam_laser @ exp(delta), then of the n free parameters."""

    mirrors: Mirrors
    T_cam_laser: Array
    free: tuple[str, ...]
    cov: Array

    def moved(self, delta: Array) -> "Scanner":
        """With delta (6 + n,) applied to T_cam_laser and the free parameters."""
        values = dict(zip(self.free, delta[6:].tolist(), strict=True))
        mirrors = replace(
            self.mirrors, **{name: getattr(self.mirrors, name) + x for name, x in values.items()}
        )
        return replace(self, mirrors=mirrors, T_cam_laser=self.T_cam_laser @ se3.exp(delta[:6]))


@dataclass(frozen=True, slots=True)
class Pointing:
    """How beams of a scanner pass points of cam: `off` (..., 2) and `ahead` (...) in m as in Miss,
    with Jacobians of `off` by theta (..., 2, 2), by the point in cam (..., 2, 3), and by the
    unknowns of the scanner (..., 2, 6 + n) in the order of its cov."""

    off: Array
    ahead: Array
    by_theta: Array
    by_point: Array
    by_scanner: Array


def point(scanner: Scanner, theta: Array, p_cam: Array) -> Pointing:
    """Mirror angles theta (..., 2), points p_cam (..., 3)."""
    from tagmap.geometry.kernels import pointing

    shape, theta, p_cam = paired(theta, p_cam)
    n = 6 + len(scanner.free)
    off, ahead, by_theta = np.empty((*shape, 2)), np.empty(shape), np.empty((*shape, 2, 2))
    by_point, by_scanner = np.empty((*shape, 2, 3)), np.empty((*shape, 2, n))
    pointing.points(
        scanner.mirrors.values,
        np.ascontiguousarray(scanner.T_cam_laser),
        columns(scanner.free),
        theta,
        p_cam,
        off.reshape(-1, 2),
        ahead.reshape(-1),
        by_theta.reshape(-1, 2, 2),
        by_point.reshape(-1, 2, 3),
        by_scanner.reshape(-1, 2, n),
    )
    return Pointing(off, ahead, by_theta, by_point, by_scanner)


def columns(free: tuple[str, ...]) -> Index:
    """Their places in PARAMETERS."""
    return np.array([PARAMETERS.index(name) for name in free], dtype=np.int64)
