"""The outcome of a run: one JSON object for machines, tables for people."""

from typing import TYPE_CHECKING, Any

from tagmap.cli.show import show_facts, show_table

if TYPE_CHECKING:
    from fleet.evaluation.evaluate import Evaluation
    from fleet.running.run import Run


def as_contract(dataset: str, run: "Run", evaluation: "Evaluation") -> dict[str, Any]:
    """Names and units as documented in docs/recorded-data.md; null where there is no truth."""
    summary = run.results.summary
    return {
        "dataset": dataset,
        "robots": {
            str(number): {"keyframes": run.results.keyframes[number], **_track(evaluation, number)}
            for number in sorted(run.results.keyframes)
        },
        "landmarks": _landmarks(run, evaluation),
        "scale": summary.get("scale"),
        "keyframes_sent": run.keyframes_sent,
        "keyframes_stored": run.results.keyframes_stored,
        "map_version": run.results.version,
        "wall_s": round(run.wall_s, 3),
        "solve_s": summary.get("solve_s"),
        "db": str(run.db),
    }


def _track(evaluation: "Evaluation", number: int) -> dict[str, Any]:
    from dataclasses import asdict

    from fleet.evaluation.evaluate import TrackErrors

    errors = asdict(evaluation.tracks.get(number, TrackErrors()))
    errors["evaluated"] = errors.pop("n")
    return errors


def _landmarks(run: "Run", evaluation: "Evaluation") -> dict[str, Any]:
    errors = evaluation.landmarks
    return {
        "n": errors.n,
        "rmse_m": errors.rmse_m,
        "max_m": errors.max_m,
        "nees": None if errors.nees is None else errors.nees.value,
        "nees_band": None if errors.nees is None else list(errors.nees.band),
        "per_landmark": {
            tag: {"error_m": errors.error_m.get(tag), "sigma_m": estimate.sigma_m}
            for tag, estimate in sorted(run.results.estimate.tags.items(), key=_by_number)
        },
    }


def _by_number(item: tuple[str, Any]) -> tuple[int, str]:
    """10 after 9, where tags are named by numbers."""
    tag = item[0]
    return (int(tag), tag) if tag.isdecimal() else (0, tag)


def show(dataset: str, run: "Run", evaluation: "Evaluation") -> None:
    contract = as_contract(dataset, run, evaluation)
    landmarks = contract["landmarks"]
    show_table(
        "tags",
        ["tag", "error_m", "sigma_m"],
        [[tag, e["error_m"], e["sigma_m"]] for tag, e in landmarks["per_landmark"].items()],
    )
    columns = ["keyframes", "evaluated", "position_rmse_m", "position_median_m", "heading_rmse_rad"]
    columns += ["rpe_1s_m", "rpe_1s_rad"]
    show_table(
        "robots",
        ["robot", *columns],
        [[n, *(robot[c] for c in columns)] for n, robot in contract["robots"].items()],
    )
    facts = {f"tags {name}": landmarks[name] for name in ("n", "rmse_m", "max_m", "nees")}
    facts["positions median_m"] = evaluation.position_median_m
    names = (
        "scale",
        "keyframes_sent",
        "keyframes_stored",
        "map_version",
        "wall_s",
        "solve_s",
        "db",
    )
    show_facts(facts | {name: contract[name] for name in names})
