"""Whatever passes the records' checks, however absurd its sizes, is answered with a solution."""

import numpy as np
import pytest
from msgspec.structs import replace as changed

from tagmap.conventions import POSE_DOF, Kind
from tagmap.estimation.solve import solve
from tagmap.estimation.stack import SessionData, SurveyedTag
from tagmap.records import Keyframe, Measurement, Odometry, Sighting, arrays
from tests.estimation.worlds import FORMS, Drive, hall, session

Values = tuple[float, ...]


def _spoilt(values: Values, rng: np.random.Generator) -> Values:
    """Some of the numbers, up to 1e11 times what they were."""
    factor = np.where(rng.random(len(values)) < 0.3, 10.0 ** rng.uniform(-3, 11, len(values)), 1.0)
    return arrays.vector(np.clip(np.array(values) * factor, -1e12, 1e12))


def _any_cov(n: int, rng: np.random.Generator) -> Values:
    return arrays.upper(np.diag(10.0 ** rng.uniform(-17.0, 12.0, n)))


def _any_sighting(sighting: Sighting, rng: np.random.Generator) -> Sighting:
    z = sighting.z
    values = _spoilt(z.values, rng)
    if z.form == "range_bearing":
        cov = _any_cov(2, rng)
        spoilt = Measurement(range_m=abs(values[0]) + 1e-9, bearing_rad=values[1], cov=cov)
    else:
        # One variance for all: the records refuse what is not positive definite to rounding.
        cov = arrays.upper(10.0 ** rng.uniform(-17.0, 12.0) * np.eye(len(values)))
        spoilt = Measurement(**{z.form: values}, cov=cov)
    return changed(sighting, z=spoilt)


def _any_keyframe(kind: Kind, frame: Keyframe, rng: np.random.Generator) -> Keyframe:
    sightings = tuple(_any_sighting(s, rng) if rng.random() < 0.3 else s for s in frame.sightings)
    odom = frame.odom
    if odom is not None and rng.random() < 0.3:
        step = changed(odom.T_prev_cur, p_m=_spoilt(odom.T_prev_cur.p_m, rng))
        odom = Odometry(T_prev_cur=step, cov=_any_cov(POSE_DOF[kind], rng))
    return changed(frame, sightings=sightings, odom=odom)


def _any_survey(number: int, rng: np.random.Generator) -> SurveyedTag:
    x, y, z = 10.0 ** rng.uniform(-3.0, 12.0, 3)
    return SurveyedTag(f"tag{number}", (x, y, z), 10.0 ** rng.uniform(-12.0, 9.0))


@pytest.mark.parametrize("kind", ["planar", "spatial"])
@pytest.mark.parametrize("surveyed", [0, 4])
def test_absurd_sizes(kind: Kind, surveyed: int) -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        world = hall(kind, rng, 6, spread=0.5)
        data, _ = session(world, Drive(n=15, radius_m=1.5, forms=FORMS[kind]), rng)
        frames = [_any_keyframe(kind, frame, rng) for frame in data.keyframes]
        surveys = [_any_survey(i, rng) for i in range(surveyed)]
        solution = solve([SessionData(data.hello, frames)], surveys)
        for tag in solution.tags:
            assert (tag.p is None) == (tag.cov is None)
            assert tag.p is None or np.isfinite(tag.p).all()
            assert tag.cov is None or np.isfinite(tag.cov).all()
        for one in solution.sessions:
            assert np.isfinite(one.T).all()
