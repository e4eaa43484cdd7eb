"""Scanners that are off, and files of samples of their beams."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fleet.simulation import scanning
from robot_agent.calibration.scanner.samples import HEADER, Samples
from tagmap.geometry.scanner.scanner import Scanner

Sampled = tuple[Scanner, Samples]


@pytest.fixture
def grid_of() -> Callable[[int], Sampled]:
    """`grid_of(seed)`: a scanner, and 30 samples of it on the field grid."""

    def make(seed: int) -> Sampled:
        rng = np.random.default_rng(seed)
        truth = scanning.built(rng)
        return truth, scanning.sampled(truth, scanning.field_grid(), rng)

    return make


@pytest.fixture
def write_samples(tmp_path: Path) -> Callable[[Samples], Path]:
    """Writes SAMPLES.csv as the command reads it."""

    def write(samples: Samples) -> Path:
        rows = np.concatenate([samples.theta, samples.p_cam], axis=1).tolist()
        lines = [",".join(HEADER), *(",".join(map(repr, row)) for row in rows)]
        path = tmp_path / "samples.csv"
        path.write_text("\n".join(lines) + "\n")
        return path

    return write
