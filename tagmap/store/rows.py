"""What is read from the site database, and the poses that go into it with a map version."""

from dataclasses import dataclass

from tagmap.conventions import Array, Index
from tagmap.records import Hello


@dataclass(frozen=True, slots=True)
class RobotRow:
    """`number` is None before the first hello; `last_t_ns` before the first keyframe."""

    robot: str
    number: int | None
    sessions: int
    keyframes: int
    sightings: int
    refusals: int
    last_t_ns: int | None


@dataclass(frozen=True, slots=True)
class SessionRow:
    """`hello` is None while only keyframes of the session have arrived; `refused` says why its
    hello was refused."""

    robot: str
    number: int | None
    session: str
    hello: Hello | None
    refused: str | None


@dataclass(frozen=True, slots=True)
class MemoryRow:
    """One tag's memory as it was last read, and for how many jobs it was written."""

    tag: str
    memory: bytes
    writes: int


@dataclass(frozen=True, slots=True)
class Counts:
    """`tags` are those of the newest map version. Of the keyframes, `condensed` are not needed by
    the solver any more; of these, `archived` have left the database.
    """

    robots: int
    sessions: int
    keyframes: int
    sightings: int
    refusals: int
    tags: int
    versions: int
    condensed: int
    archived: int


@dataclass(frozen=True, slots=True, eq=False)
class SessionPoses:
    """Estimated T_map_base of a session's keyframes.

    seqs (n,), t_ns (n,), T (n, d, d) with d 4 or 3, cov (n, k): packed upper triangles,
    k 21 or 6, body frame; None when it was not asked for. alive: of keyframes that the next version
    may still move.
    """

    robot: str
    session: str
    seqs: Index
    t_ns: Index
    T: Array
    cov: Array | None
    alive: bool = True


@dataclass(frozen=True, slots=True)
class Condensed:
    """What a solver goes on from, and what it must not be given again.

    serial: another one each time; content: the solver's own. covered: (robot, session, first seq,
    last seq) of runs of keyframes that are in it.
    """

    serial: int
    content: bytes
    covered: tuple[tuple[str, str, int, int], ...]


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """How a map version follows from the one before.

    afresh: solved from nothing; its poses take the place of all others, not only of those alive.
    condensed: None: still that of the version before, or none at all if afresh. T_new_old (d, d):
    how the poses that stay moved with the map; None where they stay where they are.
    """

    afresh: bool = True
    condensed: Condensed | None = None
    T_new_old: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class PoseRow:
    """One of them: T (d, d), cov (k,)."""

    session: str
    seq: int
    t_ns: int
    T: Array
    cov: Array | None
