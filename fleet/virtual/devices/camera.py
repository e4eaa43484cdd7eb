"""Free-running cameras: an exposure every period, handed out when it has been read."""

from dataclasses import dataclass

from fleet.virtual.dark_room import Expose
from fleet.virtual.devices.time import RobotTime
from robot_agent.cameras.camera import CameraInfo, Failure, StereoCamera, StereoPair

READ_NS = 30_000_000
"""From the middle of an exposure until its images are there."""
SECOND_NS = 1_000_000_000


@dataclass(slots=True)
class WorldCamera(StereoCamera):
    """`expose`: who makes the images."""

    time: RobotTime
    expose: Expose

    def probe(self) -> CameraInfo | Failure:
        rig = self.time.robot.rig
        sizes = [(lens.width_px, lens.height_px) for lens in (rig.left, rig.right)]
        return CameraInfo("simulated", sizes[0], sizes[1])

    def grab(self, timeout_s: float) -> StereoPair | Failure:
        """The next one; the world ends with its scenario."""
        world, robot = self.time.world, self.time.robot
        period_ns = round(SECOND_NS / robot.table.camera_hz)
        since_ns = self.time.world_ns() - world.start_ns
        exposed_ns = world.start_ns + period_ns * (since_ns // period_ns + 1)
        if exposed_ns > world.end_ns:
            self.time.wait_ns(round(timeout_s * SECOND_NS))
            return Failure("ended", f"{robot.name}: the world is at its end")
        images = self.expose(exposed_ns)
        self.time.wait_world_until(exposed_ns + READ_NS)
        return robot.paired(exposed_ns, images())

    def close(self) -> None:
        """There is nothing to let go of."""
