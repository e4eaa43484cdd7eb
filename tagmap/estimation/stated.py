"""Which calibration unknowns a site has: those of which a robot states how well it knows them."""

from collections.abc import Sequence
from dataclasses import dataclass

from tagmap.conventions import Form, Kind
from tagmap.estimation.unknowns import (
    CAMERA,
    OF_FORM,
    OF_STEPS,
    PRINCIPAL,
    Unknown,
    UnknownName,
)
from tagmap.records import Hello

Key = tuple[UnknownName, str | None]


@dataclass(frozen=True, slots=True)
class Stated:
    """The unknowns, and which of them a robot's sightings and steps depend on."""

    unknowns: tuple[Unknown, ...]

    @classmethod
    def by(cls, kind: Kind, hellos: Sequence[Hello]) -> "Stated":
        """Those that the site shares, then robot by robot; the widest prior that is stated."""
        widest: dict[Key, float] = {}
        for own in (False, True):
            for hello in hellos:
                for (name, robot), sigma in _sigmas(kind, hello).items():
                    if (robot is not None) == own:
                        key = name, robot
                        widest[key] = max(sigma, widest.get(key, 0.0))
        return cls(tuple(Unknown(name, robot, sigma) for (name, robot), sigma in widest.items()))

    def of_sightings(self, kind: Kind, hello: Hello, form: Form) -> tuple[int, ...]:
        """Places of what sightings of that form depend on."""
        own = _sigmas(kind, hello)
        return tuple(
            place
            for place, unknown in enumerate(self.unknowns)
            if unknown.name in OF_FORM[form] and (unknown.name, unknown.robot) in own
        )

    def of_steps(self, kind: Kind, hello: Hello) -> tuple[int, int]:
        """Places of the odometry scale and of the wheel base, -1 for none."""
        own = _sigmas(kind, hello)
        length, turn = (
            next((i for i, u in enumerate(self.unknowns) if (u.name, u.robot) == key), -1)
            if (key := (name, hello.robot)) in own
            else -1
            for name in OF_STEPS
        )
        return length, turn


def _sigmas(kind: Kind, hello: Hello) -> dict[Key, float]:
    """Every unknown that a robot states, in the order of their names."""
    own, metres, turns = hello.calibration, *CAMERA[kind]
    stated: dict[Key, float | None] = {
        ("range_scale", None): hello.range_scale_sigma,
        ("stereo_scale", None): hello.stereo_scale_sigma,
        ("range_scale", hello.robot): own.range_scale,
        ("stereo_scale", hello.robot): own.stereo_scale,
        ("disparity_px", hello.robot): own.disparity_px,
        **{(name, hello.robot): own.camera_m for name in metres},
        **{(name, hello.robot): own.camera_rad for name in turns},
        ("time_offset_s", hello.robot): own.time_offset_s,
        ("odometry_scale", hello.robot): own.odometry_scale,
        ("wheel_base", hello.robot): own.wheel_base,
        **{(name, hello.robot): own.principal_px for name in PRINCIPAL},
    }
    return {key: sigma for key, sigma in stated.items() if sigma is not None}
