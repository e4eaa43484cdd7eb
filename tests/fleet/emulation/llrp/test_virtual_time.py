"""The emulated reader without socket and clock."""

from fleet.emulation.llrp.reader import EmulatedReader
from fleet.simulation.scene.antenna import Reader
from fleet.simulation.scene.light import Schedule
from fleet.simulation.scene.scene import Scene
from robot_agent.rfid.llrp import requests
from robot_agent.rfid.llrp.codec import llrp, name_of
from robot_agent.rfid.llrp.reports import Fact, Sighting, WindowEvent, facts
from tests.fleet.emulation.llrp.conftest import dark, epc, lit

S = 1_000_000_000


def reader(seed: int = 0, **radio: float) -> EmulatedReader:
    blinking = dark(1)
    blinking.lights = (Schedule(period_ns=2 * S, on_ns=S),)
    scene = Scene([blinking, lit(2)], [Reader("r1", **radio)], seed)  # type: ignore[arg-type]
    return EmulatedReader(scene.antenna("r1"))


def listen(emulated: EmulatedReader, window_s: float, start_ns: int = 0) -> list[Fact]:
    for message in (requests.configure(1000.0), *requests.open_window(7, window_s, [0])):
        emulated.receive(message, start_ns)
    found: list[Fact] = []
    while not any(isinstance(fact, WindowEvent) and fact.ended for fact in found):
        due_ns = emulated.due_ns()
        assert due_ns is not None
        for message in emulated.tick(due_ns):
            found += facts(message, 7)
    return found


def test_light_comes_and_goes():
    found = listen(reader(), 10.0)
    begun, *seen, ended = found
    assert isinstance(begun, WindowEvent)
    assert isinstance(ended, WindowEvent)
    assert begun.t_us == 0
    assert ended.t_us == 10_000_000
    times = [s.first_us or 0 for s in seen if isinstance(s, Sighting) and s.epc == epc(1)]
    assert len(times) > 200
    assert all(2_000 <= t_us % 2_000_000 < 1_000_000 for t_us in times), "lit, and switched on"


def test_the_same_seed_hears_the_same():
    unreliable = {"missed": 0.3, "phantom": 0.1}
    first, second = (listen(reader(5, **unreliable), 2.0) for _ in range(2))
    assert first == second
    assert listen(reader(6, **unreliable), 2.0) != first


def test_a_reader_tells_what_it_was_told():
    emulated = reader()
    p = llrp()
    window = requests.open_window(7, 1.0, [0])
    for message in (*requests.prepare_access(3, 7, epc(2), [requests.read_command(0, 2)]), *window):
        emulated.receive(message, 0)
    [rospecs] = emulated.receive(p.GET_ROSPECS_Message(), 0)
    [accesses] = emulated.receive(p.GET_ACCESSSPECS_Message(), 0)
    [rospec] = [part for part in rospecs.Parameters if name_of(part) == "ROSpec"]
    [access] = [part for part in accesses.Parameters if name_of(part) == "AccessSpec"]
    assert (rospec.ROSpecID, rospec.CurrentState) == (7, p.ROSpecState.Active)
    assert (access.AccessSpecID, access.CurrentState) == (3, True)


def test_what_cannot_be_done_is_refused():
    emulated = reader()
    p = llrp()
    add, enable, start = requests.open_window(7, 1.0, [0])
    codes = [
        answer.Parameters[0].StatusCode
        for message in (start, add, add, start, enable, start, start)
        for answer in emulated.receive(message, 0)
    ]
    good, bad = p.StatusCode.M_Success, p.StatusCode.A_Invalid
    assert codes == [bad, good, bad, bad, good, good, bad]
    locking = p.C1G2Lock_Parameter(OpSpecID=1)
    [answer] = emulated.receive(requests.prepare_access(3, 7, epc(2), [locking])[0], 0)
    assert answer.Parameters[0].StatusCode == p.StatusCode.P_UnsupportedParameter
    [answer] = emulated.receive(p.KEEPALIVE_Message(), 0)
    assert answer.Parameters[0].StatusCode == p.StatusCode.M_UnsupportedMessage
