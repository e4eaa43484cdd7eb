"""What the data does not determine, and what sighting would mend it."""

from collections.abc import Iterator

import numpy as np

from tagmap.conventions import Array, Kind
from tagmap.estimation.known import HELD_M, LEAST_PARALLAX_RAD
from tagmap.estimation.merge import least_shared
from tagmap.estimation.settled import INLIER_WEIGHT, Open, Settled
from tagmap.estimation.solution import RejectedStep
from tagmap.estimation.stack import Stacked
from tagmap.estimation.start import LEAST_SURVEYED, survey_map
from tagmap.estimation.verdicts import rejected_steps

MOST_NAMED = 5
ENOUGH = 2


def report(settled: Settled, T_map_solved: Array) -> Iterator[str]:
    """One line per finding; T_map_solved: from the axes of `settled` to those of the map."""
    R_map_solved = T_map_solved[:-1, :-1]
    if settled.singular:
        yield (
            "nothing is published: the stated covariances differ so much in size that those of "
            "the map cannot be computed"
        )
    yield from _gauge(settled, R_map_solved)
    yield from _sessions(settled)
    yield from _tags(settled, R_map_solved)
    yield from _steps(settled)
    yield from _surveys(settled.unanchored or settled)


def _gauge(settled: Settled, R_map_solved: Array) -> Iterator[str]:
    surveyed = len(np.unique(settled.stacked.problem.surveyed.tag))
    if settled.start.anchored or not surveyed:
        return
    if settled.loose is not None:
        yield (
            f"map is floating: with the {surveyed} surveyed tags most tags may be off by "
            f"{_way(settled.loose, R_map_solved)}; survey more tags, farther apart, or closer"
        )
    elif settled.unanchored is not None:
        yield f"map is floating: the {surveyed} surveyed tags contradict the robots or each other"
    elif surveyed < LEAST_SURVEYED:
        yield f"map is floating: {surveyed} surveyed tags, {LEAST_SURVEYED} needed"
    elif survey_map(settled.stacked.problem) is None:
        yield f"map is floating: the {surveyed} surveyed tags are in line and fix no frame"
    else:
        needed = least_shared(settled.stacked.problem.kind)
        yield (
            f"map is floating: robots that share tags must see {needed} of the {surveyed} surveyed "
            "ones between them, not in line, and where the survey has them"
        )


def _sessions(settled: Settled) -> Iterator[str]:
    """Sessions of which some or all keyframes have no chain of sightings to the gauge."""
    stacked, start = settled.stacked, settled.start
    seen = _tags_by_session(stacked)
    for s, hello in enumerate(stacked.sessions):
        poses = slice(stacked.bounds[s], stacked.bounds[s + 1])
        withheld = int((~start.placed[poses]).sum())
        if not withheld:
            continue
        shared = sum(bool(start.mapped[tag]) for tag in seen[s])
        total = stacked.bounds[s + 1] - stacked.bounds[s]
        yield (
            f"session {hello.robot}/{hello.session}: {withheld} of {total} keyframes withheld: it "
            f"sees {len(seen[s])} tags, {shared} of them on the map; each unbroken run of odometry "
            f"needs {least_shared(stacked.problem.kind)}, not in line, that agree with the map"
        )


def _tags_by_session(stacked: Stacked) -> list[set[int]]:
    seen: list[set[int]] = [set() for _ in stacked.sessions]
    for block in stacked.problem.sightings:
        bounds = np.searchsorted(block.pose, stacked.bounds)
        for own, begin, end in zip(seen, bounds[:-1], bounds[1:], strict=True):
            own.update(np.unique(block.tag[begin:end]).tolist())
    return seen


