"""The truth, in its own frame, and its value at a given time."""

from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from tagmap.conventions import Array, Index, Kind
from tagmap.geometry import se2, se3

GROUPS: dict[Kind, ModuleType] = {"spatial": se3, "planar": se2}

BRIDGED_NS = 250_000_000
SAME_INSTANT_NS = 1_500_000


@dataclass(frozen=True, slots=True)
class TrueTrack:
    """T_truth_base (N, d, d) at `t_ns` (N,), sorted; dense or sparse."""

    t_ns: Index
    T: Array


@dataclass(frozen=True, slots=True)
class Truth:
    """Landmark positions (D,) by tag id, tracks by robot number. Either may be empty."""

    kind: Kind
    landmarks: dict[str, Array] = field(default_factory=dict)
    tracks: dict[int, TrueTrack] = field(default_factory=dict)


def at(kind: Kind, track: TrueTrack, t_ns: Index) -> tuple[Array, Index]:
    """The true poses where the truth is known: (M, d, d), and which of `t_ns` they belong to (M,).

    Between samples at most BRIDGED_NS apart it is interpolated with constant twist; elsewhere it is
    known only at the samples themselves, to SAME_INSTANT_NS. Never extrapolated.
    """
    if len(track.t_ns) == 0 or len(t_ns) == 0:
        return np.empty((0, *track.T.shape[1:])), np.empty(0, dtype=np.int64)
    after = np.clip(np.searchsorted(track.t_ns, t_ns), 1, max(len(track.t_ns) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(track.t_ns) - 1)
    span = track.t_ns[after] - track.t_ns[before]
    since = t_ns - track.t_ns[before]
    inside = (since >= 0) & (since <= span)
    s = np.where(span > 0, since / np.maximum(span, 1), 0.0)
    on_sample = np.abs(since - span * (s > 0.5)) <= SAME_INSTANT_NS
    known = np.flatnonzero((inside & (span <= BRIDGED_NS)) | on_sample)
    s = np.where((span > BRIDGED_NS) | ~inside, s > 0.5, s)[known]
    T: Array = GROUPS[kind].interpolate(track.T[before[known]], track.T[after[known]], s)
    return T, known
