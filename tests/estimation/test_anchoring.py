"""Surveyed tags make the map absolute, if there are enough good ones."""

from dataclasses import replace

import numpy as np
import pytest
from msgspec import structs

from tagmap.conventions import Array, Kind
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData, SurveyedTag
from tests.estimation.worlds import Drive, World, errors, hall, mapped, session

Site = tuple[World, list[SessionData], list[Array]]


@pytest.fixture(params=["planar", "spatial"])
def site(request: pytest.FixtureRequest) -> Site:
    return _site(request.param)


def _site(kind: Kind) -> Site:
    rng = np.random.default_rng(6)
    world = hall(kind, rng, spread=0.5)
    drives = (Drive(), Drive(centre=(4.0, 4.0), first_rad=1.0))
    reported = [session(world, drive, rng, i + 1) for i, drive in enumerate(drives)]
    return world, [data for data, _ in reported], [T for _, T in reported]


def _state(solution: Solution, tag: str) -> str:
    return next(t.state for t in solution.tags if t.tag == tag)


@pytest.mark.parametrize("surveyed", [(0, 4, 9), (0, 3, 8, 11)], ids=["three", "four"])
def test_enough_surveyed_tags_give_an_absolute_map(site: Site, surveyed: tuple[int, ...]) -> None:
    world, sessions, truths = site
    solution = solve(sessions, world.survey(surveyed))
    assert solution.gauge == "anchored"
    assert solution.report == ()
    found = errors(world, solution, truths)
    np.testing.assert_array_equal(found.T_true_map, np.eye(len(found.T_true_map)))
    assert found.rmse_m < 0.03
    assert max(np.abs(poses).max() for poses in found.poses) < 0.12
    assert {t.tag for t in solution.tags if t.state == "surveyed"} == {f"tag{i}" for i in surveyed}


