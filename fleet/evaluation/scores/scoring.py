"""All scores of one run."""

from dataclasses import dataclass

import numpy as np

from fleet.evaluation.scores import poses as of_poses
from fleet.evaluation.scores.changes import Changes, judge_changes
from fleet.evaluation.scores.consistency import Consistency, judge_consistency
from fleet.evaluation.scores.contract import Scores
from fleet.evaluation.scores.delivery import Delivery, judge_delivery
from fleet.evaluation.scores.evidence import Evidence
from fleet.evaluation.scores.identities import Names, judge_names
from fleet.evaluation.scores.memories import Memories, judge_memories
from fleet.evaluation.scores.tags import TagErrors, tag_errors
from fleet.simulation.world.reach import reachable
from tagmap.conventions import Array


@dataclass(frozen=True, slots=True)
class Findings:
    """Everything that scores and pictures are made of. errors: by version; tags: of the last."""

    evidence: Evidence
    errors: dict[int, TagErrors]
    tags: TagErrors | None
    T_truth_of: dict[int, Array | None]
    smoothed: of_poses.Smoothed | None
    live: dict[str, of_poses.Live]
    names: Names
    delivery: Delivery
    memories: Memories
    changes: Changes
    consistency: Consistency
    solve_s: tuple[float, ...]


def find(evidence: Evidence, site_number: int) -> Findings:
    latest = evidence.latest
    errors = {one.version: tag_errors(evidence, one.version) for one in evidence.versions}
    T_truth_of = {version: one.T_truth_map for version, one in errors.items()}
    tags = errors[latest.version] if latest else None
    T = None if tags is None else tags.T_truth_map
    return Findings(
        evidence,
        errors,
        tags,
        T_truth_of,
        None if T is None else of_poses.smoothed(evidence, T),
        of_poses.live(evidence, T_truth_of),
        judge_names(evidence),
        judge_delivery(evidence),
        judge_memories(evidence, site_number),
        judge_changes(evidence, T_truth_of),
        judge_consistency(evidence),
        _solve_s(evidence),
    )


def score(findings: Findings, report: str | None) -> Scores:
    evidence, world = findings.evidence, findings.evidence.world
    tags, smoothed, live = findings.tags, findings.smoothed, findings.live
    names, changes = findings.names, findings.changes
    latest = evidence.latest
    nees_tags, nees_poses = findings.consistency.tags, findings.consistency.poses
    anchored = latest is not None and latest.gauge == "anchored"
    has_moves = bool(changes.found or changes.missed)
    ack_ms = findings.delivery.ack_ms
    return Scores(
        scenario=world.scenario.name,
        seed=world.seed,
        sim_s=1e-9 * (world.end_ns - world.start_ns),
        wall_s=round(evidence.wall_s, 3),
        tags_total=len(world.tags(world.start_ns)),
        tags_reachable=len(reachable(world)),
        tags_mapped=0 if tags is None else tags.on_map,
        tag_rmse_m=None if tags is None else _finite(tags.rmse_m),
        tag_max_m=None if tags is None else _most(tags.error_m),
        tag_rmse_anchored_m=_rms(tags.raw_m) if tags is not None and anchored else None,
        pose_rmse_m=None if smoothed is None else _rms(smoothed.error_m),
        pose_p95_m=None if smoothed is None else _percentile(smoothed.error_m, 95),
        live_pose_p95_m=of_poses.p95_m(live),
        heading_p95_rad=None if smoothed is None else _percentile(smoothed.heading_rad, 95),
        rpe_1s_m=None if smoothed is None else _rms(smoothed.rpe_m),
        availability=of_poses.availability(evidence, live),
        time_to_first_fix_s=of_poses.first_fix_s(evidence, live),
        ids_right=names.right,
        ids_wrong=names.wrong,
        ids_abstained=names.abstained,
        shots=names.shots,
        shots_per_identity=names.shots / names.identified if names.identified else None,
        nees_tags=None if nees_tags is None else nees_tags.value,
        nees_tags_band=None if nees_tags is None else nees_tags.band,
        nees_poses=None if nees_poses is None else nees_poses.value,
        nees_poses_band=None if nees_poses is None else nees_poses.band,
        moved_found=changes.found if has_moves else None,
        moved_missed=changes.missed if has_moves else None,
        moved_after_sightings=float(np.mean(changes.after)) if changes.after else None,
        false_alarms=changes.false_alarms,
        keyframes_sent=evidence.sent,
        keyframes_stored=findings.delivery.stored,
        keyframes_duplicated=findings.delivery.duplicated,
        keyframes_lost=findings.delivery.lost,
        ack_p50_ms=_percentile(ack_ms, 50),
        ack_p99_ms=_percentile(ack_ms, 99),
        solve_p50_s=_percentile(np.array(findings.solve_s), 50),
        records_right=findings.memories.right,
        records_stale=findings.memories.stale,
        records_torn=findings.memories.torn,
        report=report,
        db=str(evidence.db),
    )


def _solve_s(evidence: Evidence) -> tuple[float, ...]:
    with evidence.store() as store:
        summaries = [store.summary(one.version) for one in evidence.versions]
    return tuple(float(one["solve_s"]) for one in summaries if one and one.get("solve_s"))


def _finite(value: float | None) -> float | None:
    return None if value is None or not np.isfinite(value) else value


def _rms(values: Array) -> float | None:
    return float(np.sqrt(np.mean(values**2))) if len(values) else None


def _most(values: Array) -> float | None:
    return _finite(float(values.max())) if len(values) else None


def _percentile(values: Array, q: float) -> float | None:
    return float(np.percentile(values, q)) if len(values) else None
