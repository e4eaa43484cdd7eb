"""A map from nothing, and the life that follows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from tagmap.estimation.optimise import Options
from tagmap.estimation.settle import settle
from tagmap.estimation.solution import Solution
from tagmap.estimation.solve import frame_of, named
from tagmap.estimation.stack import SessionData, SurveyedTag, stack
from tagmap.living.living import Living


@dataclass(frozen=True, slots=True)
class Begun:
    """living: None where there is no map yet that could be fed."""

    solution: Solution
    living: Living | None


def begin(
    sessions: Sequence[SessionData],
    surveys: Sequence[SurveyedTag],
    clock: Callable[[], float] = lambda: 0.0,
) -> Begun:
    """As tagmap.estimation.solve.solve does."""
    began = clock()
    settled = settle(stack(sessions, surveys), Options())
    solution = replace(named(settled, frame_of(settled)), solve_s=clock() - began)
    return Begun(solution, Living.after(settled) if len(settled.tags) else None)
