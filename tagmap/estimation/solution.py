"""What the joint optimisation returns."""

from dataclasses import dataclass

from tagmap.conventions import Array, Index, Kind
from tagmap.estimation.unknowns import UnknownName
from tagmap.records.pose import Gauge
from tagmap.records.tag import TagState


@dataclass(frozen=True, slots=True)
class TagEstimate:
    """p (d,) m in map, cov (d, d); both None while withheld. n: sightings that carry it."""

    tag: str
    p: Array | None
    cov: Array | None
    n: int
    state: TagState


@dataclass(frozen=True, slots=True)
class SessionEstimate:
    """The placed poses of one session: seqs, t_ns (n,), T (n, D, D).

    cov (n, k): packed upper triangles; NaN but for the last pose, whose covariance is needed to go
    on from it, and for that too where it is not known well enough for that. `connected` is False
    where nothing ties the session to the gauge: no poses then.
    """

    robot: str
    session: str
    seqs: Index
    t_ns: Index
    T: Array
    cov: Array
    connected: bool


@dataclass(frozen=True, slots=True)
class CalibrationEstimate:
    """A calibration unknown: value +- sigma, stated as known to `prior_sigma` beforehand.

    robot: None where all robots of the site share it.
    """

    name: UnknownName
    robot: str | None
    value: float
    sigma: float
    prior_sigma: float


@dataclass(frozen=True, slots=True)
class RejectedSighting:
    """chi2: squared error over its covariance; inf where the tag would be behind the camera."""

    robot: str
    session: str
    seq: int
    tag: str
    chi2: float


@dataclass(frozen=True, slots=True)
class RejectedStep:
    """The odometry of keyframe `seq`, which says how the robot came there from the one before."""

    robot: str
    session: str
    seq: int
    chi2: float


@dataclass(frozen=True, slots=True)
class Verdicts:
    """All that is rejected, in order of sessions and seq; what is withheld is in neither."""

    sightings: tuple[RejectedSighting, ...] = ()
    steps: tuple[RejectedStep, ...] = ()


@dataclass(frozen=True, slots=True)
class Solution:
    """A map and the poses that go with it, and how much they can be trusted.

    scale, stereo_scale: the scales that all sensors share, None where not an unknown; calibration:
    these and every other unknown of the sensors. cost: the robust objective. inliers, rejected:
    sightings with a robust weight above or below one half; verdicts: which factors are rejected.
    report: what is withheld or doubtful and what would mend it, one line each.
    """

    kind: Kind
    gauge: Gauge
    tags: tuple[TagEstimate, ...]
    sessions: tuple[SessionEstimate, ...]
    scale: float | None
    stereo_scale: float | None
    converged: bool
    iterations: int
    cost: float
    inliers: int
    rejected: int
    solve_s: float
    report: tuple[str, ...]
    calibration: tuple[CalibrationEstimate, ...] = ()
    verdicts: Verdicts = Verdicts()
