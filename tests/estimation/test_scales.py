"""Common scales of ranges and of the stereo baseline: recovered where determined, else held."""

import numpy as np
import pytest

from tagmap.conventions import Form, Kind
from tagmap.estimation.optimise import Options
from tagmap.estimation.settle import settle
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData, stack
from tests.estimation.worlds import Drive, Scale, World, errors, hall, session

SURVEYED = (0, 3, 4, 8, 11)
CASES: list[tuple[Kind, Form]] = [
    ("planar", "range_bearing"),
    ("planar", "point_cam_m"),
    ("spatial", "stereo_px"),
    ("spatial", "point_cam_m"),
]


def _site(
    kind: Kind, form: Form, scale: Scale, odometry: bool = True
) -> tuple[World, list[SessionData]]:
    rng = np.random.default_rng(7)
    world = hall(kind, rng)
    drives = (
        Drive(forms=(form,), range_scale=scale, stereo_scale=scale, odometry=odometry),
        Drive(
            centre=(4.0, 4.0),
            forms=(form,),
            range_scale=scale,
            stereo_scale=scale,
            odometry=odometry,
        ),
    )
    return world, [session(world, drive, rng, i + 1)[0] for i, drive in enumerate(drives)]


def _scale(solution: Solution, form: Form) -> float:
    scale = solution.stereo_scale if form == "stereo_px" else solution.scale
    assert scale is not None
    return scale


@pytest.mark.parametrize(("kind", "form"), CASES)
def test_surveyed_tags_determine_the_scale(kind: Kind, form: Form) -> None:
    world, sessions = _site(kind, form, Scale(1.05, 0.1))
    surveys = world.survey(SURVEYED)
    solution = solve(sessions, surveys)
    marginals = settle(stack(sessions, surveys), Options()).marginals
    assert marginals is not None
    sigma = np.sqrt(np.diag(marginals.calibration())[1 if form == "stereo_px" else 0])
    assert sigma < 0.006
    assert abs(_scale(solution, form) - 1.05) < 4.0 * sigma
    assert errors(world, solution).rmse_m < 0.04


@pytest.mark.parametrize(("kind", "form"), CASES[:3])
def test_without_anything_metric_the_prior_holds_the_scale(kind: Kind, form: Form) -> None:
    """No survey, no odometry: a map at 1.05 fits as well as one at 1."""
    _, sessions = _site(kind, form, Scale(1.05, 0.01), odometry=False)
    solution = solve(sessions, [])
    assert _scale(solution, form) == pytest.approx(1.0, abs=0.005)


def test_a_scale_that_is_stated_exact_is_no_unknown() -> None:
    world, sessions = _site("planar", "range_bearing", Scale())
    solution = solve(sessions, world.survey(SURVEYED))
    assert solution.scale is None
    assert solution.stereo_scale is None


def test_a_scale_that_no_sighting_feels_stays_at_its_prior() -> None:
    world, sessions = _site("spatial", "stereo_px", Scale(1.03, 0.1))
    solution = solve(sessions, world.survey(SURVEYED))
    assert solution.scale == 1.0
    assert solution.stereo_scale == pytest.approx(1.03, abs=0.005)


def test_robots_that_know_their_scale_are_not_scaled() -> None:
    """Only one of two states an unknown scale, and only its ranges are too long."""
    rng = np.random.default_rng(7)
    world = hall("planar", rng)
    unsure = Drive(range_scale=Scale(1.05, 0.1))
    sure = Drive(centre=(4.0, 4.0))
    sessions = [session(world, d, rng, i + 1)[0] for i, d in enumerate((unsure, sure))]
    solution = solve(sessions, [])
    assert solution.scale == pytest.approx(1.05, abs=0.006)
    assert errors(world, solution).rmse_m < 0.03
