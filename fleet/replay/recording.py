"""What every reader of recorded data returns: per robot, an introduction and its observations."""

from dataclasses import dataclass
from pathlib import Path

from tagmap.conventions import Kind
from tagmap.records import Introduction, Observation
from tagmap.records.journal import write_journal


@dataclass(frozen=True, slots=True)
class RobotRecording:
    """One robot's journal. `number` is also its key in the results."""

    robot: str
    number: int
    introduction: Introduction
    observations: list[Observation]


@dataclass(frozen=True, slots=True)
class Recording:
    """A data set without its truth. `notes`: what was left out or missing, a line each."""

    dataset: str
    kind: Kind
    robots: list[RobotRecording]
    notes: list[str]


def write_journals(recording: Recording, folder: Path) -> dict[str, Path]:
    """One journal per robot in `folder`; robot -> file."""
    journals: dict[str, Path] = {}
    for robot in recording.robots:
        journals[robot.robot] = folder / f"{robot.robot}.journal"
        write_journal(journals[robot.robot], robot.introduction, robot.observations)
    return journals
