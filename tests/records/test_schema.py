import json
from typing import Any

import jsonschema
import msgspec
import pytest

from tagmap.records import encode
from tagmap.records.base import Message
from tagmap.records.schema import MESSAGES, schema
from tests.records.examples import EXAMPLES


def _as_json(message: Message) -> Any:
    """What an agent in another language sees: the encoded bytes as plain JSON."""
    return json.loads(msgspec.json.encode(msgspec.msgpack.decode(encode(message))))


def _validator(name: str) -> jsonschema.Draft202012Validator:
    document = json.loads(json.dumps(schema()))
    jsonschema.Draft202012Validator.check_schema(document)
    alone = {"$ref": f"#/$defs/{name}", "$defs": document["$defs"]}
    return jsonschema.Draft202012Validator(alone)


@pytest.mark.parametrize("message", EXAMPLES.values(), ids=EXAMPLES)
def test_encoded_examples_are_valid(message: Message) -> None:
    _validator(type(message).__name__).validate(_as_json(message))


@pytest.mark.parametrize("message", EXAMPLES.values(), ids=EXAMPLES)
def test_the_version_is_required_and_is_one(message: Message) -> None:
    validator = _validator(type(message).__name__)
    fields = _as_json(message)
    assert not validator.is_valid({**fields, "v": 2})
    del fields["v"]
    assert not validator.is_valid(fields)


WRONG_TRANSFORMS: list[dict[str, Any]] = [
    {"p_m": [0.0, 0.0, 0.0]},
    {"p_m": [0.0, 0.0], "q_wxyz": [1.0, 0.0, 0.0, 0.0]},
    {"p_m": [0.0, 0.0, 0.0], "theta_rad": 0.0},
    {"p_m": [0.0, 0.0, 0.0], "q_wxyz": [1.0, 0.0, 0.0, 0.0], "theta_rad": 0.0},
    {"p_m": [0.0, 0.0, 0.0], "q_wxyz": [1.0, 0.0, 0.0]},
]
WRONG_MEASUREMENTS: list[dict[str, Any]] = [
    {"cov": [1.0, 0.0, 1.0]},
    {"mono_px": [1.0, 2.0]},
    {"mono_px": [1.0, 2.0], "point_cam_m": [1.0, 2.0], "cov": [1.0, 0.0, 1.0]},
    {"mono_px": [1.0, 2.0, 3.0], "cov": [1.0, 0.0, 1.0]},
    {"stereo_px": [1.0, 2.0, 3.0, 4.0], "cov": [1.0, 0.0, 1.0]},
    {"range_m": 1.0, "cov": [1.0, 0.0, 1.0]},
    {"range_m": 0.0, "bearing_rad": 0.0, "cov": [1.0, 0.0, 1.0]},
]


@pytest.mark.parametrize("fields", WRONG_TRANSFORMS)
def test_transforms_have_exactly_one_form(fields: dict[str, Any]) -> None:
    assert not _validator("Transform").is_valid(fields)


@pytest.mark.parametrize("fields", WRONG_MEASUREMENTS)
def test_measurements_have_exactly_one_form(fields: dict[str, Any]) -> None:
    assert not _validator("Measurement").is_valid(fields)


def test_the_document_is_the_same_every_time_and_names_every_message() -> None:
    document = schema()
    assert json.dumps(document) == json.dumps(schema())
    assert {message.__name__ for message in MESSAGES} <= set(document["$defs"])
