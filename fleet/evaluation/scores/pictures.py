"""Pictures of one run: the floor plan, the map as it grew, errors and latencies over time."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fleet.evaluation.scores.scoring import Findings
from fleet.thesis.drawing import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    log_ticks,
    picture,
)
from tagmap.records import Tag
from tagmap.records.arrays import covariance

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY)
CHI_95_2D = 5.991
DRAWN_M = 0.4


def draw(findings: Findings, folder: Path) -> list[tuple[str, str]]:
    """File and caption of each. Raises ImportError without matplotlib."""
    pictures = [
        ("plan.png", _plan, 1, (10.0, 6.4)),
        ("growth.png", _growth, 2, (10.0, 3.4)),
        ("poses.png", _poses, 1, (10.0, 3.6)),
        ("acks.png", _acks, 2, (10.0, 3.2)),
    ]
    captions = []
    for name, paint, panels, size in pictures:
        said: list[str] = []

        def on(
            _figure: "Figure", axes: list[Any], paint: Any = paint, said: list[str] = said
        ) -> None:
            said.append(paint(findings, *axes))

        picture(folder / name, panels, on, size)
        captions.append((name, said[0]))
    return captions


def _plan(findings: Findings, axes: "Axes") -> str:
    """Seen from above, in the frame of the truth."""
    evidence = findings.evidence
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    for room in evidence.world.scenario.rooms():
        _outline(axes, room)
    for k, (name, track) in enumerate(evidence.tracks.items()):
        colour = COLOURS[k % len(COLOURS)]
        axes.plot(track.T[::25, 0, 3], track.T[::25, 1, 3], color=colour, lw=1.0, label=name)
    true = np.array(list(evidence.world.tags(evidence.world.end_ns).values()))
    axes.plot(true[:, 0], true[:, 1], "+", color=GREY, ms=10, label="true tags")
    enlarged = _ellipses(findings, axes)
    axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return (
        "Floor plan: where robots drove, where tags truly hang, and where the map has them, with"
        f" ellipses of 95 % enlarged {enlarged} times."
    )


def _outline(axes: "Axes", room: Any) -> None:
    from matplotlib.patches import Rectangle

    x, y = getattr(room, "corner_m", (0.0, 0.0))[:2]
    axes.add_patch(
        Rectangle((x, y), room.size_m[0], room.size_m[1], fill=False, color=INK, linewidth=1.5)
    )


def _ellipses(findings: Findings, axes: "Axes") -> int:
    from matplotlib.patches import Ellipse

    latest, tags = findings.evidence.latest, findings.tags
    if latest is None or tags is None or tags.T_truth_map is None:
        return 1
    T = tags.T_truth_map
    placed = [tag for tag in findings.evidence.tags.get(latest.version, []) if tag.p_m and tag.cov]
    shapes = [_ellipse(tag, T[:3, :3]) for tag in placed]
    typical = float(np.median([width for width, _, _ in shapes])) if shapes else DRAWN_M
    enlarged = max(1, round(DRAWN_M / max(typical, 1e-6)))
    for tag, (width, height, angle) in zip(placed, shapes, strict=True):
        p = T[:3, :3] @ np.array(tag.p_m) + T[:3, 3]
        size = (enlarged * width, enlarged * height)
        axes.add_patch(Ellipse(p[:2], *size, angle=angle, fill=False, color=VERMILION, zorder=3))
        axes.plot(p[0], p[1], ".", color=VERMILION, ms=4)
        axes.annotate(tag.tag[-3:], p[:2], (4, 4), textcoords="offset points", fontsize=7)
    return enlarged


def _ellipse(tag: Tag, R: Any) -> tuple[float, float, float]:
    assert tag.cov is not None
    cov = (R @ covariance(tag.cov) @ R.T)[:2, :2]
    variances, along = np.linalg.eigh(cov)
    small, large = 2.0 * np.sqrt(CHI_95_2D * np.maximum(variances, 0.0))
    return float(large), float(small), float(np.rad2deg(np.arctan2(along[1, 1], along[0, 1])))


def _growth(findings: Findings, count: "Axes", error: "Axes") -> str:
    """Of each version: how many tags, and how far off."""
    evidence = findings.evidence
    versions = sorted(evidence.versions, key=lambda one: one.version)
    t_s = [_since_s(findings, one.t_ns) for one in versions]
    count.step(t_s, [one.tags for one in versions], where="post", color=BLUE)
    count.set(xlabel="time [s]", ylabel="tags on the map", ylim=(0, None))
    shown = [
        (t, e) for t, one in zip(t_s, versions, strict=True) if (e := _rmse(findings, one.version))
    ]
    if shown:
        error.semilogy([t for t, _ in shown], [1e3 * e for _, e in shown], color=VERMILION)
        log_ticks(error)
    error.set(xlabel="time [s]", ylabel="RMSE of tags [mm]")
    return "The map as it grew: tags that it has, and their error after alignment."


def _rmse(findings: Findings, version: int) -> float | None:
    errors = findings.errors.get(version)
    value = None if errors is None else errors.rmse_m
    return value if value is not None and np.isfinite(value) and value > 0.0 else None


def _poses(findings: Findings, axes: "Axes") -> str:
    for k, (name, track) in enumerate(sorted(findings.live.items())):
        t_s = [_since_s(findings, int(t)) for t in track.t_ns]
        axes.semilogy(
            t_s,
            1e3 * np.maximum(track.error_m, 1e-4),
            ".",
            ms=2.5,
            color=COLOURS[k % 6],
            label=name,
        )
    axes.set(xlabel="time [s]", ylabel="error of live poses [mm]")
    if findings.live:
        log_ticks(axes)
        axes.legend(loc="upper right")
    for event in findings.evidence.world.scenario.event:
        axes.axvline(event.at_s, color=GREY, lw=0.8, ls=":")
    for fault in findings.evidence.world.scenario.fault:
        axes.axvline(fault.at_s, color=VERMILION, lw=0.8, ls=":")
    return (
        "Errors of the live poses that the service gave out. Dotted: events (grey) and faults (red)"
        " of the scenario. Gaps: the robot was lost, or the map could not yet be aligned."
    )


def _acks(findings: Findings, latency: "Axes", names: "Axes") -> str:
    ms = findings.delivery.ack_ms
    if len(ms):
        edges: Any = np.geomspace(0.1, max(1e3, ms.max()), 60)
        latency.hist(np.clip(ms, 0.1, None), bins=edges, color=BLUE)
        latency.set_xscale("log")
    latency.set(xlabel="from keyframe to acknowledgement [ms]", ylabel="keyframes")
    for bars in (latency, names):
        bars.set_axisbelow(True)
    kinds: dict[str, int] = {}
    for shot in findings.evidence.shots:
        kinds[shot.kind] = kinds.get(shot.kind, 0) + 1
    names.barh(list(kinds), list(kinds.values()), color=GREEN)
    names.set(xlabel="targets shot at")
    return "How long keyframes waited for their acknowledgement, and what shots came to."


def _since_s(findings: Findings, t_ns: int) -> float:
    return 1e-9 * (t_ns - findings.evidence.world.start_ns)
