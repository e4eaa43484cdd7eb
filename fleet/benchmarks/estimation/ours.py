"""Our optimiser as plain least squares: no robust weights, as peers do it."""

from tagmap.estimation.optimise import Optimum, Options, optimise
from tagmap.estimation.problem import Problem, State


class Ours:
    """Packing the problem for the kernels counts as solving."""

    def __init__(self, problem: Problem, start: State, tolerance: float, threads: int = 1) -> None:
        self._problem, self._start = problem, start
        self._options = Options(robust=False, tolerance=tolerance, threads=threads)
        self._optimum: Optimum | None = None

    def solve(self) -> None:
        self._optimum = None
        self._optimum = optimise(self._problem, self._start, self._options)

    @property
    def iterations(self) -> int:
        return self._found.iterations

    @property
    def converged(self) -> bool:
        return self._found.converged

    def state(self) -> State:
        return self._found.state

    @property
    def _found(self) -> Optimum:
        assert self._optimum is not None
        return self._optimum
