"""Where a scanner may be, from nothing but samples, many of which may be bad.

Three samples place a scanner that is taken for a pinhole: P3P. Of the poses of many triples the one
counts from which the median sample is seen best. What a pinhole neglects are centimetres.

The thesis solves 3.5-3.9 linearly instead. Measured on grids and random samples: from the null
vector of [U, -D / d], which its least squares should have been, the same optimum is reached as long
as all samples are good; one bad sample in thirty ruins it.
"""

import numpy as np

from robot_agent.calibration.scanner.samples import Samples
from tagmap.conventions import Array, Index
from tagmap.errors import DegenerateError
from tagmap.geometry import se3
from tagmap.geometry.scanner.mirrors import Mirrors, beam

TRIPLES = 300
"""With half of the samples bad 38 of them are good."""
SEED = 1


def place(samples: Samples) -> Array:
    """T_cam_laser (4, 4), to within degrees and a decimetre. Raises DegenerateError."""
    from tagmap.localisation import p3p

    rays = beam(Mirrors(0.0), samples.theta).direction
    triples = _triples(len(samples))
    T, _ = p3p.roots(rays[triples], samples.p_cam[triples])
    T = T.reshape(-1, 4, 4)
    T = T[np.isfinite(T).all(axis=(-1, -2))]
    if not len(T):
        raise DegenerateError("the targets are in one line or place: spread them over the view")
    seen = se3.act(se3.inverse(T)[:, None], samples.p_cam)
    seen /= np.sqrt((seen**2).sum(axis=-1, keepdims=True))
    apart = np.median(((seen - rays) ** 2).sum(axis=-1), axis=-1)
    best: Array = T[np.argmin(apart)]
    return best


def _triples(n: int) -> Index:
    """(TRIPLES, 3) of n samples, the same ones each time."""
    rng = np.random.default_rng(SEED)
    return np.argsort(rng.random((TRIPLES, n)), axis=1)[:, :3]
