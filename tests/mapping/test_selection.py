import pytest

from tagmap.errors import RecordRefused
from tagmap.mapping.selection import parse
from tagmap.records import Tag


def tag(name, p_m, state="mapped"):
    return Tag(tag=name, p_m=p_m, cov=None, state=state, n=1, version=1, gauge="floating")


TAGS = [tag("a", (0.0, 0.0)), tag("b", (2.0, 1.0), "surveyed"), tag("c", None, "withheld")]


@pytest.mark.parametrize(
    ("parameters", "expected"),
    [
        ({}, ["a", "b", "c"]),
        ({"bbox": "-1,-1,1,1"}, ["a"]),
        ({"bbox": "0,0,2,1"}, ["a", "b"]),
        ({"state": "surveyed"}, ["b"]),
        ({"state": "withheld", "bbox": "-9,-9,9,9"}, []),
    ],
)
def test_selects(parameters, expected):
    assert [t.tag for t in parse(parameters).of(TAGS)] == expected


def test_version():
    assert parse({"version": "12"}).version == 12


@pytest.mark.parametrize(
    "parameters",
    [
        {"bbox": "1,2,3"},
        {"bbox": "a,b,c,d"},
        {"bbox": "nan,0,1,1"},
        {"bbox": "2,0,1,1"},
        {"state": "lost"},
        {"version": "-1"},
        {"version": "1.5"},
        {"version": "9" * 19},
        {"version": "²"},
        {"box": "0,0,1,1"},
    ],
)
def test_refuses_with_the_name_of_the_parameter(parameters):
    with pytest.raises(RecordRefused, match=next(iter(parameters))):
        parse(parameters)
