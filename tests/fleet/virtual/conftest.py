"""The demo's robots and a site, played in virtual time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fleet.replay.recording import Recording, write_journals
from fleet.simulation.simulate import SURVEY_SIGMA_M, simulate
from fleet.virtual.bus import Bus
from fleet.virtual.operator import Operator
from fleet.virtual.player import Part, Player
from fleet.virtual.site import Kill, VirtualSite
from fleet.virtual.virtual_time import VirtualTime
from fleet.virtual.weather import CALM, Weather
from tagmap.mapping.surveying import SurveyedPosition
from tagmap.store import SiteStore
from tagmap.store.check import check

START_NS = 1_770_000_000 * 10**9
SECOND_NS = 10**9
RECORDED_S = 40.0
SPEED = 8.0


def after_s(seconds: float) -> int:
    return START_NS + round(seconds * SECOND_NS)


@dataclass(frozen=True)
class Played:
    """`db` after a run; `ended_s`: in virtual time."""

    db: Path
    players: Sequence[Player]
    site: VirtualSite
    ended_s: float

    def facts(self) -> dict[tuple[str, int], bytes]:
        """By robot and time: what was seen, whatever its session."""
        with SiteStore.open(self.db, read_only=True) as store:
            frames = [keyframe for _, keyframe in store.keyframes()]
        found = {(k.robot, k.t_ns): repr((k.T_base_cam, k.sightings)).encode() for k in frames}
        assert len(found) == len(frames)
        return found

    def contents(self) -> object:
        """All that the database says."""
        with SiteStore.open(self.db, read_only=True) as store:
            return repr(
                (
                    list(store.keyframes()),
                    store.sessions(),
                    store.surveys(),
                    store.versions(),
                    [store.summary(version.version) for version in store.versions()],
                    [store.tags(version.version) for version in store.versions()],
                    [
                        (p.robot, p.session, p.seqs.tobytes(), p.T.tobytes(), p.t_ns.tobytes())
                        for p in store.poses()
                    ],
                )
            )

    def tags(self) -> dict[str, tuple[float, ...]]:
        with SiteStore.open(self.db, read_only=True) as store:
            return {tag.tag: tag.p_m for tag in store.tags() if tag.p_m is not None}

    def expect_whole(self, recording: Recording) -> None:
        """Every keyframe is stored once and settled, and nothing was refused."""
        sent = {(r.robot, o.t_ns) for r in recording.robots for o in r.observations}
        assert self.facts().keys() == sent
        for player in self.players:
            assert player.summary is not None
            assert (player.summary.refused, player.summary.pending) == (0, 0)
        assert check(self.db) == []


@pytest.fixture(scope="session")
def simulated(compiled_solver):  # noqa: ARG001
    return simulate(1, RECORDED_S, 4.0, START_NS)


@pytest.fixture(scope="session")
def recording(simulated) -> Recording:
    return simulated.recording


@pytest.fixture(scope="session")
def surveys(simulated) -> list[SurveyedPosition]:
    return [
        SurveyedPosition(tag, (p[0], p[1], p[2]), SURVEY_SIGMA_M)
        for tag, p in ((tag, np.asarray(p).tolist()) for tag, p in simulated.survey.items())
    ]


@pytest.fixture(scope="session")
def play(tmp_path_factory, recording, surveys) -> Callable[..., Played]:
    """`play(seed=, weather=, of=, kills=, ...)`: until all is settled and solved once more."""

    def run(
        seed: int = 1,
        weather: Weather = CALM,
        of: dict[str, Weather] | None = None,
        robot_kills: dict[str, tuple[Kill, ...]] | None = None,
        cuts: Sequence[tuple[str, int, int]] = (),
        solve: bool = True,
        **options,
    ) -> Played:
        folder = tmp_path_factory.mktemp("site")
        journals = write_journals(recording, folder)
        time = VirtualTime(START_NS)
        bus = Bus(time, seed, weather, of)
        for cut in cuts:
            bus.cut(*cut)
        site = VirtualSite(folder, time, bus, surveys=surveys, **options)
        kills = robot_kills or {}
        parts = [
            Part(r.robot, r.number, journals[r.robot], SPEED, kills.get(r.robot, ()))
            for r in recording.robots
        ]
        players = [Player(part, folder, time, bus, seed) for part in parts]

        def operate() -> None:
            while any(player.summary is None for player in players):
                time.wait_ns(SECOND_NS // 10)
            if solve:
                Operator(bus, site.keys).solve_finally()

        site.run([*(player.live for player in players), operate])
        return Played(site.db, players, site, (time.now_ns() - START_NS) / 1e9)

    return run
