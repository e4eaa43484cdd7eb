"""Rigid transforms at the edges: `{p_m, q_wxyz}` in space, `{p_m, theta_rad}` in the plane."""

import math

from msgspec import UNSET, UnsetType

from tagmap.conventions import Kind
from tagmap.records.base import Record, Vector, check_finite

QUATERNION_NORM_TOLERANCE = 1e-6


class Transform(Record, frozen=True, kw_only=True):
    """T_a_b: takes b-coordinates to a. Exactly one of `q_wxyz` (spatial), `theta_rad` (planar)."""

    p_m: Vector
    q_wxyz: Vector | UnsetType = UNSET
    theta_rad: float | UnsetType = UNSET

    def __post_init__(self) -> None:
        if (self.q_wxyz is UNSET) == (self.theta_rad is UNSET):
            raise ValueError("a transform has either q_wxyz (spatial) or theta_rad (planar)")
        if isinstance(self.q_wxyz, tuple):
            check_finite("p_m", self.p_m, [3])
            check_finite("q_wxyz", self.q_wxyz, [4])
            norm = math.hypot(*self.q_wxyz)
            if abs(norm - 1.0) > QUATERNION_NORM_TOLERANCE:
                raise ValueError(f"q_wxyz has norm {norm:.9g}, expected 1")
        else:
            check_finite("p_m", self.p_m, [2])
            check_finite("theta_rad", [self.theta_rad], [1])  # type: ignore[list-item]

    @property
    def kind(self) -> Kind:
        return "planar" if self.q_wxyz is UNSET else "spatial"
