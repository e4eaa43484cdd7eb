"""One small run, judged; and every score reacts to what it is about."""

import itertools
from dataclasses import replace

import msgspec
import numpy as np
import pytest

from fleet.evaluation.scores.evidence import Evidence
from fleet.evaluation.scores.scoring import find, score
from fleet.running.scenario import play_scenario
from fleet.running.tape import Heard, Tape, read_tape
from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world
from fleet.virtual.run import SITE_NUMBER
from tagmap.records import Keyframe
from tagmap.records.keyframe import Measurement

START_NS = 1_770_000_000 * 10**9
ROOM = """
about = "One robot drives a little among six tags, three of them surveyed"
duration_s = 24
[building]
room = [{ size_m = [6, 5, 3] }]
[tags]
tag = [
  { p_m = [3.2, 1.4, 3.0] }, { p_m = [3.4, 3.4, 3.0] }, { p_m = [4.0, 2.3, 3.0] },
  { p_m = [4.6, 1.2, 3.0] }, { p_m = [4.9, 3.6, 3.0] }, { p_m = [5.4, 2.4, 3.0] },
]
[survey]
tags = "corners"
[[robot]]
camera_hz = 3
route = { waypoints_m = [[1.5, 2.2], [2.1, 2.5]], every_m = 2.0, stop_s = 9.0 }
"""


def played(folder, seed=1):
    folder.mkdir()
    (folder / "room.toml").write_text(ROOM)
    world = build_world(read_scenario(folder / "room.toml"), seed, START_NS)
    seconds = []
    evidence = play_scenario(world, folder, seconds.append, lambda: False)
    assert len(seconds) >= 24
    assert seconds == sorted(seconds)
    return evidence


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return played(tmp_path_factory.mktemp("runs") / "first")


@pytest.fixture(scope="module")
def findings(run):
    return find(run, SITE_NUMBER)


def test_a_robot_that_knew_nothing_ends_with_a_map_and_a_place_on_it(findings):
    scores = score(findings, None)
    assert scores.tags_total == 6
    assert 4 <= scores.tags_mapped <= 6
    assert scores.ids_right > 50
    assert scores.ids_wrong == 0
    assert scores.tag_rmse_m < 0.01
    assert scores.pose_p95_m < 0.02
    assert 0.0 < scores.time_to_first_fix_s < scores.sim_s
    assert 0.3 < scores.availability < 1.0
    assert scores.keyframes_stored == scores.keyframes_sent > 10
    assert scores.keyframes_duplicated == scores.records_torn == scores.false_alarms == 0
    assert 1.0 < scores.ack_p50_ms <= scores.ack_p99_ms < 1000.0
    assert scores.shots_per_identity > 2.0
    assert scores.moved_found is None
    assert scores.nees_tags_band[0] < 1.0 < scores.nees_tags_band[1]


def test_the_contract_is_in_order_and_complete(findings):
    fields = list(msgspec.json.decode(score(findings, "report.html").json()))
    wanted = [
        *[
            "scenario",
            "seed",
            "sim_s",
            "wall_s",
            "tags_total",
            "tags_mapped",
            "tag_rmse_m",
            "tag_max_m",
        ],
        *["pose_rmse_m", "pose_p95_m", "live_pose_p95_m", "heading_p95_rad", "availability"],
        *["time_to_first_fix_s", "ids_right", "ids_wrong", "ids_abstained", "shots", "nees_tags"],
        *["nees_tags_band", "nees_poses", "nees_poses_band", "moved_found", "moved_missed"],
        *["false_alarms", "keyframes_sent", "keyframes_stored", "keyframes_duplicated"],
        *[
            "ack_p50_ms",
            "ack_p99_ms",
            "records_right",
            "records_stale",
            "records_torn",
            "report",
            "db",
        ],
    ]
    assert [name for name in fields if name in wanted] == wanted


def test_the_same_seed_is_the_same_run_bit_for_bit(run, tmp_path):
    again = played(tmp_path / "again")
    assert again.keyframes == run.keyframes
    assert again.versions == run.versions
    assert again.tags == run.tags
    for a, b in zip(again.poses, run.poses, strict=True):
        assert (a.T == b.T).all()
    assert again.shots == run.shots
    assert again.heard == run.heard


def test_another_seed_is_another_run(run):
    other = build_world(run.world.scenario, 2, START_NS)
    p, q = (np.array(list(world.survey.values())) for world in (other, run.world))
    assert (p != q).all()


