"""Nobody but an interlock ever holds a laser."""

import ast
from collections.abc import Iterator
from pathlib import Path

import robot_agent

ROOT = Path(robot_agent.__file__).parents[1]
DRIVERS = {"robot_agent.laser.udp", "robot_agent.laser.file", "robot_agent.laser.opening"}


def trees() -> Iterator[tuple[Path, ast.Module]]:
    for package in ("tagmap", "robot_agent"):
        for path in sorted((ROOT / package).rglob("*.py")):
            yield path, ast.parse(path.read_text())


def called(node: ast.Call) -> str:
    return getattr(node.func, "attr", getattr(node.func, "id", ""))


def test_who_opens_a_laser_hands_it_to_an_interlock():
    for path, tree in trees():
        calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call)]
        handed = {
            argument for call in calls if called(call) == "Interlock" for argument in call.args
        }
        for call in calls:
            if called(call) == "open_laser":
                assert call in handed, f"{path}:{call.lineno}"


def test_drivers_are_imported_by_who_opens_them_alone():
    for path, tree in trees():
        if path.parent.name == "laser":
            continue
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module in DRIVERS:
                assert node.module == "robot_agent.laser.opening", f"{path}:{node.lineno}"
