"""Recorded journals as load: what robots measured, sent at another rate under other names."""

from collections.abc import Iterator
from pathlib import Path

from fleet.load.plan import Source
from tagmap.errors import DataError
from tagmap.records import Hello, Keyframe, Observation
from tagmap.records.journal import read_introduction, read_observations


class Recorded:
    """A journal of which a robot sends what it has not sent yet."""

    def __init__(self, journal: Path, hello: Hello) -> None:
        self.hello = hello
        self._observations = read_observations(journal)
        self._seq = 0

    def drive(self, count: int, rate_hz: float) -> Iterator[Keyframe]:  # noqa: ARG002
        """As they were measured, whatever the rate: fewer where the journal ends."""
        for _ in range(count):
            observation = next(self._observations, None)
            if observation is None:
                return
            self._seq += 1
            yield _numbered(observation, self.hello, self._seq)


def recorded(folder: Path, robots: int | None, site: str) -> list[Source]:
    """`robots` of them, the journals of `folder` dealt out in turn; by default one for each.

    DataError where there is none, one is no journal, or they are of different kinds.
    """
    journals = sorted(folder.glob("*.journal"))
    if not journals:
        raise DataError(f"{folder}: no *.journal in it")
    introductions = [read_introduction(journal) for journal in journals]
    first = introductions[0].kind
    for journal, introduction in zip(journals, introductions, strict=True):
        if introduction.kind != first:
            raise DataError(f"{journal}: {introduction.kind}, {journals[0].name} is {first}")
    sources: list[Source] = []
    for n in range(robots or len(journals)):
        introduction = introductions[n % len(journals)]
        fields = {name: getattr(introduction, name) for name in introduction.__struct_fields__}
        hello = Hello(
            **fields, site=site, robot=f"r{n + 1}", number=n + 1, session=f"session-{n + 1}"
        )
        sources.append(Recorded(journals[n % len(journals)], hello))
    return sources


def _numbered(observation: Observation, hello: Hello, seq: int) -> Keyframe:
    """The first of a session tells nothing of a step before it."""
    return Keyframe(
        site=hello.site,
        robot=hello.robot,
        session=hello.session,
        seq=seq,
        t_ns=observation.t_ns,
        odom=observation.odom if seq > 1 else None,
        T_base_cam=observation.T_base_cam,
        sightings=observation.sightings,
    )
