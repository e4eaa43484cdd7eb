"""What the parts of a solve cost on this machine: `python docs/estimation_costs.py`.

One thread, processor time, the best of ROUNDS; beside them how fast the machine copies and
multiplies.
"""

import os
import time
from collections.abc import Callable

os.environ |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")

import numpy as np

from fleet.benchmarks.estimation.starts import start
from fleet.benchmarks.estimation.world import Size, make
from tagmap.estimation.reduced import Reduced
from tagmap.estimation.system import System

SIZE, ROUNDS = Size(489, 20_000), 15
COPIED_BYTES, MULTIPLIED = 400_000_000, 1_500


def best_s(work: Callable[[], object]) -> float:
    times = []
    for _ in range(ROUNDS):
        began_s = time.process_time()
        work()
        times.append(time.process_time() - began_s)
    return min(times)


def machine() -> tuple[float, float]:
    """Copying, GB/s read and written; multiplying matrices, Gflop/s."""
    source = np.ones(COPIED_BYTES // 8)
    target, A = np.empty_like(source), np.ones((MULTIPLIED, MULTIPLIED))
    copying_s = best_s(lambda: np.copyto(target, source))
    return 2e-9 * COPIED_BYTES / copying_s, 2e-9 * MULTIPLIED**3 / best_s(lambda: A @ A)


def main() -> None:
    world = make(SIZE)
    problem = world.problem
    system = System(problem)
    values, belief = system.values(start(world, "noisy_truth")), system.certain()
    point, reduced = system.at(values, belief), Reduced(system)
    assert reduced.prepare(point, 1e-6, True, None)
    assert reduced.precondition is not None
    x, kept = np.ones(3 * problem.n_tags), reduced.precondition
    parts = {
        "the cost only": lambda: system.at(values, belief, model=False),
        "linearise everything": lambda: system.at(values, belief),
        "factor the chains, right side": lambda: reduced.prepare(point, 1e-6, False, None),
        "the same and a new preconditioner": lambda: reduced.prepare(point, 1e-6, True, None),
        "preconditioner, used": lambda: kept(x),
        "product with S": lambda: reduced.times(x),
    }
    copied, multiplied = machine()
    print(f"{problem.n_tags} tags, {problem.n_poses} poses, {problem.n_sightings} sightings")
    print(f"the machine copies {copied:.0f} GB/s and multiplies {multiplied:.0f} Gflop/s")
    for name, work in parts.items():
        print(f"{name:36s}{1e3 * best_s(work):8.2f} ms")


if __name__ == "__main__":
    main()
