"""Views solved under every hypothesis.

Each is solved by itself, from the pixels, so its pose is not disturbed by what it says is wrong,
be the error ever so large (solution separation as in Blanch et al. 2015, "Baseline advanced RAIM
user algorithm and possible improvements", which linearises where this solves again).
"""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Mask
from tagmap.geometry import se3, so3
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.integrity.hypotheses import Hypotheses
from tagmap.localisation.integrity.parts import seen, some, some_known
from tagmap.localisation.integrity.promise import bounds
from tagmap.localisation.integrity.screen import misfit_of_swaps
from tagmap.localisation.pose import Doubt, locate
from tagmap.localisation.view import Known, Views

# A pose with these is none. FEW and COLLINEAR come with a pose only where a prior determines it.
_UNSOUND = int(Doubt.NO_ROOT | Doubt.CURVED | Doubt.SINGULAR | Doubt.NO_RAY)
_VIEWS_AT_ONCE = 20_000
# Swaps whose linear chi2 is so many times the bound are not solved: no curvature makes up for it.
_HOPELESS = 25.0


@dataclass(frozen=True, slots=True)
class Fits:
    """S views under H hypotheses each; (S, H) unless said otherwise.

    T_map_cam (S, H, 4, 4), cov (S, H, 6, 6) of its tangent
    chi2, bound  infinite chi2: nothing comes near to the view; infinite bound: no redundancy
    sound        there is one pose, and its covariance is true
    distinct     it says something about this view that no smaller hypothesis says
    """

    T_map_cam: Array
    cov: Array
    chi2: Array
    bound: Array
    sound: Mask
    distinct: Mask

    @property
    def possible(self) -> Mask:
        """Not rejected."""
        return self.distinct & (self.excess <= 1.0)

    @property
    def excess(self) -> Array:
        """chi2 by its bound; 0 without redundancy."""
        bounded = np.isfinite(self.bound)
        return np.where(bounded, self.chi2 / np.where(bounded, self.bound, 1.0), 0.0)

    def of(self, chosen: Index) -> "Fits":
        """Of some of the views."""
        return Fits(*(getattr(self, name)[chosen] for name in Fits.__slots__))


def fit(rig: StereoRig, views: Views, known: Known, hyps: Hypotheses, p_reject: float) -> Fits:
    """Solve S views under every hypothesis that has a chance, to be rejected with p_reject."""
    S, H = len(views), len(hyps)
    fits = Fits(
        np.full((S, H, 4, 4), np.nan),
        np.full((S, H, 6, 6), np.nan),
        np.full((S, H), np.inf),
        np.ones((S, H)),
        np.zeros((S, H), dtype=bool),
        np.asarray(~(hyps.accused & ~seen(views)[:, None]).any(-1)),
    )
    worth = fits.distinct & ~hyps.swaps
    _solve(rig, views, known, hyps, p_reject, worth, fits)
    worth = fits.distinct & hyps.swaps
    worth[:, hyps.swaps] &= _hopeful(rig, views, hyps, fits)
    _solve(rig, views, known, hyps, p_reject, worth, fits)
    return fits


def _hopeful(rig: StereoRig, views: Views, hyps: Hypotheses, fits: Fits) -> Mask:
    """Which swaps (S, P) may fit: without the two tags the view must fit, and where that leaves
    one pose, the two must not be far from each other's places."""
    without = hyps.pairs
    hopeful: Mask = fits.chi2[:, without] <= fits.bound[:, :1]
    sound = fits.sound[:, without]
    T, cov = fits.T_map_cam[:, without], fits.cov[:, without]
    at, pair = np.nonzero(hopeful & sound)
    if len(at):
        i, j = np.nonzero(hyps.accused[without])[1].reshape(-1, 2)[pair].T
        misfit = misfit_of_swaps(rig, views, at, i, j, T[at, pair], cov[at, pair])
        hopeful[at, pair] = misfit <= _HOPELESS * fits.bound[at, 0]
    return hopeful


def _solve(
    rig: StereoRig,
    views: Views,
    known: Known,
    hyps: Hypotheses,
    p_reject: float,
    worth: Mask,
    fits: Fits,
) -> None:
    """Fill in those of `worth` (S, H)."""
    every_s, every_h = np.nonzero(worth)
    for begin in range(0, len(every_s), _VIEWS_AT_ONCE):
        s, h = every_s[begin : begin + _VIEWS_AT_ONCE], every_h[begin : begin + _VIEWS_AT_ONCE]
        poses = locate(rig, _under(views, hyps, s, h), some_known(known, s))
        bound = bounds(poses.dof, p_reject)
        second = (poses.n > 1) & (poses.chi2_all[:, 1] <= bound)
        hopeless = (poses.doubt & Doubt.NO_ROOT) != 0
        fits.T_map_cam[s, h], fits.cov[s, h] = poses.T_map_cam, poses.cov
        fits.chi2[s, h] = np.where(hopeless, np.inf, np.nan_to_num(poses.chi2))
        fits.bound[s, h] = bound
        fits.sound[s, h] = (poses.n > 0) & ~second & ((poses.doubt & _UNSOUND) == 0)


def _under(views: Views, hyps: Hypotheses, s: Index, h: Index) -> Views:
    """View s (M,) under hypothesis h (M,), each."""
    use = ~hyps.accused | hyps.swaps[:, None]
    part, names = some(views, s), hyps.names[h][..., None]
    n = names.shape[1]
    p_map = np.take_along_axis(np.broadcast_to(part.p_map, (len(s), n, 3)), names, axis=1)
    cov = part.cov_map
    if cov is not None:
        cov = np.broadcast_to(cov, (len(s), n, 3, 3))
        cov = np.take_along_axis(cov, names[..., None], axis=1)
    information = np.where(use[h][..., None, None], part.information, 0.0)
    return Views(p_map, part.z_px, information, cov)


def place(fits: Fits, p_cam: Array) -> tuple[Array, Array]:
    """Of the point p_cam (3,): where it is in the map (S, H, 3), and covariance (S, H, 3, 3)."""
    J = fits.T_map_cam[..., :3, :3] @ np.concatenate([np.eye(3), -so3.hat(p_cam)], axis=1)
    return se3.act(fits.T_map_cam, p_cam), J @ fits.cov @ J.swapaxes(-1, -2)
