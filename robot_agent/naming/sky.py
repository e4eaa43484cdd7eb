"""What one exposure shows: spots, which of them belong together, and the names they were given.

Positions come with two covariances. `cov` is that of the spots alone, as shots and keyframes want
it. `wide` also has what the rig may be off, by its own residuals: that is no noise, but it makes a
place look otherwise from elsewhere, so whoever compares places over motion or with a map needs it.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from msgspec.structs import replace

from robot_agent.activation.target import Target, targets_of
from robot_agent.naming.named import Named
from robot_agent.perception.matching import Matches, View, match
from tagmap.conventions import Array
from tagmap.geometry import se3, stereo
from tagmap.geometry.stereo import StereoRig
from tagmap.records.arrays import covariance, upper
from tagmap.records.keyframe import Measurement, Sighting

Pair = tuple[int, int]

UNEXPLAINED = 0.05
"""Share of what the rig may be off."""


@dataclass(slots=True)
class Sky:
    """Of views left and right with the camera at T_base_cam (4, 4), which turns meanwhile or not;
    `false`: pairs that are none.

    targets  one for each chosen match, in the order of `p_cam` (N, 3)
    names    of targets, by pair
    lit      sightings by the laser, by pair: where the match is in doubt, of the left spot alone
    """

    rig: StereoRig
    left: View
    right: View
    T_base_cam: Array
    cov_base_cam: Array | None = None
    turns: bool = False
    false: set[Pair] = field(default_factory=set)
    names: dict[Pair, Named] = field(default_factory=dict)
    lit: dict[Pair, Sighting] = field(default_factory=dict)
    targets: list[Target] = field(init=False)
    p_cam: Array = field(init=False)
    wide: Array = field(init=False)

    def __post_init__(self) -> None:
        self._match()

    def __len__(self) -> int:
        return len(self.targets)

    def refute(self, pair: Pair) -> None:
        """The laser has shown that these two spots are not one tag: match anew without them."""
        self.false.add(pair)
        self._match()
        there = {target.pair for target in self.targets}
        self.names = {pair: named for pair, named in self.names.items() if pair in there}

    def name(self, k: int, named: Named) -> None:
        self.names[self.targets[k].pair] = named

    def unname(self, tag: str) -> None:
        self.names = {pair: named for pair, named in self.names.items() if named.tag != tag}

    def unnamed(self) -> list[int]:
        """Rows of targets without a name."""
        return [k for k, target in enumerate(self.targets) if target.pair not in self.names]

    def named(self) -> Iterator[tuple[int, Named]]:
        for k, target in enumerate(self.targets):
            if (named := self.names.get(target.pair)) is not None:
                yield k, named

    def places(self) -> tuple[Array, Array]:
        """p_base (N, 3) and what they are uncertain by (N, 3, 3), the angles of the head too."""
        p_base = se3.act(self.T_base_cam, self.p_cam)
        R = self.T_base_cam[:3, :3]
        cov = R @ self.wide @ R.T
        if self.cov_base_cam is not None and len(p_base):
            lever = se3.act_jacobian(self.T_base_cam, self.p_cam)
            cov = cov + lever @ self.cov_base_cam @ lever.swapaxes(-1, -2)
        return p_base, cov

    def sightings(self) -> tuple[Sighting, ...]:
        """Of all that has a name, each tag once. What the rig may be off the map is solved for; a
        little is left of it that no offset, scale or turn explains. A head at rest is where it says
        it is; while it turns, what its angles may be off is added.
        """
        found = {sighting.tag: (pair, sighting) for pair, sighting in self.lit.items()}
        for k, named in self.named():
            target = self.targets[k]
            found.setdefault(named.tag, (target.pair, named.sighting(target.z)))
        sigma_px = UNEXPLAINED * self.rig.sigma_px
        turned = self._turned() if self.turns else {}
        return tuple(
            replace(one, z=cautious(one.z, sigma_px, turned.get(pair)))
            for pair, one in found.values()
        )

    def _turned(self) -> dict[Pair, Array]:
        """Of each target what the head's angles may be off, in pixels: (4, 4)."""
        if self.cov_base_cam is None or not len(self.p_cam):
            return {}
        _, J = stereo.project(self.rig, self.p_cam)
        lever = J @ se3.act_jacobian(np.eye(4), self.p_cam)
        cov = lever @ self.cov_base_cam @ lever.swapaxes(-1, -2)
        return {target.pair: cov[k] for k, target in enumerate(self.targets)}

    def _match(self) -> None:
        found: Matches = match(self.rig, self.left, self.right, false_pairs=self.false)
        self.targets = targets_of(found, self.left, self.right)
        self.p_cam = found.chosen.p_cam
        self.wide = found.chosen.wide


def cautious(z: Measurement, sigma_px: float, turned_px2: Array | None = None) -> Measurement:
    """A measurement in pixels with what the rig may be off added to its covariance.

    turned_px2 (4, 4): of all four pixels, what is to be added besides.
    """
    n, cov = len(z.values), list(z.cov)
    for i in range(n):
        # Where row i of the upper triangle begins: on the diagonal.
        cov[i * n - i * (i - 1) // 2] += sigma_px**2
    if turned_px2 is not None:
        cov = list(upper(covariance(cov) + turned_px2[:n, :n]))
    return Measurement(stereo_px=z.stereo_px, mono_px=z.mono_px, cov=tuple(cov))
