"""Supervision, with a real router and stand-ins for service and agents."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fleet.running.supervisor import ROUTER, SERVICE, SitePlan, Supervisor, playing
from tagmap.errors import TagmapError

SLEEP = "import time; time.sleep(60)"
SUMMARY = '{"robot": "r1", "keyframes": 3, "settled": 3, "refused": 0, "pending": 0}'
SAY_DONE = f"print({SUMMARY!r})"


@pytest.fixture
def said() -> list[str]:
    return []


@pytest.fixture
def supervise(tmp_path: Path, said: list[str]) -> Iterator[Callable[[str, str], Supervisor]]:
    """Start a site whose service and agent run the given Python code."""
    started: list[Supervisor] = []

    def start(service: str, agent: str) -> Supervisor:
        agents = [playing("r1", 1, tmp_path / "j")]
        plan = SitePlan("site", tmp_path, tmp_path / "site.db", agents)
        supervisor = Supervisor(plan, said.append)
        supervisor._service.command = [sys.executable, "-c", service]
        supervisor._agents["r1"].command = [sys.executable, "-c", agent]
        started.append(supervisor)
        supervisor.start()
        return supervisor

    yield start
    for supervisor in started:
        supervisor.stop()


def tend_until(supervisor: Supervisor, done: Callable[[], bool]) -> None:
    for _ in range(600):
        supervisor.tend()
        if done():
            return
        time.sleep(0.05)
    pytest.fail("it did not happen")


def test_pids_are_said_and_agents_finish(supervise, said: list[str]):
    supervisor = supervise(SLEEP, SAY_DONE)
    tend_until(supervisor, lambda: supervisor.finished)
    assert said[0] == f"router pid={supervisor._router.pid} service pid={supervisor._service.pid}"
    assert [s.keyframes for s in supervisor.summaries()] == [3]
    assert supervisor.restarts == 0


@pytest.mark.parametrize("victim", ["_router", "_service"])
def test_what_is_killed_is_started_again(supervise, said: list[str], victim: str):
    supervisor = supervise(SLEEP, SLEEP)
    killed = getattr(supervisor, victim).pid
    os.kill(killed, signal.SIGKILL)
    tend_until(supervisor, lambda: supervisor.restarts == 1)
    assert getattr(supervisor, victim).pid != killed
    assert f"{victim[1:]} ended with status -9" in said[-1]


def test_a_killed_agent_is_started_again(supervise, said: list[str]):
    supervisor = supervise(SLEEP, SLEEP)
    os.kill(supervisor._agents["r1"].pid, signal.SIGKILL)
    tend_until(supervisor, lambda: supervisor.restarts == 1)
    assert "agent r1 ended with status -9" in said[-1]


def test_who_is_killed_stays_down_for_as_long_as_was_said(supervise):
    supervisor = supervise(SLEEP, SLEEP)
    killed = {who: supervisor.pid(who) for who in (ROUTER, SERVICE, "r1")}
    for who in killed:
        supervisor.kill(who, 1e6)
    tend_until(supervisor, lambda: all(supervisor.pid(who) is None for who in killed))
    for _ in range(3):
        supervisor.tend()
    assert supervisor.restarts == 0
    for who in killed:
        supervisor.kill(who, 0.0)
    tend_until(supervisor, lambda: supervisor.restarts == 3)
    assert all(supervisor.pid(who) not in (None, pid) for who, pid in killed.items())


def test_who_goes_another_way_is_told_so(tmp_path: Path):
    plan = SitePlan(
        "site", tmp_path, tmp_path / "db", [playing("r1", 1, tmp_path)], via={"r1": "tcp/far:1"}
    )
    supervisor = Supervisor(plan, lambda _: None)
    assert "tcp/far:1" in supervisor._agents["r1"].command
    assert plan.endpoint in supervisor._service.command


def test_agents_that_do_not_end_are_given_up(supervise):
    end = "import signal, sys; signal.signal(signal.SIGTERM, lambda *_: sys.exit(print(DONE)));"
    supervisor = supervise(SLEEP, f"DONE = {SUMMARY!r}; {end} print(flush=True); {SLEEP}")
    out = supervisor._agents["r1"].out
    tend_until(supervisor, lambda: out.stat().st_size > 0)
    assert supervisor.summaries() == []
    assert supervisor.give_up() == ["r1"]
    assert [one.pending for one in supervisor.summaries()] == [0]


def test_a_service_that_cannot_start_is_an_error_with_its_reason(supervise):
    supervisor = supervise("import sys; sys.exit('tagmap: no way')", SLEEP)
    with pytest.raises(TagmapError, match="service failed: tagmap: no way"):
        tend_until(supervisor, lambda: False)


def test_an_agent_that_fails_is_an_error_with_its_reason(supervise):
    supervisor = supervise(SLEEP, "import sys; sys.exit('robot-agent: bad journal')")
    with pytest.raises(TagmapError, match="agent r1 failed: robot-agent: bad journal"):
        tend_until(supervisor, lambda: False)


def test_stopping_leaves_nobody(supervise):
    supervisor = supervise(SLEEP, SLEEP)
    pids = [supervisor._router.pid, supervisor._service.pid, supervisor._agents["r1"].pid]
    supervisor.stop()
    supervisor.stop()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)
