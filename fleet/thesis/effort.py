"""How much is simulated. The counts are part of the results: they are written beside them."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effort:
    """trials       noisy views at each of the 40 cameras of each circle
    projections  noisy pairs of tags at each range
    images       rendered stereo images of a pair of tags at each range
    groups       translations of three tags, each rendered before and after, in each set-up
    """

    trials: int
    projections: int
    images: int
    groups: int


FULL = Effort(trials=16, projections=8_000, images=100, groups=100)
SAMPLE = Effort(trials=3, projections=2_000, images=10, groups=12)
