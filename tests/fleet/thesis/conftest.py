"""One small report for all tests of this folder."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from fleet.thesis.effort import Effort
from fleet.thesis.run import NUMBERS, REPORT, run

SMALL = Effort(trials=4, projections=2_000, images=8, groups=20)
SEED = 7


@dataclass(frozen=True)
class Report:
    folder: Path
    contract: dict[str, Any]
    told: list[str]
    effort: Effort = SMALL
    seed: int = SEED

    @property
    def sections(self) -> dict[str, Any]:
        return self.contract["sections"]

    @property
    def html(self) -> str:
        return (self.folder / REPORT).read_text()

    @property
    def numbers(self) -> dict[str, Any]:
        return json.loads((self.folder / NUMBERS).read_text())


@pytest.fixture(scope="session")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    folder, told = tmp_path_factory.mktemp("thesis"), []
    return Report(folder, run(folder, SMALL, SEED, told.append), told)
