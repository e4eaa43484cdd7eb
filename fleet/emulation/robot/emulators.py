"""The devices of one robot, all there from the beginning of a `with` to its end."""

import secrets
import socket
import time
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Literal, Self, TypeAlias

from fleet.emulation.camera.server import CameraServer
from fleet.emulation.galvo.galvo import EmulatedGalvo
from fleet.emulation.galvo.server import GalvoServer
from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.server import LlrpServer
from fleet.emulation.odometry.sender import OdometrySender
from fleet.emulation.pan_tilt.terminal import UnitTerminal
from fleet.emulation.robot.exposures import Exposures
from fleet.emulation.robot.files import HOST, PAN_TILT, ROBOT, Ports, Site, make_folder, write_files
from fleet.emulation.robot.head import Head
from fleet.emulation.robot.outlet import Outlet
from fleet.simulation.world.robot import WorldRobot
from fleet.simulation.world.world import World
from robot_agent.odometry.datagram import Reckoned

Device: TypeAlias = Literal["cameras", "odometry", "laser", "rfid", "pan-tilt"]
"""As `robot-agent check` calls them; only robots that have one have a pan-tilt unit."""
BAUD = 9600


class RobotEmulators:
    """Of `robot` in `world`, whose times are UTC, in true time. What the robot needs to know is
    written into `folder`. Ports that are 0 are any free ones, and stay the same afterwards.
    ends: cameras say so when the world is at its end."""

    def __init__(
        self,
        world: World,
        robot: WorldRobot,
        folder: Path,
        site: Site,
        ports: Ports | None = None,
        baud: int = BAUD,
        ends: bool = False,
    ) -> None:
        self._world, self._robot, self._folder = world, robot, folder
        self._baud = baud
        self._epoch: int | None = None
        self._sender: OdometrySender | None = None
        now_ns = time.time_ns()
        self._head = None if robot.known.mount.turning is None else Head(now_ns)
        angles_at = None if self._head is None else self._head.angles_at
        end_ns = (lambda: world.end_ns) if ends else None
        self._exposures = Exposures(robot, world.start_ns, angles_at, end_ns)
        self._beam = robot.laser.at(time.time_ns, angles_at)
        self._galvo = self._new_galvo()
        self.outlets: dict[Device, Outlet] = {
            "cameras": Outlet(self._cameras),
            "odometry": Outlet(self._odometry),
            "laser": Outlet(self._laser, lambda: self._galvo.power_off(time.time_ns())),
            "rfid": Outlet(self._reader),
        }
        if self._head is not None:
            self.outlets["pan-tilt"] = Outlet(self._terminal)
        self._site = site
        self.ports = ports or Ports()
        if not self.ports.odometry:
            self.ports = replace(self.ports, odometry=_free_port())

    @property
    def name(self) -> str:
        return self._robot.name

    @property
    def config(self) -> Path:
        return self._folder / ROBOT

    @property
    def terminal(self) -> Path | None:
        """The port of its pan-tilt unit."""
        return None if self._head is None else self._folder / PAN_TILT

    def start(self, device: Device) -> None:
        """Raises LinkError where its address is taken."""
        self.outlets[device].start()

    def stop(self, device: Device) -> None:
        """As if it had lost its power, or a unit's line were pulled out."""
        self.outlets[device].stop()

    def tick(self, now_ns: int) -> None:
        """What moved carries light along."""
        self._galvo.carried(now_ns)

    def __enter__(self) -> Self:
        """Raises ConfigError and LinkError: files that cannot be written, ports that are taken."""
        try:
            make_folder(self._folder)
            self._warm_up()
            for outlet in self.outlets.values():
                outlet.start()
            write_files(self._folder, self._robot, self._site, self.ports, self._baud)
        except BaseException:
            self._stop()
            raise
        return self

    def __exit__(
        self,
        _kind: type[BaseException] | None,
        _error: BaseException | None,
        _trace: TracebackType | None,
    ) -> None:
        self._stop()

    def _warm_up(self) -> None:
        """The first image and the first beam take long; nobody is to wait for them."""
        self._robot.pair(self._world.start_ns)
        middle = 1 << (self._beam.drive.dac_bits - 1)
        self._beam.on(self._world.scene, (middle, middle))

    def _stop(self) -> None:
        for outlet in self.outlets.values():
            outlet.stop()

    def _cameras(self) -> AbstractContextManager[object]:
        server = CameraServer(self._exposures.pairs, HOST, self.ports.cameras)
        self.ports = replace(self.ports, cameras=server.address[1])
        return server

    def _odometry(self) -> AbstractContextManager[object]:
        self._sender = OdometrySender(self._reckoned, HOST, self.ports.odometry)
        return self._sender

    def _laser(self) -> AbstractContextManager[object]:
        self._galvo = self._new_galvo()
        server = GalvoServer(self._galvo, HOST, self.ports.laser)
        self.ports = replace(self.ports, laser=server.address[1])
        return server

    def _reader(self) -> AbstractContextManager[object]:
        antenna = self._world.scene.antenna(self.name)
        server = LlrpServer(EmulatedReader(antenna), HOST, self.ports.rfid)
        self.ports = replace(self.ports, rfid=server.address[1])
        return server

    def _terminal(self) -> AbstractContextManager[object]:
        assert self._head is not None
        return UnitTerminal(self._head, self.terminal, baud=self._baud)

    def _new_galvo(self) -> EmulatedGalvo:
        return EmulatedGalvo(self._world.scene, self._beam, time.time_ns())

    def _reckoned(self, now_ns: int) -> Reckoned:
        """Whoever swaps the battery of a robot, or carries it, has its controller begin anew."""
        epoch, x_m, y_m, theta_rad = self._robot.odometry(now_ns)
        if self._epoch not in (None, epoch) and self._sender is not None:
            self._sender.epoch = secrets.randbits(32)
        self._epoch = epoch
        return Reckoned(self._robot.clock_ns(now_ns), x_m, y_m, theta_rad)


def _free_port() -> int:
    """Where the robot may listen for its odometry."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind((HOST, 0))
        return int(probe.getsockname()[1])
