"""What a robot fetches from the service, or is sent: the map, and jobs. A thread keeps asking."""

import time
from collections import deque
from collections.abc import Callable
from threading import Event, Thread

from msgspec.structs import replace

from robot_agent.atlas.served import ServedMap, tags_of
from tagmap.errors import RecordRefused
from tagmap.link.keys import Keys
from tagmap.link.session import Link
from tagmap.records import MapVersion, WriteJob, decode

ANSWER_S, MAP_S = 1.0, 10.0
"""How long an answer may take; the tags of a large site over a slow line."""
MAP_AGAIN_S = 10.0
"""How often to ask for a map of which nothing is heard."""
PAUSE_S = 0.25
"""From one time to the next, however many maps are announced."""
MOST_JOBS = 256
LEAST_VALID_S = 1e-3


class Errands:
    """Nothing that arrives ends the thread, and nothing piles up while nobody takes it: only the
    newest map is kept, and so many jobs. `trouble`: why the map that was fetched last is none."""

    def __init__(
        self, keys: Keys, robot: str, clock_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._keys, self._robot, self._clock_s = keys, robot, clock_s
        self._jobs: deque[tuple[WriteJob, float]] = deque(maxlen=MOST_JOBS)
        self._served: deque[ServedMap] = deque(maxlen=1)
        self._known: MapVersion | None = None
        self._wanted, self._closing = Event(), Event()
        self._thread = Thread(target=self._run, name="errands", daemon=True)
        self._link: Link | None = None
        self.trouble: str | None = None
        self.malformed = 0

    def begin(self, link: Link) -> None:
        self._link = link
        link.subscribe(self._keys.jobs(self._robot), lambda _, payload: self.take_job(payload))
        link.subscribe(self._keys.map_version(), lambda *_: self._wanted.set())
        self._wanted.set()
        self._thread.start()

    def end(self, patience_s: float) -> None:
        self._closing.set()
        self._wanted.set()
        if self._thread.is_alive():
            self._thread.join(patience_s)

    def jobs(self) -> list[WriteJob]:
        """Those that came since they were last asked for, valid for what is left of their time."""
        jobs: list[WriteJob] = []
        while self._jobs:
            job, came_s = self._jobs.popleft()
            left_s = job.valid_s - (self._clock_s() - came_s)
            jobs.append(replace(job, valid_s=max(left_s, LEAST_VALID_S)))
        return jobs

    def served(self) -> ServedMap | None:
        """The newest map that came since it was last asked for."""
        return self._served.popleft() if self._served else None

    def take_job(self, payload: bytes) -> None:
        try:
            self._jobs.append((decode(WriteJob, payload), self._clock_s()))
        except RecordRefused:
            self.malformed += 1

    def _run(self) -> None:
        """At first, whenever a map is announced, and now and then for what was lost on its way."""
        while not self._closing.is_set():
            self._wanted.wait(MAP_AGAIN_S)
            self._wanted.clear()
            try:
                self._fetch()
                self.trouble = None
            except Exception as error:
                self.trouble = " ".join(str(error).split()) or type(error).__name__
            self._closing.wait(PAUSE_S)

    def _fetch(self) -> None:
        job = self._answer(self._keys.jobs(self._robot), ANSWER_S)
        if job is not None:
            self.take_job(job)
        version = self._answer(self._keys.map_version(), ANSWER_S)
        if version is None:
            return
        about = decode(MapVersion, version)
        if about != self._known:
            self._fetch_tags(about)

    def _fetch_tags(self, about: MapVersion) -> None:
        payload = self._answer(self._keys.map_tags(), MAP_S)
        if payload is None:
            return
        tags = tags_of(payload)
        if any(tag.version != about.version for tag in tags):
            # Another version came in between.
            self._wanted.set()
            return
        self._known = about
        self._served.append(ServedMap(site=self._keys.site, version=about, tags=tags))

    def _answer(self, key: str, timeout_s: float) -> bytes | None:
        if self._link is None or self._closing.is_set():
            return None
        replies = self._link.get(key, timeout_s=timeout_s)
        return next((reply.payload for reply in replies if reply.payload is not None), None)
