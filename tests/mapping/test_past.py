import numpy as np
import pytest

from tagmap.geometry import se2, se3
from tagmap.mapping.past import Moment, bracket, describe_range, pose_between


def moment(t_ns, x_m=0.0, session="s", cov=None):
    return Moment(session, t_ns, se2.from_p_theta(np.array([x_m, 0.0]), 0.0), cov)


MOMENTS = [moment(10, 1.0), moment(20, 2.0), moment(30, 5.0)]


@pytest.mark.parametrize(("t_ns", "expected"), [(10, (10, 10)), (15, (10, 20)), (30, (30, 30))])
def test_bracket(t_ns, expected):
    before, after = bracket(MOMENTS, t_ns)
    assert (before.t_ns, after.t_ns) == expected


@pytest.mark.parametrize("t_ns", [9, 31])
def test_nothing_is_extrapolated(t_ns):
    assert bracket(MOMENTS, t_ns) is None


def test_nothing_is_interpolated_between_sessions():
    assert bracket([moment(10, session="a"), moment(20, session="b")], 15) is None


def test_halfway_in_the_plane():
    pose = pose_between(MOMENTS[0], MOMENTS[1], 15, 3, "floating")
    assert pose.T_map_base.p_m == pytest.approx((1.5, 0.0))
    assert (pose.t_ns, pose.map_version, pose.state, pose.cov) == (15, 3, "degraded", None)


def test_halfway_in_space_along_the_twist():
    step = np.array([1.0, 0.0, 0.0, 0.0, 0.0, np.pi / 2])
    before, after = Moment("s", 0, np.eye(4), None), Moment("s", 10, se3.exp(step), None)
    pose = pose_between(before, after, 5, 1, "anchored")
    p, q_wxyz = se3.to_p_q(se3.exp(step / 2))
    assert pose.T_map_base.p_m == pytest.approx(p)
    assert pose.T_map_base.q_wxyz == pytest.approx(q_wxyz)
    assert pose.state == "good"


def test_covariances_are_blended_only_if_both_are_known():
    known, unknown = np.ones(6), np.full(6, np.nan)
    both = pose_between(moment(0, cov=known), moment(10, cov=3 * known), 5, 1, "anchored")
    one = pose_between(moment(0, cov=known), moment(10, cov=unknown), 5, 1, "anchored")
    assert both.cov == pytest.approx(2 * known)
    assert one.cov is None


def test_ranges_are_described_in_order():
    assert describe_range([]) == "none yet"
    assert describe_range([(30, 40), (10, 20)]) == "10..20, 30..40"
