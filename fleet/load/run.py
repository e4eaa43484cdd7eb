"""Loads put on a site from an empty database: one, or faster and faster until it breaks."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from fleet.load.ground import Ground, ground
from fleet.load.plan import Load, require_holdable
from fleet.load.trial import REACH_MS, Trial, trial
from fleet.running.folder import run_folder

FASTER = 1.25
# Other people's work on the machine can spoil one trial; it seldom spoils two.
CHANCES = 2


@dataclass(frozen=True, slots=True)
class Outcome:
    """trials: one, or all steps in order. counters, tags, version: the service's own at the end;
    solves: see Ground. broke: why the last trial was the last, None where it did not break."""

    trials: list[Trial]
    interrupted: bool
    counters: dict[str, int]
    version: int | None
    tags: int
    solves: list[dict[str, Any]]
    broke: str | None = None


def run(load: Load, stopped: Callable[[], bool], tell: Callable[[str], None]) -> Outcome:
    """One load; TagmapError where the site cannot be run."""
    return _on_ground(load, stopped, tell, _once)


def run_until_it_breaks(
    load: Load, stopped: Callable[[], bool], tell: Callable[[str], None]
) -> Outcome:
    """Faster by a quarter each time, until it breaks twice at the same rate."""
    return _on_ground(load, stopped, tell, _steps)


def why_broken(found: Trial) -> str | None:
    """What a trial missed, in words."""
    if found.ack.p99 is None or found.ack.p99 > REACH_MS:
        return f"p99 of acknowledgements is {found.ack.p99 or 'infinite'} ms, above {REACH_MS:g} ms"
    if found.queue.growing:
        return f"the queue grows by {found.queue.slope_per_s:g} keyframes per s"
    return None


def _on_ground(
    load: Load,
    stopped: Callable[[], bool],
    tell: Callable[[str], None],
    act: "Callable[[Ground, Load, Callable[[], bool], Callable[[str], None]], _Acted]",
) -> Outcome:
    hellos = [source.hello for source in load.sources]
    with run_folder("tagmap-load-", keep=False) as folder, ground(folder, hellos, tell) as site:

        def ended() -> bool:
            site.supervisor.require_running()
            return stopped()

        trials, broke = act(site, load, ended, tell)
        status = site.status()
        return Outcome(
            trials=trials,
            interrupted=stopped(),
            counters=status["counters"] | {"in_database": status["keyframes"]},
            version=status["map_version"],
            tags=status["tags"],
            solves=site.solves(),
            broke=broke,
        )


_Acted = tuple[list[Trial], str | None]


def _once(
    site: Ground, load: Load, stopped: Callable[[], bool], tell: Callable[[str], None]
) -> _Acted:
    return [trial(site.robots, load, site.meter(), stopped, tell)], None


def _steps(
    site: Ground, load: Load, stopped: Callable[[], bool], tell: Callable[[str], None]
) -> _Acted:
    trials: list[Trial] = []
    chances = CHANCES
    while not stopped():
        found = trial(site.robots, load, site.meter(), stopped, tell)
        trials.append(found)
        if stopped():
            break
        broken = why_broken(found)
        tell(f"{load.rate_hz:.4g} Hz: p99 {found.ack.p99} ms, {broken or 'holds'}")
        if broken is not None:
            chances -= 1
            if not chances:
                return trials, broken
            continue
        chances, faster = CHANCES, FASTER * load.rate_hz
        require_holdable(len(load.sources), faster, load.duration_s)
        load = replace(load, rate_hz=faster)
    return trials, None