def with_keyframes(run, change):
    """The evidence as if other keyframes had been stored."""
    other = replace(run)
    other.__dict__["keyframes"] = [change(keyframe) for keyframe in run.keyframes]
    for name in ("heard", "versions", "tags", "poses", "tracks"):
        other.__dict__[name] = getattr(run, name)
    return other


def swapped(keyframe: Keyframe) -> Keyframe:
    """Names of the first two sightings exchanged."""
    if len(keyframe.sightings) < 2:
        return keyframe
    a, b, *rest = keyframe.sightings
    other = msgspec.structs.replace
    return other(keyframe, sightings=(other(a, tag=b.tag), other(b, tag=a.tag), *rest))


def test_exchanged_names_are_wrong(run):
    names = find(with_keyframes(run, swapped), SITE_NUMBER).names
    pairs = sum(len(keyframe.sightings) >= 2 for keyframe in run.keyframes)
    assert names.wrong == 2 * pairs > 0


def test_a_spot_elsewhere_is_wrong(run):
    def off(keyframe):
        if not keyframe.sightings:
            return keyframe
        first, *rest = keyframe.sightings
        u, *others = first.z.values
        z = Measurement(stereo_px=(u + 6.0, *others), cov=first.z.cov)
        moved = msgspec.structs.replace(first, z=z)
        return msgspec.structs.replace(keyframe, sightings=(moved, *rest))

    stereo = [k for k in run.keyframes if k.sightings and k.sightings[0].z.form == "stereo_px"]
    names = find(with_keyframes(run, lambda k: off(k) if k in stereo else k), SITE_NUMBER).names
    assert names.wrong == len(stereo) > 0


def test_what_was_stored_twice_is_told(run):
    other = with_keyframes(run, lambda keyframe: keyframe)
    other.__dict__["keyframes"] = [*run.keyframes, run.keyframes[-1]]
    assert find(other, SITE_NUMBER).delivery.duplicated == 1


def test_what_was_acknowledged_and_is_not_there_is_lost(run):
    assert find(run, SITE_NUMBER).delivery.lost == 0
    other = with_keyframes(run, lambda keyframe: keyframe)
    other.__dict__["keyframes"] = run.keyframes[:-3]
    assert find(other, SITE_NUMBER).delivery.lost == 3


def test_memories_are_judged_by_what_is_in_them(run):
    world = run.world
    tag = world.scene.tags[0]
    before = tag.memory.words
    try:
        tag.memory.restore([0x1234] * len(before))
        torn = find(run, SITE_NUMBER).memories.torn
    finally:
        tag.memory.restore(before)
    assert torn == find(run, SITE_NUMBER).memories.torn + 1


def test_an_optimistic_covariance_shows(run, monkeypatch):
    """Spots that claim to be two and a half times better than they are."""

    def bold(keyframe):
        other = msgspec.structs.replace
        return other(
            keyframe,
            sightings=tuple(
                other(s, z=other(s.z, cov=tuple(0.16 * c for c in s.z.cov)))
                for s in keyframe.sightings
            ),
        )

    keyframes = {k.seq: bold(k) for k in run.keyframes}
    from tagmap.store import SiteStore

    stored = SiteStore.keyframes

    def boldly(self, after_id=0):
        for row_id, keyframe in stored(self, after_id):
            yield row_id, keyframes[keyframe.seq]

    honest = find(run, SITE_NUMBER).consistency
    monkeypatch.setattr(SiteStore, "keyframes", boldly)
    bold_one = find(replace(run), SITE_NUMBER).consistency
    assert bold_one.tags.value > 1.5 * honest.tags.value


def test_a_tape_that_was_cut_is_read_up_to_there(tmp_path):
    path = tmp_path / "wire.tape"
    heard = [Heard(n, f"tagmap/site/robots/r{n}/pose", bytes(n)) for n in range(1, 5)]
    with Tape(path) as tape:
        for one in heard:
            tape.hear(one.t_ns, one.key, one.payload)
    assert list(read_tape(path)) == heard
    whole = path.read_bytes()
    for cut in range(len(whole)):
        path.write_bytes(whole[:cut])
        found = list(read_tape(path))
        assert found == heard[: len(found)]


def test_evidence_is_of_any_clock(run):
    robot = run.world.robots["r1"]
    assert isinstance(run, Evidence)
    for keyframe, after in itertools.pairwise(run.keyframes):
        assert run.when(keyframe) < run.when(after)
        assert robot.clock_ns(run.when(keyframe)) == keyframe.t_ns
