"""JSON Schema of every message, for agents written in other languages."""

from typing import Any

import msgspec

from tagmap.records.ack import Ack
from tagmap.records.admin import AdminReply, AdminRequest
from tagmap.records.base import VERSION, Message
from tagmap.records.hello import Hello, Introduction
from tagmap.records.job import JobResult, WriteJob
from tagmap.records.keyframe import Keyframe, Observation
from tagmap.records.lease import LeaseReply, LeaseRequest
from tagmap.records.localize import LocalizeReply, LocalizeRequest
from tagmap.records.pose import Pose
from tagmap.records.tag import MapVersion, Tag

MESSAGES: tuple[type[Message], ...] = (
    Ack,
    AdminReply,
    AdminRequest,
    Hello,
    Introduction,
    JobResult,
    Keyframe,
    LeaseReply,
    LeaseRequest,
    LocalizeReply,
    LocalizeRequest,
    MapVersion,
    Observation,
    Pose,
    Tag,
    WriteJob,
)

_DESCRIPTION = (
    "Messages are msgpack maps with these fields. Binary fields are msgpack bin; as JSON they are "
    "base64 strings. Unknown fields are ignored, other versions are refused. Numbers are finite, "
    "covariances are row-wise upper triangles of positive definite matrices."
)


def schema() -> dict[str, Any]:
    """One document: every message under `$defs`, by its name."""
    _, definitions = msgspec.json.schema_components(MESSAGES, ref_template="#/$defs/{name}")
    for message in MESSAGES:
        _mark_version(definitions[message.__name__])
    definitions["Transform"].update(_forms(_TRANSFORM_FORMS))
    definitions["Measurement"].update(_forms(_MEASUREMENT_FORMS))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"tagmap wire messages, version {VERSION}",
        "description": _DESCRIPTION,
        "anyOf": [{"$ref": f"#/$defs/{message.__name__}"} for message in MESSAGES],
        "$defs": definitions,
    }


def _mark_version(definition: dict[str, Any]) -> None:
    """Every message must say its version, though the struct has a default for it."""
    definition["properties"]["v"] = {"const": VERSION}
    required = [name for name in definition.get("required", []) if name != "v"]
    definition["required"] = ["v", *required]


def _vector(n: int) -> dict[str, Any]:
    return {"type": "array", "items": {"type": "number"}, "minItems": n, "maxItems": n}


_NUMBER = {"type": "number"}
_TRANSFORM_FORMS: list[dict[str, Any]] = [
    {"p_m": _vector(3), "q_wxyz": _vector(4)},
    {"p_m": _vector(2), "theta_rad": _NUMBER},
]
_MEASUREMENT_FORMS: list[dict[str, Any]] = [
    {"stereo_px": _vector(4), "cov": _vector(10)},
    {"mono_px": _vector(2), "cov": _vector(3)},
    {"point_cam_m": _vector(3), "cov": _vector(6)},
    {"point_cam_m": _vector(2), "cov": _vector(3)},
    {"range_m": {**_NUMBER, "exclusiveMinimum": 0}, "bearing_rad": _NUMBER, "cov": _vector(3)},
]


def _forms(forms: list[dict[str, Any]]) -> dict[str, Any]:
    """Exactly one of the forms, without any field of another."""
    known = {name for form in forms for name in form}
    alternatives = [
        {
            "properties": {**form, **dict.fromkeys(sorted(known - form.keys()), False)},
            "required": [*form],
        }
        for form in forms
    ]
    return {"oneOf": alternatives}