@pytest.mark.parametrize("sigma_m", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize("surveyed", [(0, 4, 9), (0, 4, 9, 11)], ids=["three", "four"])
def test_a_survey_may_be_much_better_than_the_map(
    site: Site, surveyed: tuple[int, ...], sigma_m: float
) -> None:
    """The map is many sigmas of the survey away from it, but no more than it is wrong itself."""
    world, sessions, truths = site
    solution = solve(sessions, world.survey(surveyed, sigma_m))
    assert solution.gauge == "anchored"
    assert solution.report == ()
    assert {t.tag for t in solution.tags if t.state == "surveyed"} == {f"tag{i}" for i in surveyed}
    found = errors(world, solution, truths)
    assert found.rmse_m < 0.01
    for tag in solution.tags:
        if tag.state == "surveyed":
            np.testing.assert_allclose(tag.p, world.at(tag.tag), rtol=0.0, atol=4.0 * sigma_m)


def test_a_wrong_one_of_very_good_surveys_is_named(site: Site) -> None:
    """By a hand's breadth: far more than the map may be wrong."""
    world, sessions, _ = site
    surveys = world.survey((0, 3, 4, 8, 11), 1e-4)
    x, y, z = surveys[2].p_m
    surveys[2] = replace(surveys[2], p_m=(x + 0.1, y, z))
    solution = solve(sessions, surveys)
    assert solution.gauge == "anchored"
    (line,) = solution.report
    assert line.startswith("tag tag4: its surveyed position is 0.")
    assert errors(world, solution).rmse_m < 0.01


def test_too_few_surveyed_tags_leave_it_floating(site: Site) -> None:
    world, sessions, _ = site
    expected = solve(sessions, [])
    solution = solve(sessions, world.survey((0, 5)))
    assert solution.gauge == "floating"
    assert solution.report == ("map is floating: 2 surveyed tags, 3 needed",)
    for tag, before in zip(solution.tags, expected.tags, strict=True):
        assert tag.state == "mapped"
        np.testing.assert_array_equal(tag.p, before.p)


def test_the_same_tag_surveyed_thrice_is_one_tag(site: Site) -> None:
    world, sessions, _ = site
    solution = solve(sessions, world.survey((0, 0, 0)))
    assert solution.report == ("map is floating: 1 surveyed tags, 3 needed",)


def test_surveyed_tags_in_line_leave_it_floating() -> None:
    world, sessions, _ = _site("spatial")
    world.p[[0, 1, 2]] = world.p[0] + np.outer([0.0, 3.0, 6.0], [1.0, 0.2, 0.0])
    solution = solve(sessions, world.survey((0, 1, 2)))
    assert solution.gauge == "floating"
    line = "map is floating: the 3 surveyed tags are in line and fix no frame"
    assert line in solution.report


def test_surveyed_tags_in_line_to_within_their_error_leave_it_floating() -> None:
    world, sessions, _ = _site("spatial")
    world.p[[0, 1, 2]] = world.p[0] + np.outer([0.0, 3.0, 6.0], [1.0, 0.2, 0.0])
    world.p[1] += [0.0, 0.02, 0.01]
    assert solve(sessions, world.survey((0, 1, 2), sigma_m=0.05)).gauge == "floating"


def test_a_grossly_wrong_survey_is_named_and_does_not_bend_the_map(site: Site) -> None:
    world, sessions, truths = site
    right = solve(sessions, world.survey((0, 3, 4, 8, 11)))
    surveys = world.survey((0, 3, 4, 8, 11))
    x, y, z = surveys[2].p_m
    surveys[2] = replace(surveys[2], p_m=(x + 1.5, y - 1.0, z))
    solution = solve(sessions, surveys)
    assert solution.gauge == "anchored"
    (line,) = solution.report
    assert line.startswith("tag tag4: its surveyed position is 1.8")
    assert line.endswith("not used")
    assert _state(solution, "tag4") == "mapped"
    assert _state(solution, "tag3") == "surveyed"
    found = errors(world, solution, truths)
    assert found.rmse_m < errors(world, right, truths).rmse_m + 0.005


@pytest.mark.parametrize("off_m", [0.1, 0.3, 2.0])
def test_surveys_that_contradict_each_other_do_not_anchor(site: Site, off_m: float) -> None:
    """One of three is wrong: two are left, and two fix no frame."""
    world, sessions, truths = site
    surveys = world.survey((0, 5, 9))
    x, y, z = surveys[1].p_m
    surveys[1] = replace(surveys[1], p_m=(x + off_m, y + 0.5 * off_m, z))
    solution = solve(sessions, surveys)
    assert solution.gauge == "floating"
    assert solution.report[0].startswith("map is floating: ")
    assert len(mapped(solution)) == 12
    assert errors(world, solution, truths).rmse_m < 0.05


def test_surveyed_tags_that_nobody_sees_stand_on_the_map(site: Site) -> None:
    world, sessions, _ = site
    lonely = SurveyedTag("lonely", (30.0, 40.0, 2.0), 0.02)
    solution = solve(sessions, [*world.survey((0, 4, 9)), lonely])
    tag = next(t for t in solution.tags if t.tag == "lonely")
    assert (tag.state, tag.n) == ("surveyed", 0)
    assert tag.p is not None
    assert tag.cov is not None
    np.testing.assert_allclose(tag.p, [30.0, 40.0, 2.0][: len(tag.p)], atol=1e-9)
    np.testing.assert_allclose(np.diag(tag.cov), 0.02**2, rtol=0.1)


def test_the_whole_covariance_of_a_survey_counts(site: Site) -> None:
    """Of a tag that nobody sees it is that of the map; in space and cut to the plane."""
    world, sessions, _ = site
    cov = np.array([[0.09, 0.02, 0.01], [0.02, 0.01, 0.0], [0.01, 0.0, 0.0025]])
    upper = tuple(cov[np.triu_indices(3)].tolist())
    lonely = SurveyedTag("lonely", (5.0, 4.0, 2.0), 0.3, upper)
    solution = solve(sessions, [*world.survey((0, 4, 9)), lonely])
    tag = next(t for t in solution.tags if t.tag == "lonely")
    assert tag.cov is not None
    d = len(tag.cov)
    np.testing.assert_allclose(tag.cov, cov[:d, :d], rtol=0.1, atol=1e-6)


def test_a_covariance_of_equal_sigmas_says_what_a_sigma_says(site: Site) -> None:
    world, sessions, _ = site
    surveys = world.survey((0, 4, 9), sigma_m=0.02)
    spelt = [replace(one, cov=(4e-4, 0.0, 0.0, 4e-4, 0.0, 4e-4), sigma_m=9.0) for one in surveys]
    for a, b in zip(solve(sessions, surveys).tags, solve(sessions, spelt).tags, strict=True):
        assert (a.tag, a.state) == (b.tag, b.state)
        for one, other, atol in ((a.p, b.p, 1e-9), (a.cov, b.cov, 1e-12)):
            assert one is not None
            assert other is not None
            np.testing.assert_allclose(one, other, rtol=1e-6, atol=atol)


def test_before_any_robot_the_survey_is_the_map() -> None:
    world, _, _ = _site("spatial")
    solution = solve([], world.survey((0, 4, 9)))
    assert solution.gauge == "anchored"
    assert mapped(solution) == {"tag0", "tag4", "tag9"}


def test_a_survey_that_no_robot_sees_leaves_the_map_floating(site: Site) -> None:
    """Absolute is never guessed: nothing ties these robots to the survey."""
    _, sessions, _ = site
    far = [
        SurveyedTag(f"far{i}", (50.0 + 3.0 * i, 60.0 + 2.0 * (i % 2), 2.0 + i), 0.02)
        for i in range(4)
    ]
    solution = solve(sessions, far)
    unsurveyed = solve(sessions, [])
    assert solution.gauge == "floating"
    assert mapped(solution) == mapped(unsurveyed)
    assert all(s.connected for s in solution.sessions)
    assert sum(line.startswith("map is floating: robots that share") for line in solution.report)
    assert sum(line.startswith("tag far") for line in solution.report) == 4


def test_robots_that_see_the_survey_only_together_are_anchored_together() -> None:
    """Each robot sees two of the surveyed tags, which fix no frame; merged they see all four."""
    world, sessions, truths = _site("spatial")
    surveyed = world.survey((0, 3, 8, 11))
    blind = [_without(sessions[0], surveyed[:2]), _without(sessions[1], surveyed[2:])]
    solution = solve(blind, surveyed)
    assert solution.gauge == "anchored"
    assert all(s.connected for s in solution.sessions)
    assert errors(world, solution, truths).rmse_m < 0.1


def _without(session: SessionData, surveyed: list[SurveyedTag]) -> SessionData:
    unseen = {survey.tag for survey in surveyed}
    frames = [
        structs.replace(frame, sightings=tuple(s for s in frame.sightings if s.tag not in unseen))
        for frame in session.keyframes
    ]
    return SessionData(session.hello, frames)
