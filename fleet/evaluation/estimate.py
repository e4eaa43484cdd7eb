"""What is judged: tags and tracks as the service made them, in the frame of its map."""

from dataclasses import dataclass

import numpy as np

from tagmap.conventions import Array, Index, Kind


@dataclass(frozen=True, slots=True)
class TagEstimate:
    """p_map_tag (D,) and its covariance (D, D) in map axes; D = 3 in space, 2 in the plane."""

    p: Array
    cov: Array | None

    @property
    def sigma_m(self) -> float | None:
        """Rms of the deviations along the axes."""
        return None if self.cov is None else float(np.sqrt(np.trace(self.cov) / len(self.cov)))


@dataclass(frozen=True, slots=True)
class TrackEstimate:
    """T_map_base (N, d, d) of one robot at `t_ns` (N,), sorted.

    cov (N, dof, dof) in base axes; NaN for poses whose covariance nobody asked for.
    """

    t_ns: Index
    T: Array
    cov: Array | None


@dataclass(frozen=True, slots=True)
class Estimate:
    """Tags by id, tracks by robot number."""

    kind: Kind
    tags: dict[str, TagEstimate]
    tracks: dict[int, TrackEstimate]
