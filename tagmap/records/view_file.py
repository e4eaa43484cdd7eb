"""The file of `tagmap localize`: tags seen in one image or two, and where the tags are."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import msgspec
from msgspec import UNSET, Meta, UnsetType

from tagmap.errors import DataError
from tagmap.records.base import (
    LARGEST,
    LEAST_VARIANCE,
    Finite,
    Positive,
    Record,
    TagId,
    Vector,
    check_covariance,
    check_finite,
)
from tagmap.records.json_file import as_record, check_points
from tagmap.records.rig import CameraCalibration, RigCalibration
from tagmap.records.rig_file import check_keys
from tagmap.records.transform import Transform

Sigma: TypeAlias = Annotated[float, Meta(ge=LEAST_VARIANCE**0.5, le=LARGEST)]
Variance: TypeAlias = Annotated[float, Meta(ge=LEAST_VARIANCE, le=LARGEST)]
Pixel: TypeAlias = Annotated[tuple[Finite, ...], Meta(min_length=2, max_length=2)]
Point: TypeAlias = Annotated[tuple[Finite, ...], Meta(min_length=3, max_length=3)]


class PriorPose(Record, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A pose with `cov`, the upper triangle (21) of its tangent; which way is up; or both."""

    T_map_base: Transform | UnsetType = UNSET
    T_map_cam: Transform | UnsetType = UNSET
    cov: Vector | UnsetType = UNSET
    up_base: Point | UnsetType = UNSET
    up_cam: Point | UnsetType = UNSET
    sigma_up_rad: Positive = 0.02

    def __post_init__(self) -> None:
        poses = [T for T in (self.T_map_base, self.T_map_cam) if isinstance(T, Transform)]
        if len(poses) > 1 or (self.up_base is not UNSET and self.up_cam is not UNSET):
            raise ValueError("a prior is about base or about cam, not about both")
        if bool(poses) != isinstance(self.cov, tuple):
            raise ValueError("a prior pose and its cov come together")
        if isinstance(self.cov, tuple):
            check_covariance("cov", self.cov, 6)
        for T in poses:
            if T.kind != "spatial":
                raise ValueError("a prior pose is planar, expected p_m of 3 and q_wxyz")
        for up in (self.up_base, self.up_cam):
            if isinstance(up, tuple) and not any(up):
                raise ValueError("a prior's up is zero, expected a direction")


class ViewFile(Record, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """`rig`: a calibration, or the path of one. `tag_cov_m2`: variance of every coordinate, or the
    upper triangle (6) of every tag, or of each by its id. `sigma_px` is the rig's where absent.
    """

    rig: RigCalibration | str
    tags: dict[TagId, Point]
    left: dict[TagId, Pixel]
    right: dict[TagId, Pixel] = msgspec.field(default_factory=dict)
    tag_cov_m2: Variance | Vector | dict[TagId, Vector] | None = None
    sigma_px: Sigma | None = None
    T_base_cam: Transform | None = None
    prior: PriorPose | None = None

    def __post_init__(self) -> None:
        unknown = sorted((set(self.left) | set(self.right)) - set(self.tags))
        if unknown:
            raise ValueError(f"tag {unknown[0]} is seen, but tags do not say where it is")
        for name, points in (("tags", self.tags), ("left", self.left), ("right", self.right)):
            for tag, values in points.items():
                check_finite(f"{name}.{tag}", values, [2, 3])
        if isinstance(self.tag_cov_m2, tuple):
            check_covariance("tag_cov_m2", self.tag_cov_m2, 3)
        if isinstance(self.tag_cov_m2, dict):
            for tag in set(self.left) | set(self.right):
                if tag not in self.tag_cov_m2:
                    raise ValueError(f"tag_cov_m2 has nothing for tag {tag}")
                check_covariance(f"tag_cov_m2.{tag}", self.tag_cov_m2[tag], 3)
        if self.T_base_cam is not None and self.T_base_cam.kind != "spatial":
            raise ValueError("T_base_cam is planar, expected p_m of 3 and q_wxyz")
        prior = self.prior or PriorPose()
        about_base = prior.T_map_base is not UNSET or prior.up_base is not UNSET
        if about_base and self.T_base_cam is None:
            raise ValueError("a prior about base needs T_base_cam")


def view_of(tree: Any, name: str) -> ViewFile:
    """What a file named `name` holds, by json_file. Raises DataError, ConfigError of its rig."""
    if isinstance(tree, dict):
        _check_parts(tree, name)
    file = as_record(tree, ViewFile, name)
    if len(file.tags) > 1 and len(set(file.tags.values())) == 1:
        raise DataError(f"{name}: tags: all {len(file.tags)} are at one place")
    return file


def _check_parts(tree: dict[str, Any], name: str) -> None:
    """Where msgspec does not tell which tag is wrong, and ignores keys that it does not know."""
    for key, size in (("tags", 3), ("left", 2), ("right", 2)):
        if key in tree:
            check_points(tree[key], size, f"{name}: {key}")
    if isinstance(tree.get("tag_cov_m2"), dict):
        check_points(tree["tag_cov_m2"], 6, f"{name}: tag_cov_m2")
    if isinstance(tree.get("rig"), dict):
        check_keys(f"{name}: rig", tree["rig"])


def check_inside(file: ViewFile, rig: RigCalibration, name: str) -> None:
    """Raise DataError for a pixel that is in no image of `rig`, as if taken by another."""
    _check_inside(file.left, rig.left, f"{name}: left")
    _check_inside(file.right, rig.right, f"{name}: right")


def _check_inside(
    seen: Mapping[str, tuple[float, ...]], camera: CameraCalibration, name: str
) -> None:
    width_px, height_px = camera.width_px, camera.height_px
    for tag, (u, v) in seen.items():
        if not (-0.5 <= u <= width_px - 0.5 and -0.5 <= v <= height_px - 0.5):
            raise DataError(
                f"{name}: {tag} is at ({u:g}, {v:g}) px, expected to be within the rig's image of"
                f" {width_px} x {height_px} px; is it the rig that saw this?"
            )
