"""One tag identified, read and written over real sockets: laser and reader are emulated."""

import time
from contextlib import closing

import numpy as np

from fleet.emulation.galvo.galvo import EmulatedGalvo
from fleet.emulation.galvo.server import GalvoServer
from fleet.emulation.llrp.reader import EmulatedReader
from fleet.emulation.llrp.server import LlrpServer
from fleet.simulation.scanning import built
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.laser import TrueLaser
from fleet.simulation.scene.memory import UserMemory
from fleet.simulation.scene.scene import Scene
from fleet.simulation.scene.tag import Tag
from robot_agent.activation.aimer import Aimer
from robot_agent.activation.memory import Work
from robot_agent.activation.rules import ShotRules
from robot_agent.activation.runner import Devices, carry_out
from robot_agent.activation.turn import Shooter, turn
from robot_agent.laser.clock import now_ns, second_ns
from robot_agent.laser.direction import direction_of
from robot_agent.laser.interlock import Interlock, Limits
from robot_agent.laser.opening import open_laser
from robot_agent.laser.watchdog import Watchdog
from robot_agent.rfid.llrp.driver import LlrpConfig, LlrpReader
from tagmap.arbitration.holder import Holder
from tagmap.arbitration.rules import Rules
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for, read
from tagmap.records.arrays import drive
from tagmap.records.job import WriteJob
from tagmap.records.lease import LeaseReply
from tagmap.records.scanner import DriveLimits
from tests.robot_agent.activation.air import target

EPC, OTHER = "e20047000000000000000001", "e20047000000000000000002"
HERE, THERE = (0.3, 0.2, 4.0), (-0.3, 0.2, 4.0)
BYTES = 88
RECORD = TagRecord(map_version=2, p_m=(1.0, 2.0, 3.0), site=3, t_s=9, robot=1, count=4)
SCANNER, DRIVE = built(np.random.default_rng(1)), drive(DriveLimits())
# Ahead and to all sides of cam, which looks along x of base.
T_BASE_CAM = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
LIMITS = Limits((-0.7, 0.7), (-0.5, 0.5), longest_s=0.6, dwell_s=2.0, heartbeat_s=2.0)
# A machine that is busy with other tests is late: longer windows.
RULES = ShotRules(window_s=0.1, margin_s=0.1, memory_s=0.2, write_s=0.25)


def scene_of_two():
    tags = [
        Tag(epc, epc, UserMemory([0] * (BYTES // 2)), p_map=p)
        for epc, p in ((EPC, HERE), (OTHER, THERE))
    ]
    return Scene(tags, [Reader("r1")])


def wait_until(t_ns):
    time.sleep(max(0.0, (t_ns - now_ns()) * 1e-9))


def test_end_to_end():
    scene = scene_of_two()
    emulated = EmulatedGalvo(
        scene, TrueLaser("r1", SCANNER, DRIVE, lambda: np.eye(4)), time.time_ns()
    )
    data = encode_for(BYTES, RECORD, EPC)
    work = Work("r1", 3, None, {EPC: WriteJob(job=5, tag=EPC, record=data, valid_s=9.0)})
    with GalvoServer(emulated) as galvo, LlrpServer(EmulatedReader(scene.antenna("r1"))) as llrp:
        host, port = galvo.address
        direction = direction_of(SCANNER, DRIVE, lambda: T_BASE_CAM)
        with (
            Interlock(
                open_laser(f"udp:{host}:{port}"), LIMITS, direction, now_ns, second_ns
            ) as lock,
            Watchdog(lock),
            closing(LlrpReader(LlrpConfig(host="127.0.0.1", port=llrp.address[1]))) as reader,
        ):
            lease = LeaseReply(lease=7, valid_s=2.0, retry_s=0.0)
            devices = Devices(lock, reader, now_ns, wait_until, lambda *_: lease)
            outcome = identified(devices, work)
        assert scene.lit_since(scene.tag(EPC), time.time_ns()) is None
    assert (outcome.verdict.tag, outcome.verdict.depth) == (EPC, True)
    assert outcome.sighting().lease == 7
    assert outcome.verdict.result.outcome == "written"
    assert read(outcome.verdict.memory, EPC, site=3).record == RECORD


def identified(devices, work):
    shooter = Shooter(Aimer(SCANNER, DRIVE, RULES), Holder(Rules()), np.random.default_rng(0))
    end_s = time.monotonic() + 20.0
    said = []
    while time.monotonic() < end_s:
        once = lambda outcomes: None if outcomes else target(HERE)  # noqa: E731
        for outcome in carry_out(turn(shooter, once, work, now_ns()), devices):
            verdict = outcome.verdict
            said.append(verdict)
            if (
                verdict.kind == "identified"
                and verdict.result
                and verdict.result.outcome == "written"
            ):
                return outcome
    raise AssertionError(said[-3:])
