"""What is promised of aiming holds in a sample; in full in test_full.py."""

import pytest

from fleet.benchmarks.scanner import SUITE
from fleet.benchmarks.suite import Measured, Plan


@pytest.fixture(scope="module")
def measured() -> Measured:
    return SUITE.run(Plan(sample=True))


def test_aim_is_within_reach(measured: Measured) -> None:
    aims = [m for m in SUITE.metrics if m.reach is not None and not m.key.endswith("by_bound")]
    assert len(aims) == 8
    for metric in aims:
        assert metric.reaches(measured.figures[metric.key].value), metric.key


def test_aim_is_about_as_good_as_can_be(measured: Measured) -> None:
    """Of five calibrations the ratio scatters by a quarter."""
    for place in ("grid", "random"):
        for name in ("near", "far"):
            assert 0.6 < measured.figures[f"{place}_{name}_by_bound"].value < 1.4


def test_simpler_models_miss_by_centimetres(measured: Measured) -> None:
    for model in ("simplified", "pinhole"):
        assert measured.figures[f"{model}_near_mm"].value > 10.0
        assert measured.figures[f"{model}_far_mm"].value > 25.0


def test_even_a_projective_camera_is_worse(measured: Measured) -> None:
    for name in ("near", "far"):
        figures = measured.figures
        assert figures[f"projective_{name}_mm"].value > 1.5 * figures[f"grid_{name}_mm"].value
