"""One process, one thread of arithmetic: as the solver's own process has it."""

import os

LIBRARIES = ("OMP", "OPENBLAS", "MKL", "NUMBA")


def one_thread() -> None:
    """Before numpy is loaded. On the small matrices of one run, threads of the linear algebra wait
    for each other longer than they work, and sums depend on how many cores there are."""
    for library in LIBRARIES:
        os.environ.setdefault(f"{library}_NUM_THREADS", "1")
