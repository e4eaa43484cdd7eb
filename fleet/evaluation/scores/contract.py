"""The scores of a run, in the order in which they are printed; null where there is none of it."""

from typing import Any

import msgspec

Band = tuple[float, float] | None


class Scores(msgspec.Struct, frozen=True, kw_only=True):
    """See docs/harness.md for what each is."""

    scenario: str
    seed: int
    sim_s: float
    wall_s: float
    tags_total: int
    tags_reachable: int
    tags_mapped: int
    tag_rmse_m: float | None
    tag_max_m: float | None
    tag_rmse_anchored_m: float | None
    pose_rmse_m: float | None
    pose_p95_m: float | None
    live_pose_p95_m: float | None
    heading_p95_rad: float | None
    rpe_1s_m: float | None
    availability: float | None
    time_to_first_fix_s: float | None
    ids_right: int
    ids_wrong: int
    ids_abstained: int
    shots: int
    shots_per_identity: float | None
    nees_tags: float | None
    nees_tags_band: Band
    nees_poses: float | None
    nees_poses_band: Band
    moved_found: int | None
    moved_missed: int | None
    moved_after_sightings: float | None
    false_alarms: int
    keyframes_sent: int
    keyframes_stored: int
    keyframes_duplicated: int
    keyframes_lost: int
    ack_p50_ms: float | None
    ack_p99_ms: float | None
    solve_p50_s: float | None
    records_right: int
    records_stale: int
    records_torn: int
    report: str | None
    db: str

    def fields(self) -> dict[str, Any]:
        return msgspec.structs.asdict(self)

    def json(self) -> str:
        return msgspec.json.encode(self).decode()
