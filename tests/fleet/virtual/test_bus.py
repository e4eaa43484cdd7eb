"""The bus: who gets what, when, and what weather and cuts do to it."""

from collections.abc import Callable
from itertools import pairwise

import pytest

from fleet.virtual.bus import Bus
from fleet.virtual.matching import meets
from fleet.virtual.port import Killed, Port
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.weather import CALM, Weather
from tagmap.errors import LinkError

MS_NS = 10**6
SECOND_NS = 10**9


class World:
    """`heard`: (t_ms, key, payload) at a port that subscribes to everything."""

    def __init__(self, seed: int = 1, weather: Weather = CALM, **of: Weather) -> None:
        self.time = VirtualTime(0)
        self.bus = Bus(self.time, seed, weather, of)
        self.ear = self.bus.port("ear")
        self.ear.subscribe("site/**", self._hear)
        self.heard: list[tuple[int, str, bytes]] = []
        self.alive: list[tuple[float, str, bool]] = []

    def _hear(self, key: str, payload: bytes) -> None:
        self.heard.append((self.time.now_ns() // MS_NS, key, payload))

    def watch(self) -> None:
        self.ear.watch_alive(
            "site/*", lambda key, alive: self.alive.append((self.time.now_ns() / 1e9, key, alive))
        )

    def run(self, *lives: Callable[[], None], for_s: float = 10.0) -> None:
        self.time.run([lambda: listen(self.ear, for_s), *lives])

    @property
    def payloads(self) -> list[bytes]:
        return [payload for _, _, payload in self.heard]


def listen(port: Port, for_s: float) -> None:
    """Look now and then, as the service does."""
    until_ns = port.now_ns() + round(for_s * SECOND_NS)
    while port.now_ns() < until_ns:
        port.wait(lambda: False, min(until_ns, port.now_ns() + 100 * MS_NS))


def sends(world: World, count: int, every_ms: int = 10, name: str = "mouth"):
    """A life that puts `count` numbers."""
    port = world.bus.port(name)

    def live() -> None:
        for n in range(count):
            port.put("site/words", str(n).encode())
            world.time.wait_ns(every_ms * MS_NS)

    return live


def numbers(count: int) -> list[bytes]:
    return [str(n).encode() for n in range(count)]


def test_what_is_put_arrives_in_order_and_after_both_ways():
    world = World()
    world.run(sends(world, 50, every_ms=1))
    assert world.payloads == numbers(50)
    assert all(2 <= t_ms - n <= 10 for n, (t_ms, _, _) in enumerate(world.heard))
    assert {key for _, key, _ in world.heard} == {"site/words"}


def test_who_does_not_subscribe_hears_nothing():
    world = World()
    deaf, heard = world.bus.port("deaf"), []
    deaf.subscribe("site/*/more", lambda *sample: heard.append(sample))
    world.run(sends(world, 5), lambda: listen(deaf, 5.0))
    assert (len(world.heard), heard) == (5, [])


@pytest.mark.parametrize("seed", [1, 2])
def test_bad_weather_repeats(seed):
    rough = Weather(lost=0.2, doubled=0.2, late=0.2, torn=0.2, flipped=0.2)

    def heard(seed: int) -> list[tuple[int, str, bytes]]:
        world = World(seed, mouth=rough)
        world.run(sends(world, 200))
        return world.heard

    assert heard(seed) == heard(seed) != heard(seed + 1)


def test_lost_doubled_and_late():
    def heard(**weather: float) -> list[bytes]:
        world = World(mouth=Weather(**weather))
        world.run(sends(world, 200))
        return world.payloads

    lost = heard(lost=0.3)
    assert lost == sorted(lost, key=int)
    assert 100 < len(lost) < 170
    doubled = heard(doubled=0.3)
    assert sorted(set(doubled), key=int) == numbers(200)
    assert 230 < len(doubled) < 290
    late = heard(late=0.3)
    assert sorted(late, key=int) == numbers(200)
    assert late != numbers(200)


def test_torn_is_shorter_and_flipped_is_one_bit():
    def heard(**weather: float) -> list[bytes]:
        world = World(mouth=Weather(**weather))
        port = world.bus.port("mouth")

        def live() -> None:
            for _ in range(50):
                port.put("site/words", bytes(20))

        world.run(live)
        return world.payloads

    assert all(len(payload) < 20 for payload in heard(torn=1.0))
    assert all(sum(map(int.bit_count, payload)) == 1 for payload in heard(flipped=1.0))


def test_a_slow_consumer_gets_the_rest_dropped():
    world = World(ear=Weather(per_s=100.0, queue=10))
    world.run(sends(world, 200, every_ms=1))
    assert 20 < len(world.heard) < 50
    times_ms = [t_ms for t_ms, _, _ in world.heard]
    assert all(b - a >= 9 for a, b in pairwise(times_ms))


def test_what_is_sent_while_it_is_cut_is_lost():
    world = World()
    world.bus.cut("mouth", 500 * MS_NS, 1000 * MS_NS)
    world.run(sends(world, 150))
    assert world.payloads == numbers(50) + numbers(150)[100:]


def test_a_cut_is_noticed_after_a_lease_and_healed():
    world = World()
    world.watch()
    port, seen = world.bus.port("mouth"), []
    port.declare_alive("site/mouth")

    def live() -> None:
        for _ in range(100):
            seen.append(port.connected())
            world.time.wait_ns(SECOND_NS // 10)

    def scenario() -> None:
        world.time.wait_ns(SECOND_NS)
        world.bus.cut("mouth")
        world.time.wait_ns(5 * SECOND_NS)
        world.bus.heal("mouth")

    world.run(scenario, live)
    assert [alive for _, _, alive in world.alive] == [True, False, True]
    assert [t_s for t_s, _, _ in world.alive] == pytest.approx([0.0, 4.0, 7.0], abs=0.11)
    assert seen == [True] * 40 + [False] * 30 + [True] * 30


def test_a_short_cut_is_noticed_by_nobody():
    world = World()
    world.watch()
    port = world.bus.port("mouth")
    port.declare_alive("site/mouth")
    world.bus.cut("mouth", SECOND_NS, 3 * SECOND_NS)
    world.run()
    assert [alive for _, _, alive in world.alive] == [True]


def answering(port: Port, text: str) -> None:
    port.serve("site/*/state", lambda query: query.reply(query.key, text.encode() + query.payload))


def test_questions_are_answered_by_all_who_serve_the_key():
    world = World()
    asker, found = world.bus.port("asker"), []
    for name in ("one", "two"):
        answering(world.ear if name == "one" else world.bus.port(name), name)
    other = world.bus._ports["two"]

    def live() -> None:
        found.append(asker.get("site/r1/state?a=1", b"!"))
        found.append(asker.get("site/r1/unknown"))

    world.run(live, lambda: listen(other, 3.0), for_s=3.0)
    assert sorted(reply.payload for reply in found[0]) == [b"one!", b"two!"]
    assert found[1] == []


def test_a_question_that_nobody_ends_ends_by_itself():
    world = World()
    asker, found = world.bus.port("asker"), []
    world.ear.serve("site/state", lambda _: None)

    def live() -> None:
        found.extend(asker.get("site/state", timeout_s=2.0))
        found.append(world.time.now_ns())

    world.run(live)
    assert (found[0].error, found[1]) == ("Timeout", 2 * SECOND_NS)


def test_an_error_is_an_answer():
    world = World()
    asker, found = world.bus.port("asker"), []
    world.ear.serve("site/state", lambda query: query.reply_error(query.parameters["a"]))
    world.run(lambda: found.extend(asker.get("site/state?a=b;c=d")))
    assert [reply.error for reply in found] == ["b"]


def test_nobody_can_be_asked():
    world = World()
    asker = world.bus.port("asker")
    world.bus.cut("asker", 0, 20 * SECOND_NS)

    def live() -> None:
        with pytest.raises(LinkError, match="no answer to site/state within 3 s"):
            asker.ask("site/state", timeout_s=3.0)

    world.run(live)


def test_a_killed_process_is_gone_and_another_one_takes_its_place():
    world = World()
    world.watch()
    told = []

    def live() -> None:
        for number in range(2):
            port = world.bus.port("mouth")
            port.declare_alive("site/mouth")
            port.at_death(lambda: told.append(world.time.now_ns()))
            if number == 0:
                port.kill_at(SECOND_NS)
                with pytest.raises(Killed):
                    port.wait(lambda: False, 10 * SECOND_NS)
                with pytest.raises(Killed):
                    port.put("site/words", b"from the grave")
                world.time.wait_ns(SECOND_NS)
            else:
                port.put("site/words", b"again")
                port.wait(lambda: False, 5 * SECOND_NS)

    world.run(live)
    assert told == [SECOND_NS]
    assert world.payloads == [b"again"]
    assert [alive for _, _, alive in world.alive] == [True, False, True]


@pytest.mark.parametrize(("moment", "heard"), [("sending", [b"1"]), ("sent", [b"1", b"2"])])
def test_killed_when_it_next_sends(moment, heard):
    world = World()
    port = world.bus.port("mouth")
    port.kill_at(SECOND_NS, moment)

    def live() -> None:
        port.put("site/words", b"1")
        port.wait(lambda: False, 2 * SECOND_NS)
        with pytest.raises(Killed):
            port.put("site/words", b"2")

    world.run(live)
    assert world.payloads == heard


@pytest.mark.parametrize(
    ("a", "b", "met"),
    [
        ("a/b", "a/b", True),
        ("a/b", "a/c", False),
        ("a/*", "a/b", True),
        ("a/*", "a/b/c", False),
        ("a/**", "a", True),
        ("a/**", "a/b/c", True),
        ("a/**/c", "a/*/c", True),
        ("a/*/c", "*/b/*", True),
        ("a/*/c", "*/b/d", False),
    ],
)
def test_keys_that_meet(a, b, met):
    assert meets(a, b) == meets(b, a) == met
