"""How much is simulated. The counts are part of the results: they are written beside them."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Effort:
    """Counts, each explained in MEANING."""

    trials: int
    projections: int
    images: int
    groups: int


MEANING = {
    "trials": "Noisy views at each of the 40 cameras of each circle: figures 4-5 to 4-9.",
    "projections": "Noisy pairs of tags at each range, pixels without images: figure 3-12.",
    "images": "Rendered stereo images of a pair of tags at each range: figure 3-12.",
    "groups": "Translations of three tags, each rendered before and after, in each set-up: tables "
    "4.1 to 4.5.",
}

FULL = Effort(trials=16, projections=8_000, images=100, groups=100)
SAMPLE = Effort(trials=3, projections=2_000, images=10, groups=12)
