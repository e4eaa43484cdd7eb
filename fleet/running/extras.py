"""What a run needs beyond a plain installation: asked before it begins."""

from importlib.util import find_spec

from fleet.simulation.scenario.description import Scenario
from tagmap.errors import TagmapError

PACKAGES = {"sim": ("open3d",), "llrp": ("pyllrp", "bitstring"), "pan-tilt": ("serial",)}
"""Of each extra of tagmap: what it brings that is imported."""


def demand(scenario: Scenario, live: bool) -> None:
    """Raises TagmapError, which says what to install."""
    lacking = [extra for extra in _extras(scenario, live) if not _is_there(extra)]
    if lacking:
        packages = ", ".join(name for extra in lacking for name in PACKAGES[extra])
        raise TagmapError(f"this needs {packages}: pip install 'tagmap[{','.join(lacking)}]'")


def _extras(scenario: Scenario, live: bool) -> list[str]:
    if not live:
        return ["sim"]
    turns = any(robot.mounting == "pan-tilt" for robot in scenario.robot)
    return ["sim", "llrp", "pan-tilt"] if turns else ["sim", "llrp"]


def _is_there(extra: str) -> bool:
    return all(find_spec(name) is not None for name in PACKAGES[extra])
