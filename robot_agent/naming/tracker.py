"""Identities carried from one exposure to the next: a tag that is where it was is the same tag.

Every trace is a place in base with a covariance, which moves with the odometry. A spot is a
trace's when it fits, and when neither has a rival that fits nearly as well. The doubt that each
step adds is that the tag has gone out of sight and another spot stands where it would be: the
volume of the gate times how densely spots are strewn, times how likely it is to have gone, which
is much for one that was out of sight before and little for one that was seen a moment ago.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from robot_agent.naming.named import Named
from tagmap.conventions import Array, Mask
from tagmap.geometry import se3
from tagmap.records.arrays import covariance, matrix
from tagmap.records.keyframe import Odometry

FITS, RIVALS = 16.3, 25.0
"""chi2 with 3 degrees of freedom: a true one exceeds the first once in 1000, the second 1.5e-5."""
PER_M3 = 0.1
P_GONE, P_GOES = 0.1, 1e-3
MOST_P_FALSE = 1e-3
LONGEST_UNSEEN = 5
_BALL = 4.0 / 3.0 * np.pi


@dataclass(frozen=True, slots=True)
class Trace:
    """`p_base` (3,) with `cov` (3, 3) now; `p_false` of the name; unseen: exposures since it was
    last seen; is_lit: the name goes back to light."""

    tag: str
    p_base: Array
    cov: Array
    p_false: float
    unseen: int = 0
    is_lit: bool = False


class Tracker:
    """`lost`: tags that were given up at the last exposure, for they were unseen for too long."""

    def __init__(self) -> None:
        self.traces: dict[str, Trace] = {}
        self.lost: list[str] = []

    def move(self, step: Odometry | None) -> None:
        """By the motion since the exposure before; None: it is not known, and all traces end."""
        if step is None:
            self.traces.clear()
        if step is None or not self.traces:
            return
        traces = list(self.traces.values())
        T_cur_prev = se3.inverse(matrix(step.T_prev_cur))
        R = T_cur_prev[:3, :3]
        p_base = se3.act(T_cur_prev, np.array([trace.p_base for trace in traces]))
        lever = se3.act_jacobian(np.eye(4), p_base)
        cov = R @ np.array([trace.cov for trace in traces]) @ R.T
        cov = cov + lever @ covariance(step.cov) @ lever.swapaxes(-1, -2)
        for trace, p, S in zip(traces, p_base, cov, strict=True):
            self.traces[trace.tag] = Trace(
                trace.tag, p, S, trace.p_false, trace.unseen, trace.is_lit
            )

    def follow(self, p_base: Array, cov: Array) -> dict[int, Named]:
        """Names of places p_base (N, 3) with cov (N, 3, 3), by their row; each is seen now."""
        traces = list(self.traces.values())
        for one in traces:
            self.traces[one.tag] = Trace(
                one.tag, one.p_base, one.cov, one.p_false, one.unseen + 1, one.is_lit
            )
        found: dict[int, Named] = {}
        if traces and len(p_base):
            chi2, volume = _distances(traces, p_base, cov)
            for t, k in np.argwhere(_is_clear(chi2)).tolist():
                trace = traces[t]
                p_gone = P_GONE if trace.unseen else P_GOES
                p_false = trace.p_false + p_gone * PER_M3 * float(volume[t, k])
                if p_false <= MOST_P_FALSE:
                    found[k] = named = Named(trace.tag, "track", p_false, is_lit=trace.is_lit)
                    self.keep(named, p_base[k], cov[k])
        self._forget()
        return found

    def keep(self, named: Named, p_base: Array, cov: Array) -> None:
        """It is here now."""
        self.traces[named.tag] = Trace(named.tag, p_base, cov, named.p_false, 0, named.is_lit)

    def drop(self, tag: str) -> None:
        self.traces.pop(tag, None)

    def drop_seen_but(self, tags: Collection[str]) -> None:
        """Of those that were followed to this exposure: others have lost their name in it."""
        for tag, trace in tuple(self.traces.items()):
            if not trace.unseen and tag not in tags:
                del self.traces[tag]

    def _forget(self) -> None:
        self.lost = [tag for tag, trace in self.traces.items() if trace.unseen > LONGEST_UNSEEN]
        for tag in self.lost:
            del self.traces[tag]


def _distances(traces: list[Trace], p_base: Array, cov: Array) -> tuple[Array, Array]:
    """chi2 (T, N) of every spot as every trace, and the volume (T, N) of the gate in m^3."""
    p = np.array([trace.p_base for trace in traces])
    S = np.array([trace.cov for trace in traces])[:, None] + cov[None]
    apart = p_base[None] - p[:, None]
    chi2 = np.einsum("tni,tni->tn", apart, np.linalg.solve(S, apart[..., None])[..., 0])
    volume = _BALL * FITS**1.5 * np.sqrt(np.linalg.det(S))
    return chi2, volume


def _is_clear(chi2: Array) -> Mask:
    """(T, N): fits, and no rival of either is near."""
    near = chi2 <= RIVALS
    alone = (near.sum(axis=1, keepdims=True) == 1) & (near.sum(axis=0, keepdims=True) == 1)
    return np.asarray((chi2 <= FITS) & alone)
