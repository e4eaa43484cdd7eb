"""How long a user waits for a command that does nothing: whole processes, from start to end."""

import subprocess
import sys
import sysconfig
import time
from pathlib import Path

from fleet.benchmarks.metric import Metric
from fleet.benchmarks.suite import Plan, Suite
from tagmap.errors import DataError

PROGRAMS = ("tagmap", "robot-agent", "fleet")
HELP_REACH_S = 0.3
ROUNDS = 15
SAMPLE_ROUNDS = 1


def measure(plan: Plan) -> dict[str, list[float]]:
    """Every round runs the reference and each program once, so all see the same machine."""
    reference = [sys.executable, "-c", "import click"]
    commands = {program: [_script(program), "--help"] for program in PROGRAMS}
    for command in (reference, *commands.values()):
        _wall_s(command)
    runs: dict[str, list[float]] = {metric.key: [] for metric in METRICS}
    for _ in range(SAMPLE_ROUNDS if plan.sample else ROUNDS):
        reference_s = _wall_s(reference)
        runs["import_click_s"].append(reference_s)
        for program, command in commands.items():
            wall_s = _wall_s(command)
            runs[f"{program}_help_s"].append(wall_s)
            runs[f"{program}_help_ratio"].append(wall_s / reference_s)
    return runs


def _script(program: str) -> str:
    path = Path(sysconfig.get_path("scripts")) / program
    if not path.is_file():
        raise DataError(f"{program} is not installed in {path.parent}")
    return str(path)


def _wall_s(command: list[str]) -> float:
    began_s = time.perf_counter()
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=False)
    wall_s = time.perf_counter() - began_s
    if done.returncode:
        raise DataError(f"{' '.join(command)}: exit {done.returncode}: {done.stderr.decode()}")
    return wall_s


METRICS = (
    Metric("import_click_s", "s", "lower", "python -c 'import click', the reference"),
    *(Metric(f"{p}_help_s", "s", "lower", f"{p} --help", reach=HELP_REACH_S) for p in PROGRAMS),
    *(
        Metric(f"{p}_help_ratio", "x", "lower", f"{p} --help by the reference", tolerance=0.35)
        for p in PROGRAMS
    ),
)
SUITE = Suite("startup", "what a command costs before it does anything", METRICS, measure)
