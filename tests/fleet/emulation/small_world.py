"""A small room with a handful of tags, and robots that stand in it: quick to build."""

from pathlib import Path

from msgspec.structs import replace

from fleet.simulation.scenario.reading import read_scenario
from fleet.simulation.world.build import build_world
from fleet.simulation.world.world import World
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for
from tagmap.memory.writing import plan_write
from tagmap.records.rig_file import find_rig, write_rig

TAGS = {
    "e20000000000000000000001": (4.0, 3.3, 2.7),
    "e20000000000000000000002": (4.7, 2.3, 2.6),
    "e20000000000000000000003": (4.5, 3.9, 2.7),
    "e20000000000000000000004": (3.7, 2.2, 2.65),
}
FIXED = "[[robot]]\nroute.waypoints_m = [[3.0, 3.0]]\n"
TURNING = (
    '[[robot]]\nmounting = "pan-tilt"\ncamera_p_m = [0.0, 0.0, 0.6]\n'
    "route.waypoints_m = [[2.8, 3.0]]\n"
)


def small_world(folder: Path, start_ns: int, *robots: str) -> World:
    """With these robots, which begin to stand at `start_ns`."""
    return build_world(read_scenario(small_scenario(folder, *robots)), 1, start_ns)


def small_scenario(folder: Path, *robots: str) -> Path:
    """The first three tags are surveyed."""
    rig = find_rig("wide-angle")
    half = {
        name: replace(
            getattr(rig, name),
            width_px=640,
            height_px=512,
            fx_px=260.0,
            fy_px=260.0,
            cx_px=319.5,
            cy_px=255.5,
        )
        for name in ("left", "right")
    }
    write_rig(folder / "half.toml", replace(rig, **half), {})
    tags = ", ".join(f'{{p_m = {list(p)}, epc = "{epc}"}}' for epc, p in TAGS.items())
    common = 'rig = "half.toml"\ncamera_pitch_deg = 60\ncamera_hz = 4\n'
    (folder / "small.toml").write_text(
        "duration_s = 1\n"
        "building.room = [{size_m = [8, 6, 2.8]}]\n"
        "calibration.exact = true\n"
        f"tags.tag = [{tags}]\n"
        f"survey.tags = [1, 2, 3]\n" + "".join(robot + common for robot in robots or (FIXED,))
    )
    return folder / "small.toml"


def confirming(config: Path, confirm_s: float) -> Path:
    """The robot lights what has a name again after so long: there is always a reason to."""
    content = config.read_text()
    config.write_text(content.replace("[agent]\n", f"[agent]\nconfirm_s = {confirm_s}\n"))
    return config


def remember(world: World) -> None:
    """Every tag has a record of where it is."""
    for tag in world.scene.tags:
        blank = bytes(2 * len(tag.memory.words))
        record = TagRecord(
            site=1,
            map_version=1,
            p_m=tag.p_map,
            cov=(1e-5, 0.0, 0.0, 1e-5, 0.0, 1e-5),
            t_s=1_700_000_000,
            robot=9,
            count=100,
        )
        plan = plan_write(blank, encode_for(len(blank), record, tag.epc), tag.epc, None, 1)
        assert plan is not None
        for k, word in enumerate(plan.words, plan.first_word):
            assert tag.memory.write(k, word) is None
