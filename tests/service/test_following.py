"""The real service with keyframes that are condensed: what it knows survives being killed."""

import os
import signal

from tagmap.store import SiteStore
from tagmap.store.check import check
from tests.mapping.messages import hello
from tests.mapping.world import drive
from tests.service.conftest import Client
from tests.service.test_serve import children_of, command_of

LOT = 100


def deliver(client, first, last):
    for seq in range(first, last + 1, LOT):
        client.deliver(hello(), *(drive(seq) for seq in range(seq, min(seq + LOT, last + 1))))
        summary = client.admin("map", "solve")["summary"]
    return summary


def condensed_of(serve):
    with SiteStore.open(serve.folder / "site.db", read_only=True) as store:
        return store.condensed(), sum(
            last - first + 1 for *_, first, last in store.condensed().covered
        )


def solver_of(serve):
    """None until there is another one."""
    pids = map(int, children_of(serve.process.pid))
    return next((pid for pid in pids if "worker" in command_of(pid)), None)


def test_a_killed_service_goes_on_from_what_was_condensed(serve, client, eventually):
    assert deliver(client, 1, 600)["keyframes"] == 600
    before, covered = condensed_of(serve)
    assert covered >= 300
    serve.kill()
    serve.start()
    assert deliver(client, 601, 650)["keyframes"] == 650
    after, _ = condensed_of(serve)
    assert after.serial == before.serial
    os.kill(solver_of(serve), signal.SIGKILL)
    eventually(lambda: solver_of(serve) is None)
    assert deliver(client, 651, 900)["keyframes"] == 900
    assert condensed_of(serve)[1] > covered
    assert serve.stop() == 0
    assert check(serve.folder / "site.db") == []
    with SiteStore.open(serve.folder / "site.db", read_only=True) as store:
        assert sum(len(poses.seqs) for poses in store.poses()) == 900


def test_everything_can_be_solved_again(client):
    deliver(client, 1, 400)
    first = client.admin("map", "solve")
    again = client.admin("map", "solve", from_nothing=True)
    assert again["version"] == first["version"] + 1
    assert again["cause"] == "solved from nothing"
    assert client.admin("map", "solve")["version"] == again["version"]


def test_old_keyframes_leave_and_are_not_taken_again(serve, eventually):
    keep = ("--keep-keyframes", "350", "--keep-versions", "3")
    client = Client(serve.start(*keep).endpoint)
    deliver(client, 1, 700)
    eventually(lambda: client.admin("site", "status")["archived"] == 350)
    versions = client.admin("map", "versions")["versions"]
    (reply,) = client.ask(f"{client.keys.map_tags()}?version=1")
    assert "not kept" in reply.error
    serve.kill()
    serve.start(*keep)
    assert client.deliver(hello(), *(drive(seq) for seq in range(1, 100))).contiguous == 700
    assert deliver(client, 701, 750)["keyframes"] == 750
    status = client.admin("site", "status")
    assert status["keyframes"] == 750
    assert status["condensed"] >= status["archived"] >= 350
    assert status["map_version"] == versions[-1]["version"] + 1
    client.link.close()
    assert serve.stop() == 0
    assert check(serve.folder / "site.db") == []
