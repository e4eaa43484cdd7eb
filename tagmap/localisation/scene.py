"""What one robot sees of the map, stacked: identified sightings together with their mapped tags."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import ModuleType

import numpy as np

from tagmap.conventions import Array, Form, Index, Kind
from tagmap.geometry import se2, se3
from tagmap.geometry.measurement import FORM_WIDTH, PIXEL_FORMS
from tagmap.geometry.stereo import StereoRig
from tagmap.localisation.view import camera_arrays
from tagmap.records.arrays import MeasurementBlock, measurement_blocks
from tagmap.records.keyframe import Measurement


def lie(kind: Kind) -> ModuleType:
    """The group of the poses of a problem kind."""
    return se3 if kind == "spatial" else se2


@dataclass(frozen=True, slots=True)
class Sensor:
    """`scale`: the factor by which a form sees distances too long, where it is not 1.

    `cameras`: of `rig`, as the kernels take them.
    """

    kind: Kind
    rig: StereoRig | None = None
    scale: Mapping[Form, float] = field(default_factory=dict)
    cameras: tuple[Array, Array, Array] | None = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        cameras = None if self.rig is None else camera_arrays(self.rig)
        object.__setattr__(self, "cameras", cameras)


@dataclass(frozen=True, slots=True)
class TagTable:
    """The map: index of each tag id; p_map (M, d); root (M, d, d), symmetric, with root^2 = cov.

    The symmetric root varies smoothly with cov and turns with the map, so errors expressed in it
    keep their meaning from one map version to the next.
    """

    index: Mapping[str, int]
    p_map: Array
    root: Array

    @classmethod
    def of(cls, kind: Kind, tags: Mapping[str, tuple[Array, Array]]) -> "TagTable":
        """From p_map (d,) and cov (d, d) per tag id; tags that are not finite are left out."""
        d = 3 if kind == "spatial" else 2
        known = {t: (p, c) for t, (p, c) in tags.items() if np.isfinite([p.sum(), c.sum()]).all()}
        p_map = np.array([p for p, _ in known.values()]).reshape(-1, d)
        cov = np.array([cov for _, cov in known.values()]).reshape(-1, d, d)
        variances, axes = np.linalg.eigh(cov)
        sigmas = np.sqrt(np.maximum(variances, 0.0))
        root = (axes * sigmas[:, None, :]) @ axes.swapaxes(-1, -2)
        return cls({tag: i for i, tag in enumerate(known)}, p_map, root)

    def __len__(self) -> int:
        return len(self.p_map)


@dataclass(frozen=True, slots=True)
class Block:
    """Sightings of one form: index (K,) into the scene, z (K, k)."""

    form: Form
    index: Index
    z: Array
    scale: float

    def below(self, n: int) -> "Block":
        """Of the first n sightings of the scene."""
        k = int(np.searchsorted(self.index, n))
        return Block(self.form, self.index[:k], self.z[:k], self.scale)


@dataclass(frozen=True, slots=True)
class Scene:
    """N sightings of mapped tags, all forms padded to k rows of which `width` (N,) are used.

    source (N,)        place in the list of measurements that was given
    tag (N,)           row of the tag table; p_map (N, d) and root (N, d, d) are its rows
    T_cam_base (N, ..) from the base whose pose is asked for
    cov (N, k, k)      of the measurement; unit variance in the padding
    drift (N, dof, dof) covariance of T_cam_base, in base axes, or None where it is exact
    """

    sensor: Sensor
    blocks: tuple[Block, ...]
    source: Index
    tag: Index
    p_map: Array
    root: Array
    T_cam_base: Array
    cov: Array
    width: Index
    drift: Array | None = None

    def __len__(self) -> int:
        return len(self.source)

    def starts_with_different_tags(self, n: int) -> bool:
        """Whether the first n sightings are there and of n tags."""
        return len(set(self.tag[:n].tolist())) == n

    def first(self, n: int) -> "Scene":
        """The first n sightings alone."""
        return Scene(
            sensor=self.sensor,
            blocks=tuple(block.below(n) for block in self.blocks),
            source=self.source[:n],
            tag=self.tag[:n],
            p_map=self.p_map[:n],
            root=self.root[:n],
            T_cam_base=self.T_cam_base[:n],
            cov=self.cov[:n],
            width=self.width[:n],
            drift=None if self.drift is None else self.drift[:n],
        )


def usable_forms(sensor: Sensor) -> set[Form]:
    """Without a rig calibration pixels say nothing."""
    forms = set(FORM_WIDTH[sensor.kind])
    return forms if sensor.rig is not None else forms.difference(PIXEL_FORMS)


def look(
    sensor: Sensor,
    table: TagTable,
    measurements: Sequence[Measurement],
    tags: Sequence[str],
    T_cam_base: Array,
    drift: Array | None = None,
) -> Scene:
    """The scene of those measurements whose tags are mapped and whose form the sensor can use.

    T_cam_base (D, D), or (n, D, D) with drift (n, dof, dof): one for each measurement.
    """
    forms = usable_forms(sensor)
    rows = [
        table.index.get(tag, -1) if z.form in forms else -1
        for z, tag in zip(measurements, tags, strict=True)
    ]
    source = np.array([i for i, row in enumerate(rows) if row >= 0], dtype=np.int64)
    tag = np.array([row for row in rows if row >= 0], dtype=np.int64)
    found = measurement_blocks([measurements[i] for i in source])
    cov, width = _padded(found, len(source))
    blocks = (Block(b.form, b.index, b.z, sensor.scale.get(b.form, 1.0)) for b in found)
    each = T_cam_base[source] if T_cam_base.ndim == 3 else T_cam_base
    return Scene(
        sensor=sensor,
        blocks=tuple(blocks),
        source=source,
        tag=tag,
        p_map=table.p_map[tag],
        root=table.root[tag],
        T_cam_base=np.array(
            np.broadcast_to(each, (len(source), *T_cam_base.shape[-2:])), order="C"
        ),
        cov=cov,
        width=width,
        drift=None if drift is None else drift[source],
    )


def _padded(blocks: Sequence[MeasurementBlock], n: int) -> tuple[Array, Index]:
    """cov (n, k, k), as wide as the widest form, and how much of it each sighting uses (n,)."""
    k = max((block.z.shape[1] for block in blocks), default=1)
    cov, width = np.zeros((n, k, k)) + np.eye(k), np.zeros(n, dtype=np.int64)
    for block in blocks:
        used = block.z.shape[1]
        width[block.index] = used
        cov[block.index, :used, :used] = block.cov
    return cov, width