def _tags(settled: Settled, R_map_solved: Array) -> Iterator[str]:
    stacked, start = settled.stacked, settled.start
    seen = np.zeros(len(stacked.tags), dtype=np.int64)
    from_map = np.zeros(len(stacked.tags), dtype=np.int64)
    for block in stacked.problem.sightings:
        seen += np.bincount(block.tag, minlength=len(seen))
        placed = start.placed[block.pose]
        from_map += np.bincount(block.tag[placed], minlength=len(seen))
    for tag in np.flatnonzero(~start.mapped):
        way = settled.opened.get(int(tag))
        if way is None:
            why = _why(seen[tag], from_map[tag])
        else:
            why = _open(stacked.problem.kind, int(seen[tag]), way, R_map_solved)
        yield f"tag {stacked.tags[tag]}: withheld: {why}"


def _open(kind: Kind, seen: int, way: Open, R_map_solved: Array) -> str:
    """What a tag lacks that is known too badly."""
    if not np.isfinite(way.sigma_m):
        return f"what its {seen} sightings say of it is lost in rounding; it needs other sightings"
    off = f"its {seen} sightings leave it open by {_way(way, R_map_solved)}"
    if way.parallax_rad is not None:
        return (
            f"{off}, {way.seen_m:.1f} m from where it is seen: they are directions that differ by "
            f"{way.parallax_rad:.4f} rad, {LEAST_PARALLAX_RAD} needed; it needs sightings from "
            "farther to the side, or one with range"
        )
    if way.seen_m is not None:
        return (
            f"{off}, {way.seen_m:.1f} m from where it is seen; it needs sightings from across that "
            "direction, or one with range"
        )
    return (
        f"{off}: where it is seen from is not known better; it needs sightings from keyframes that "
        f"see {least_shared(kind)} other tags of the map, not in line"
    )


def _way(way: Open, R_map_solved: Array) -> str:
    """How far and where to, in axes of the map."""
    axis = R_map_solved @ way.direction
    towards = ", ".join(f"{x + 0.0:.2f}" for x in axis.round(2).tolist())
    beyond = "more than " if way.sigma_m > HELD_M else ""
    sigma_m = min(way.sigma_m, HELD_M)
    return f"{beyond}{sigma_m:.{2 if sigma_m < 10.0 else 0}f} m along ({towards})"


def _why(seen: int, from_map: int) -> str:
    """What a tag lacks, by its sightings and those of them from keyframes on the map."""
    mend = "it needs sightings from two directions or one with range"
    if not from_map:
        return f"no keyframe on the map sees it, {seen} sightings come from elsewhere; {mend}"
    if from_map < ENOUGH:
        return f"its {from_map} sightings from keyframes on the map do not determine it; {mend}"
    return f"its {from_map} sightings contradict each other or leave a direction open; {mend}"


def _steps(settled: Settled) -> Iterator[str]:
    """Odometry that the tags contradict, one line per session."""
    found: dict[tuple[str, str], list[RejectedStep]] = {}
    for step in rejected_steps(settled):
        found.setdefault((step.robot, step.session), []).append(step)
    for (robot, session), steps in found.items():
        worst = sorted(steps, key=lambda step: -step.chi2)[:MOST_NAMED]
        seqs = ", ".join(str(step.seq) for step in sorted(worst, key=lambda step: step.seq))
        yield (
            f"session {robot}/{session}: {len(steps)} odometry steps not used, the tags contradict "
            f"them by up to {np.sqrt(worst[0].chi2):.0f} sigma: seq {seqs}"
            + (", ..." if len(steps) > len(worst) else "")
        )


def _surveys(settled: Settled) -> Iterator[str]:
    """Surveyed positions that the robots' sightings contradict."""
    surveyed, optimum = settled.problem.surveyed, settled.optimum
    r2 = optimum.residuals.surveyed
    for i in np.flatnonzero(optimum.weights.surveyed < INLIER_WEIGHT):
        number = surveyed.tag[i]
        off = np.linalg.norm(optimum.state.p[number] - surveyed.p[i])
        yield (
            f"tag {settled.stacked.tags[settled.tags[number]]}: its surveyed position is "
            f"{off:.3f} m ({np.sqrt(r2[i]):.1f} sigma) away from where the robots see it; not used"
        )
