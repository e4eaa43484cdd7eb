"""kill -9 of the service or of the router, again and again, changes nothing."""

import os
import re
import signal
import threading
from pathlib import Path

import numpy as np

from fleet.running.run import Run, run_recording
from fleet.simulation.simulate import SURVEY_SIGMA_M, Simulated, simulate
from tagmap.store.check import check

KILLS = 10
PAUSE_S = (0.3, 1.5)


class Killer:
    """Learns the pids from what the run says and kills one of them now and then."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._pids: dict[str, int] = {}
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._kill)
        self.kills = 0

    def hear(self, line: str) -> None:
        for name, pid in re.findall(r"(router|service)(?: ended .*)? pid=(\d+)", line):
            self._pids[name] = int(pid)
        if len(self._pids) == 2 and self._thread.ident is None:
            self._thread.start()

    def stop(self) -> None:
        self._done.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _kill(self) -> None:
        while self.kills < KILLS and not self._done.wait(self._rng.uniform(*PAUSE_S)):
            pid = (
                self._pids.pop(str(self._rng.choice(sorted(self._pids))), None)
                if self._pids
                else None
            )
            if pid is not None:
                os.kill(pid, signal.SIGKILL)
                self.kills += 1


def run(simulated: Simulated, folder: Path, killer: Killer | None) -> Run:
    folder.mkdir()
    survey = folder / "survey.csv"
    rows = [f"{t},{p[0]},{p[1]},{p[2]},{SURVEY_SIGMA_M}" for t, p in simulated.survey.items()]
    survey.write_text("\n".join(["tag,x_m,y_m,z_m,sigma_m", *rows]))
    tell = killer.hear if killer else lambda _: None
    pace = ("--speed", "4") if killer else ()
    return run_recording(simulated.recording, folder, folder / "site.db", pace, survey, tell)


def test_ten_kills_lose_nothing_and_change_nothing(tmp_path: Path):
    simulated = simulate(seed=1, duration_s=60.0, rate_hz=3.0, start_ns=1_700_000_000_000_000_000)
    total = sum(len(robot.observations) for robot in simulated.recording.robots)
    calm = run(simulated, tmp_path / "calm", None)
    killer = Killer(seed=4)
    try:
        wild = run(simulated, tmp_path / "wild", killer)
    finally:
        killer.stop()
    assert killer.kills == KILLS
    for one in (calm, wild):
        assert (one.keyframes_sent, one.results.keyframes_stored) == (total, total)
        assert check(one.db) == []
    expected, tags = calm.results.estimate.tags, wild.results.estimate.tags
    assert tags.keys() == expected.keys() == simulated.hall.tags.keys()
    for name, tag in tags.items():
        np.testing.assert_allclose(tag.p, expected[name].p, atol=1e-6)
