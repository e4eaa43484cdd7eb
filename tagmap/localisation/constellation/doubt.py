"""How an assignment that fits may be wrong all the same, each way with its probability.

rival        Another assignment is true. All that fit share the posterior.
coincidence  The spots have nothing to do with the map. The evidence divided by that of spots spread
             evenly over the room they span has mean one if so, and exceeds 1 / p with probability
             p at most (Markov), however many hypotheses were tried.
lookalike    The spots are an unmapped part of a building that repeats a plan: each of the places
             that were tried resembles them as loosely as the plan was built, and one may do so
             to within the noise by chance.
foreign      One spot is a lamp where a tag gave no spot, judged by the pose that the others have.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import special

from tagmap.conventions import Array, Index
from tagmap.localisation.constellation.catalogue import Catalogue
from tagmap.localisation.constellation.expectation import Expectation

if TYPE_CHECKING:
    from tagmap.localisation.constellation.kernels.sky import Sky

_ROTATIONS = 8.0 * math.pi**2
# Lamps hang among tags: a layer so thick, seen by a camera of 1 sr where no frame says otherwise.
_LAYER_M = 0.3
_WIDE = 1.0
# Several may be as likely, and their tags better known.
_SLACK = 2.0


@dataclass(frozen=True, slots=True)
class Hypotheses:
    """All that fit so far: tag (K, N), -1 for foreign; ln_evidence (K,) of the spots, pose
    integrated out; chi2 (K,); missed (K,) tags without a spot; T (K, 3, 4) of cam in map.
    """

    tag: Index
    ln_evidence: Array
    chi2: Array
    missed: Index
    T: Array

    def __add__(self, other: "Hypotheses") -> "Hypotheses":
        return Hypotheses(
            np.concatenate([self.tag, other.tag]),
            np.concatenate([self.ln_evidence, other.ln_evidence]),
            np.concatenate([self.chi2, other.chi2]),
            np.concatenate([self.missed, other.missed]),
            np.concatenate([self.T, other.T]),
        )


@dataclass(frozen=True, slots=True)
class Room:
    """Where spots may be: as wide as they span or the frame shows, and as flat as they lie, for
    flatness tells no place. volume in m^3; ln_tilt: ln of the share of all directions that its
    normal may have, which an explanation by a room pays as one by a pose does.
    """

    volume: float
    ln_tilt: float


def ln_weights(found: Hypotheses, room: Room, expect: Expectation) -> Array:
    """ln of the joint density (K,) of spots and assignment under a flat prior of poses.

    Each tag gives a spot or misses it, foreign spots are a Poisson process (Mahler 2007, ch. 12).
    """
    matched = (found.tag >= 0).sum(-1)
    weights: Array = found.ln_evidence + matched * math.log(expect.detection)
    weights = weights + found.missed * math.log1p(-expect.detection) - expect.foreign
    spots = found.tag.shape[-1]
    weights += (spots - matched) * math.log(expect.foreign / room.volume)
    return weights


def p_rival(found: Hypotheses, ln_weight: Array, best: int) -> float:
    """A hypothesis that names fewer spots and those alike is no rival."""
    differs = (found.tag >= 0) & (found.tag != found.tag[best])
    rivals = ln_weight[differs.any(-1)]
    if not len(rivals):
        return 0.0
    return float(np.exp(special.logsumexp(rivals) - special.logsumexp(ln_weight)))


def p_coincidence(
    catalogue: Catalogue, sky: "Sky", room: Room, ln_weight: float, expect: Expectation
) -> float:
    """Given where the first spot is: it may be any tag, the camera turned anyhow about it."""
    n = len(sky.p)
    ln_poses = math.log(len(catalogue) * _ROTATIONS)
    ln_by_chance = (n - 1) * math.log(n / room.volume) - n
    if sky.up[3] > 0.0:
        ln_poses -= math.log(2.0 * sky.up[3])
    else:
        ln_by_chance += room.ln_tilt
    if sky.height[1] > 0.0:
        height_m = float(catalogue.extent[2] + 2.0 * np.sqrt((sky.p**2).sum(-1).max()))
        ln_poses -= math.log(height_m) + 0.5 * math.log(sky.height[1] / (2.0 * math.pi))
    ln_p = math.log(expect.unmapped) + ln_by_chance + ln_poses - ln_weight
    return math.exp(min(0.0, ln_p))


def p_lookalike(
    catalogue: Catalogue,
    sky: "Sky",
    found: Hypotheses,
    best: int,
    tried: int,
    expect: Expectation,
) -> float:
    from tagmap.localisation.constellation.kernels.evidence import new_desk, refine

    desk = new_desk(len(sky.p))
    desk.T[:] = found.T[best]
    loose = expect.likeness_m**2
    _, _, ln_evidence = refine(sky, catalogue.chart, found.tag[best], loose, math.inf, desk)
    ln_p = math.log(expect.unmapped * tried) + ln_evidence - float(found.ln_evidence[best])
    return math.exp(min(0.0, ln_p))


@dataclass(frozen=True, slots=True)
class Without:
    """chi2 and ln_evidence (N,) of an assignment without one spot; of all where that has no tag."""

    chi2: Array
    ln_evidence: Array


def without_each(catalogue: Catalogue, sky: "Sky", found: Hypotheses, best: int) -> Without:
    from tagmap.localisation.constellation.kernels import spots

    without = Without(np.zeros(len(sky.p)), np.zeros(len(sky.p)))
    spots.without_each(
        sky, catalogue.chart, found.tag[best], found.T[best], without.chi2, without.ln_evidence
    )
    return without


def p_foreign(
    without: Without, room: Room, found: Hypotheses, best: int, expect: Expectation
) -> Array:
    """(N,), 1 for spots without a tag. Other tags for the same spot are rivals, counted there."""
    with np.errstate(over="ignore"):
        density = np.exp(found.ln_evidence[best] - without.ln_evidence)
    other = (1.0 - expect.detection) * expect.foreign / room.volume
    matched = (found.tag[best] >= 0) & np.isfinite(without.ln_evidence)
    return np.where(matched, other / (other + expect.detection * density), 1.0)


@dataclass(frozen=True, slots=True)
class Challenge:
    """How well an assignment with more foreign spots than the best one must fit to be as likely.

    chi2 at the most with one more; less by `each` with every further one; matched: by the best.
    """

    chi2: float
    each: float
    matched: int

    def most_chi2(self, matched: int) -> float:
        """With so many matched spots; negative: none can be as likely."""
        return self.chi2 - self.each * (self.matched - 1 - matched)


ANY_CHALLENGE = Challenge(math.inf, 0.0, 0)
NO_CHALLENGE = Challenge(-math.inf, 0.0, 0)


def challenge(
    without: Without, room: Room, found: Hypotheses, best: int, expect: Expectation
) -> Challenge:
    """`best` may have taken a lamp for a tag.

    The density of spots without residuals is that of `best` wherever on the map they are, for it
    depends on the noise and on how the spots lie.
    """
    matched = found.tag[best] >= 0
    perfect = found.ln_evidence[best] + 0.5 * found.chi2[best]
    costs = perfect - (without.ln_evidence + 0.5 * without.chi2)[matched]
    one_foreign = float(costs.min()) + math.log(expect.detection * room.volume / expect.foreign)
    missed = float(found.missed[best]) * math.log1p(-expect.detection)
    chi2 = float(found.chi2[best]) - 2.0 * (missed - _SLACK + one_foreign)
    return Challenge(chi2, 2.0 * one_foreign, int(matched.sum()))


def by_pose(
    catalogue: Catalogue,
    sky: "Sky",
    T_map_cam: Array,
    cov: Array,
    taken: Index,
    expect: Expectation,
) -> tuple[Index, Array]:
    """The nearest tag (N,) not `taken`, -1 where none is near, and the probability (N,) that it is
    another or foreign. T_map_cam (4, 4) with cov (6, 6) in cam axes.
    """
    from tagmap.localisation.constellation.kernels import spots

    n = len(sky.p)
    nearest, density, rest = np.full(n, -1), np.zeros(n), np.zeros(n)
    T = np.ascontiguousarray(T_map_cam[:3])
    spots.by_pose(sky, catalogue.chart, T, cov, taken, nearest, density, rest)
    volume = _seen_area(sky, _WIDE) * _LAYER_M
    other = (1.0 - expect.detection) * expect.foreign / volume + expect.detection * rest
    p: Array = other / (other + expect.detection * density)
    return nearest, p


def room_of(sky: "Sky") -> Room:
    """The box of which even spreading would give spots of their variance.

    A plane through n spots leaves n - 3 to tell its thickness, which is no less than the noise.
    """
    n = len(sky.p)
    p = sky.p - sky.p.sum(0) / n
    squares, axes = np.linalg.eigh(p.T @ p)
    noise = ((sky.cov.sum(0) @ axes) * axes).sum(0) / n
    variance = np.maximum(squares / np.maximum([n - 3, n - 2, n - 1], 1), noise)[::-1]
    area = max(12.0 * math.sqrt(variance[0] * variance[1]), _seen_area(sky, 0.0))
    tilt = 2.0 * math.pi * variance[2] / (n * math.sqrt(variance[0] * variance[1]))
    thickness = math.sqrt(12.0 * variance[2])
    return Room(float(area * thickness), min(0.0, math.log(tilt / (4.0 * math.pi))))


def _seen_area(sky: "Sky", unknown: float) -> float:
    """What the frame shows at the depth of the spots, m^2; without one a solid angle `unknown`."""
    angle = unknown
    if len(sky.frame):
        angle = float((sky.frame[1] - sky.frame[0]) * (sky.frame[3] - sky.frame[2]))
    return angle * float((sky.p[:, 2] ** 2).mean())
