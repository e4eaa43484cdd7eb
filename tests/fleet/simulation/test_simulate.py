import numpy as np
import pytest

from fleet.simulation.hall import hall
from fleet.simulation.simulate import T_BASE_CAM, Simulated, simulate
from tagmap.geometry import se3, stereo
from tagmap.records.arrays import covariance, matrix, stereo_rig

START_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def simulated() -> Simulated:
    return simulate(seed=7, duration_s=60.0, rate_hz=2.0, start_ns=START_NS)


def test_same_seed_same_bits(simulated: Simulated):
    again = simulate(seed=7, duration_s=60.0, rate_hz=2.0, start_ns=START_NS)
    assert again.recording == simulated.recording
    other = simulate(seed=8, duration_s=60.0, rate_hz=2.0, start_ns=START_NS)
    assert other.recording != simulated.recording


def test_hall_has_24_tags_with_room_between():
    building = hall(np.random.default_rng(0))
    p = np.array(list(building.tags.values()))
    distance = np.linalg.norm(p[:, None] - p[None], axis=-1)[np.triu_indices(24, 1)]
    assert len(p) == 24
    assert distance.min() > 1.0
    assert (p >= 0.0).all()
    assert (p <= [building.length_m, building.width_m, building.height_m]).all()
    assert set(building.surveyed) <= set(building.tags)


def test_every_tag_is_seen_and_the_robots_share_some(simulated: Simulated):
    seen = [
        {s.tag for o in robot.observations for s in o.sightings}
        for robot in simulated.recording.robots
    ]
    assert set.union(*seen) == set(simulated.hall.tags)
    assert len(seen[0] & seen[1]) >= 3
    assert len(seen[1] & seen[2]) >= 3
    assert seen[0] - seen[2]
    assert seen[2] - seen[0]


def test_sightings_scatter_as_their_covariance_says(simulated: Simulated):
    rig = None
    chi2 = []
    for robot in simulated.recording.robots:
        rig = stereo_rig(robot.introduction.rig)  # type: ignore[arg-type]
        for T_map_base, o in zip(
            simulated.truth.tracks[robot.number].T, robot.observations, strict=True
        ):
            T_cam_map = se3.inverse(T_map_base @ T_BASE_CAM)
            for s in o.sightings:
                px, _ = stereo.project(rig, se3.act(T_cam_map, simulated.hall.tags[s.tag]))
                error = np.array(s.z.values) - px
                chi2.append(error @ np.linalg.solve(covariance(s.z.cov), error))
    assert np.mean(chi2) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / len(chi2)))


def test_odometry_scatters_as_its_covariance_says(simulated: Simulated):
    chi2 = []
    for robot in simulated.recording.robots:
        T = simulated.truth.tracks[robot.number].T
        steps = se3.inverse(T[:-1]) @ T[1:]
        for true, o in zip(steps, robot.observations[1:], strict=True):
            assert o.odom is not None
            delta = se3.log(se3.inverse(matrix(o.odom.T_prev_cur)) @ true)
            chi2.append(delta @ np.linalg.solve(covariance(o.odom.cov), delta))
    assert np.mean(chi2) == pytest.approx(6.0, abs=4.0 * np.sqrt(12.0 / len(chi2)))


def test_robots_stay_on_the_floor_and_keep_their_speed(simulated: Simulated):
    for track in simulated.truth.tracks.values():
        steps = np.linalg.norm(np.diff(track.T[:, :3, 3], axis=0), axis=-1)
        assert (track.T[:, 2, 3] == 0.0).all()
        assert steps.std() < 0.01 * steps.mean()
