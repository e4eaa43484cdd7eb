"""What is committed to the site database together."""

from dataclasses import dataclass, field

from tagmap.records import Hello, Keyframe
from tagmap.records.base import Vector


@dataclass(frozen=True, slots=True)
class RefusalRow:
    """A message of a robot that is not acceptable, and why. A refused hello has seq 0."""

    robot: str
    session: str
    seq: int
    reason: str
    t_ns: int


@dataclass(frozen=True, slots=True)
class Survey:
    """A tag measured by other means: position in map (3 numbers, 2 in the plane), isotropic.

    cov    packed, of all three axes, where it is not isotropic; sigma_m is then the largest
    robot  who read it in the tag's own memory; None: an operator told it
    """

    tag: str
    p_m: Vector
    sigma_m: float
    t_ns: int
    cov: Vector | None = None
    robot: str | None = None


@dataclass(frozen=True, slots=True)
class MemorySurvey:
    """What is made of a tag's memory: position (3) and packed covariance (6) that people surveyed,
    and who read it; all None: its memory does not say so any more.
    """

    tag: str
    p_m: Vector | None
    cov: Vector | None
    robot: str | None
    t_ns: int


@dataclass(frozen=True, slots=True)
class Reading:
    """What a robot read in a tag's memory, all of it; None: it could not.

    job, outcome, reason  where it answers a write-back job
    t_ns                  when the service heard of it
    """

    tag: str
    robot: str
    memory: bytes | None
    t_ns: int
    job: int | None = None
    outcome: str | None = None
    reason: str | None = None


@dataclass(frozen=True, slots=True)
class Batch:
    """Facts that are stored all together or not at all.

    Where a batch both stores and refuses a seq, the refusal is the last word.
    """

    hellos: list[Hello] = field(default_factory=list)
    keyframes: list[Keyframe] = field(default_factory=list)
    refusals: list[RefusalRow] = field(default_factory=list)
    surveys: list[Survey] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)
    memory_surveys: list[MemorySurvey] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class Inserted:
    """How much of a batch was new."""

    hellos: int
    keyframes: int
    sightings: int
    refusals: int
    surveys: int
