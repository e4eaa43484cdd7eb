"""Hits during normal work: each tightens the calibration, and many together tell a drifted mount.

That a beam aimed at a tag lit it teaches nothing: it was aimed where the calibration says. A hit
is therefore the middle of the mirror angles that light a tag, found by probing (see probing.py).
`absorb` updates the scanner by it: extended Kalman filter, the calibration's covariance the prior.

Drift is looked for in the last WINDOW hits, against the `reference` that knows none of them:

    off = -H[turn] turn + e        Cov(e) = blockdiag(R_1 .. R_n) + H P H^T

with R_i the noise of a hit, H P H^T what the reference does not know, and H[turn] its columns for a
turn of the mount. Without drift the generalised likelihood ratio of turn = 0 is chi2 with three
degrees of freedom. A single wrong hit cannot raise it: whitened, it is cut at what a good one may
be off.
"""

from dataclasses import dataclass, replace

import numpy as np

from robot_agent.calibration.scanner.robust import BAD_CHI2
from tagmap.conventions import Array
from tagmap.geometry.scanner.scanner import Pointing, Scanner, point

WINDOW = 20
FEWEST = 5
"""Hits before drift is looked for."""
DRIFT_CHI2 = 30.66
"""Of three degrees of freedom: passed by one window in a million."""
TURN = slice(3, 6)
LOOSENED = 3.0
"""Sigmas of the estimated turn by which a drifted mount is taken to be unknown."""


@dataclass(frozen=True, slots=True)
class Hit:
    """Mirror angles theta (2,) in rad are the middle of those that light the target p_cam (3,),
    which is known to cov_cam (3, 3): sigma_theta_rad of one angle, sigma_middle_m by probing."""

    theta: Array
    p_cam: Array
    cov_cam: Array
    sigma_theta_rad: float
    sigma_middle_m: float


@dataclass(frozen=True, slots=True)
class Drift:
    """`chi2` of no drift, the estimated `turn` (3,) of the mount in rad about the axes of laser,
    and how well it is known, `cov_turn` (3, 3)."""

    chi2: float
    turn: Array
    cov_turn: Array

    @property
    def warns(self) -> bool:
        return self.chi2 > DRIFT_CHI2


@dataclass(frozen=True, slots=True)
class Online:
    """`scanner` to aim with; `reference` without the `recent` hits; `refused` hits, which were too
    far off to learn from; `drift` by the recent ones, None before there are FEWEST."""

    scanner: Scanner
    reference: Scanner
    recent: tuple[Hit, ...] = ()
    refused: int = 0
    drift: Drift | None = None


def begin(scanner: Scanner) -> Online:
    """With a calibration."""
    return Online(scanner, scanner)


def absorb(state: Online, hit: Hit) -> Online:
    """With one more hit. While drift is warned of, nothing is learned: a calibration bent to a
    turning mount would be right nowhere. See `reseat`."""
    recent, reference = (*state.recent, hit), state.reference
    if len(recent) > WINDOW:
        oldest, *rest = recent
        recent = tuple(rest)
        if not _warns(state):
            reference, _ = _updated(reference, oldest)
    drift = _drift(reference, recent) if len(recent) >= FEWEST else None
    if drift is not None and drift.warns:
        return replace(state, reference=reference, recent=recent, drift=drift)
    scanner, learned = _updated(state.scanner, hit)
    return Online(scanner, reference, recent, state.refused + (not learned), drift)


def reseat(state: Online) -> Online:
    """After a warning: take the mount to have turned, and learn from the recent hits where to."""
    if state.drift is None:
        return state
    turned = np.zeros(len(state.reference.cov))
    turned[TURN] = state.drift.turn
    cov = state.reference.cov.copy()
    cov[TURN, TURN] += LOOSENED**2 * state.drift.cov_turn
    online = begin(replace(state.reference.moved(turned), cov=cov))
    for hit in state.recent:
        online = absorb(online, hit)
    return online


def warning(state: Online, range_m: float) -> str | None:
    """What to tell of a drifted mount: by how much beams are off at that range."""
    if state.drift is None or not state.drift.warns:
        return None
    turn_mrad = 1e3 * float(np.linalg.norm(state.drift.turn))
    return (
        f"the scanner's mount has turned by {turn_mrad:.2f} mrad, {turn_mrad * range_m:.1f} mm at"
        f" {range_m:.1f} m: chi2 {state.drift.chi2:.0f} of {len(state.recent)} hits, expected at"
        f" most {DRIFT_CHI2:.0f}; fasten it and calibrate anew"
    )


def _warns(state: Online) -> bool:
    return state.drift is not None and state.drift.warns


def _seen(scanner: Scanner, hits: tuple[Hit, ...]) -> tuple[Pointing, Array]:
    """How hits pass the scanner's beams, and the covariances (n, 2, 2) of their noise."""
    theta, p_cam, cov_cam = (
        np.stack([getattr(hit, name) for hit in hits]) for name in ("theta", "p_cam", "cov_cam")
    )
    sigma_rad, middle_m = (
        np.array([getattr(hit, name) for hit in hits])[:, None, None]
        for name in ("sigma_theta_rad", "sigma_middle_m")
    )
    there = point(scanner, theta, p_cam)
    by_theta = sigma_rad * there.by_theta
    R = by_theta @ np.swapaxes(by_theta, -1, -2) + middle_m**2 * np.eye(2)
    return there, R + there.by_point @ cov_cam @ np.swapaxes(there.by_point, -1, -2)


def _updated(scanner: Scanner, hit: Hit) -> tuple[Scanner, bool]:
    """The scanner after a hit, or as it was where the hit is too far off."""
    there, noise = _seen(scanner, (hit,))
    off, R, H, P = there.off[0], noise[0], there.by_scanner[0], scanner.cov
    S = H @ P @ H.T + R
    if not off @ np.linalg.solve(S, off) <= BAD_CHI2:
        return scanner, False
    K = np.linalg.solve(S, H @ P).T
    left = np.eye(len(P)) - K @ H
    cov = left @ P @ left.T + K @ R @ K.T
    return replace(scanner.moved(-K @ off), cov=0.5 * (cov + cov.T)), True


def _drift(reference: Scanner, hits: tuple[Hit, ...]) -> Drift:
    there, R = _seen(reference, hits)
    H = there.by_scanner.reshape(-1, len(reference.cov))
    S = H @ reference.cov @ H.T
    own = np.arange(len(S)).reshape(-1, 2)
    S[own[:, :, None], own[:, None, :]] += R
    off = _cut(there.off, S[own[:, :, None], own[:, None, :]]).reshape(-1)
    B = -H[:, TURN]
    S_B = np.linalg.solve(S, B)
    cov_turn = np.linalg.inv(B.T @ S_B)
    pull = S_B.T @ off
    turn = cov_turn @ pull
    return Drift(float(pull @ turn), turn, cov_turn)


def _cut(off: Array, S: Array) -> Array:
    """off (n, 2), each brought to within what a good hit of covariance S (n, 2, 2) may be off."""
    chi2 = (off[..., None] * np.linalg.solve(S, off[..., None])).sum(axis=(1, 2))
    cut: Array = off * np.sqrt(BAD_CHI2 / np.maximum(chi2, BAD_CHI2))[:, None]
    return cut
