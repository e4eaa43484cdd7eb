"""How far a step may be wrong: always a covariance, alike in one step and in many, and true."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from robot_agent.odometry.odometry import OdomPose
from robot_agent.odometry.wheels import LONGEST_STEP_M, UNRELATED, Wheels, covariance, step
from tagmap.conventions import Array
from tagmap.geometry import se3
from tagmap.records.arrays import covariance as unpacked
from tagmap.records.arrays import matrix

SHARE, FLOOR = st.floats(0.0, 1.0), st.floats(1e-5, 1.0)
WHEELS = st.builds(
    Wheels,
    forward_share=SHARE,
    lateral_share=SHARE,
    turn_share=SHARE,
    turn_rad_per_m=SHARE,
    uneven_per_m=st.tuples(SHARE, SHARE, SHARE),
    floor_m=FLOOR,
    floor_rad=FLOOR,
    out_of_plane=st.tuples(FLOOR, FLOOR, FLOOR),
)
SMOOTH = Wheels(floor_m=1e-5, floor_rad=1e-5, out_of_plane=(1e-5, 1e-5, 1e-5))


def pose(
    x: float, y: float, theta: float, path_m: float, turn_rad: float, epoch: int = 0
) -> OdomPose:
    T = se3.exp(np.array([0.0, 0.0, 0.0, 0.0, 0.0, theta]))
    T[:2, 3] = x, y
    return OdomPose(0, T, epoch, path_m, turn_rad)


def on_arc(way_m: float, per_m: float) -> OdomPose:
    """After `way_m` on an arc that turns by `per_m` rad/m from the origin."""
    T = se3.exp(way_m * np.array([1.0, 0.0, 0.0, 0.0, 0.0, per_m]))
    return OdomPose(0, T, 0, way_m, abs(per_m) * way_m)


def cov_of(prev: OdomPose, cur: OdomPose, wheels: Wheels) -> Array:
    found = step(prev, cur, wheels)
    assert found is not None
    return unpacked(found.cov)


@given(
    WHEELS,
    st.floats(-1e6, 1e6),
    st.floats(-1e4, 1e4),
    st.floats(-10.0, 10.0),
    st.floats(0.0, LONGEST_STEP_M),
    st.floats(0.0, 1e6),
)
@example(
    # Sideways errors all along one line, nothing else: singular but for rounding and floors.
    Wheels(forward_share=0.0, lateral_share=0.0, turn_share=1.0, turn_rad_per_m=1.0,
           floor_m=1e-5, floor_rad=1e-5),
    7e3, 7e3, 0.0, 1e4, 100.0,
)  # fmt: skip
def test_it_is_always_a_covariance(
    wheels: Wheels, x: float, y: float, theta: float, path_m: float, turn_rad: float
):
    """A record refuses what is none."""
    found = step(pose(0, 0, 0, 0, 0), pose(x, y, theta, path_m, turn_rad), wheels)
    assert (found is None) == (math.hypot(x, y) > LONGEST_STEP_M)


def test_the_step_is_that_between_the_poses():
    prev, cur = pose(1.0, 2.0, math.pi / 2, 5.0, 1.0), pose(1.0, 2.5, math.pi, 6.0, 3.0)
    found = step(prev, cur, Wheels())
    assert found is not None
    np.testing.assert_allclose(matrix(found.T_prev_cur)[:3, 3], [0.5, 0.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(
        prev.T_odom_base @ matrix(found.T_prev_cur), cur.T_odom_base, atol=1e-12
    )


def test_poses_of_two_epochs_have_no_step():
    assert step(pose(0, 0, 0, 0, 0, epoch=0), pose(0, 0, 0, 0, 0, epoch=1), Wheels()) is None


def test_standing_costs_the_floors():
    wheels = Wheels(floor_m=0.001, floor_rad=0.002, out_of_plane=(0.003, 0.004, 0.005))
    cov = cov_of(pose(1, 2, 3, 4, 5), pose(1, 2, 3, 4, 5), wheels)
    floors = [0.001, 0.001, 0.003, 0.004, 0.005, 0.002]
    np.testing.assert_allclose(cov, np.diag(np.square(floors)), rtol=2 * UNRELATED)


def test_straight_ahead_as_by_hand():
    """Heading errors that arise evenly: lateral variance q L^3 / 3, with the heading q L^2 / 2."""
    L, w = 3.0, SMOOTH
    cov = cov_of(on_arc(0.0, 0.0), on_arc(L, 0.0), w)
    q = w.turn_rad_per_m**2
    assert cov[0, 0] == pytest.approx(w.forward_share**2 * L, rel=1e-5)
    assert cov[1, 1] == pytest.approx(w.lateral_share**2 * L + q * L**3 / 3, rel=1e-5)
    assert cov[1, 5] == pytest.approx(q * L**2 / 2, rel=1e-5)
    assert cov[5, 5] == pytest.approx(q * L, rel=1e-5)


@pytest.mark.parametrize("per_m", [0.0, 0.3, -0.75])
def test_many_steps_along_an_arc_are_as_uncertain_as_one(per_m: float):
    whole = cov_of(on_arc(0.0, per_m), on_arc(4.0, per_m), SMOOTH)
    ways = np.cumsum([0.0, 0.5, 0.1, 1.4, 1.0, 0.25, 0.75])
    total = np.zeros((6, 6))
    for a, b in pairwise(ways):
        prev, cur = on_arc(a, per_m), on_arc(b, per_m)
        back = se3.adjoint(se3.inverse(cur.T_odom_base) @ prev.T_odom_base)
        total = back @ total @ back.T + cov_of(prev, cur, SMOOTH)
    planar = np.ix_([0, 1, 5], [0, 1, 5])
    np.testing.assert_allclose(total[planar], whole[planar], rtol=1e-3, atol=1e-8)


def test_an_arc_is_as_uncertain_as_a_thousand_noisy_drives():
    """Each of 100 pieces is wrong by itself; the ends are compared in the frame of the true end."""
    rng = np.random.default_rng(1)
    wheels, xi, n, drives = Wheels(), np.array([2.0, 0, 0, 0, 0, 1.5]), 100, 1000
    sigma = np.sqrt(
        [
            wheels.forward_share**2 * 2.0 / n,
            wheels.lateral_share**2 * 2.0 / n,
            (wheels.turn_share**2 * 1.5 + wheels.turn_rad_per_m**2 * 2.0) / n,
        ]
    )
    T = np.broadcast_to(np.eye(4), (drives, 4, 4))
    for _ in range(n):
        delta = np.zeros((drives, 6))
        delta[:, [0, 1, 5]] = sigma * rng.standard_normal((drives, 3))
        T = T @ se3.exp(xi / n) @ se3.exp(delta)
    errors = se3.log(se3.inverse(se3.exp(xi)) @ T)[:, [0, 1, 5]]
    stated = covariance(xi, 2.0, 1.5, SMOOTH)[np.ix_([0, 1, 5], [0, 1, 5])]
    nees = np.einsum("ki,ij,kj->k", errors, np.linalg.inv(stated), errors)
    # Mean of 1000 chi squares of 3: 3 with a standard deviation of sqrt(6 / 1000).
    assert abs(nees.mean() - 3.0) < 4.0 * math.sqrt(6.0 / drives)


def test_to_and_fro_counts_in_full():
    """Back where it began after 2 m out and 2 m back, and after a round."""
    still = cov_of(pose(0, 0, 0, 0, 0), pose(0, 0, 0, 0, 0), Wheels())
    for turn_rad in (0.0, 2 * math.pi):
        back = cov_of(pose(0, 0, 0, 0, 0), pose(0, 0, 0, 4.0, turn_rad), Wheels())
        assert back[0, 0] - still[0, 0] >= Wheels().forward_share ** 2 * 4.0
        assert back[5, 5] - still[5, 5] == pytest.approx(1e-4 * (4.0 + turn_rad), rel=1e-6)


@pytest.mark.parametrize("round_rad", [4.0, 2 * math.pi, 3 * math.pi])
def test_more_than_half_a_turn_is_not_underestimated(round_rad: float):
    """Compared with the sum of small steps along the true arc of radius 1 m."""
    ways = np.linspace(0.0, round_rad, 61)
    total = np.zeros((6, 6))
    for a, b in pairwise(ways):
        prev, cur = on_arc(a, 1.0), on_arc(b, 1.0)
        back = se3.adjoint(se3.inverse(cur.T_odom_base) @ prev.T_odom_base)
        total = back @ total @ back.T + cov_of(prev, cur, SMOOTH)
    stated = cov_of(on_arc(0.0, 1.0), on_arc(round_rad, 1.0), SMOOTH)
    assert np.trace(stated[:2, :2]) >= np.trace(total[:2, :2])
    assert stated[5, 5] == pytest.approx(total[5, 5], rel=1e-3)


def test_a_step_of_one_that_stands_is_the_shortest_step() -> None:
    """Which is not worked out at all."""
    stood = step(pose(3.0, -2.0, 0.7, 5.0, 2.0), pose(3.0, -2.0, 0.7, 5.0, 2.0), SMOOTH)
    crept = step(pose(3.0, -2.0, 0.7, 5.0, 2.0), pose(3.0, -2.0, 0.7, 5.0 + 1e-12, 2.0), SMOOTH)
    assert stood is not None
    assert crept is not None
    np.testing.assert_allclose(unpacked(stood.cov), unpacked(crept.cov), rtol=1e-4, atol=1e-25)
    np.testing.assert_allclose(matrix(stood.T_prev_cur), matrix(crept.T_prev_cur), atol=1e-12)


def test_a_pose_that_has_jumped_is_driven_whatever_the_wheels_say() -> None:
    far = cov_of(pose(0.0, 0.0, 0.0, 5.0, 0.0), pose(1.0, 0.0, 0.0, 5.0, 0.0), SMOOTH)
    assert far[0, 0] >= SMOOTH.forward_share**2


def test_an_uneven_floor_tilts_a_robot_in_proportion_to_the_way():
    wheels = Wheels(uneven_per_m=(0.001, 0.002, 0.003), out_of_plane=(1e-4, 1e-4, 1e-4))
    here, there = on_arc(0.0, 0.0), on_arc(0.5, 0.0)
    stood, driven = cov_of(here, here, wheels), cov_of(here, there, wheels)
    np.testing.assert_allclose(np.diag(stood)[2:5], 1e-8, rtol=1e-6)
    np.testing.assert_allclose(
        np.diag(driven)[2:5], 1e-8 + np.square([0.0005, 0.001, 0.0015]), rtol=1e-6
    )
