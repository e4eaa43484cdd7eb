"""Cameras that another process serves over TCP, in the frames of frames.py."""

import time
from typing import Annotated

import msgspec
from msgspec import Meta

from robot_agent.cameras.camera import (
    CameraInfo,
    Failure,
    Reason,
    Size,
    StereoCamera,
    StereoPair,
    size_of,
)
from robot_agent.cameras.connection import Connection, Lost

PROBE_S = 2.0
CONNECT_LEAST_S = 0.05
ANSWER_S = 0.02
"""So much earlier a server is to answer that there is nothing new."""
PAUSE_S = 0.02
"""Before it is tried or asked again, within the time of one call."""
LONGEST_WAIT_S = 60.0


class NetworkConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the server listens."""

    host: str
    port: Annotated[int, Meta(ge=1, le=65535)] = 5087


class NetworkCamera(StereoCamera):
    """Connects when it is first needed and again, within the time of the call, when the connection
    was lost."""

    def __init__(self, config: NetworkConfig, expected: tuple[Size, Size] | None = None) -> None:
        self._config = config
        self._expected = expected
        self._connection: Connection | None = None
        self._latest_ns: int | None = None

    def probe(self) -> CameraInfo | Failure:
        pair = self._next(PROBE_S)
        if isinstance(pair, Failure):
            return pair
        return CameraInfo(f"network {self._name()}", size_of(pair.left), size_of(pair.right))

    def grab(self, timeout_s: float) -> StereoPair | Failure:
        found = self._next(timeout_s)
        if isinstance(found, StereoPair):
            self._latest_ns = found.t_ns
        return found

    def close(self) -> None:
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    def _next(self, timeout_s: float) -> StereoPair | Failure:
        """A pair that was asked for in an earlier call may have waited since: it counts only if
        there is none that is newer."""
        deadline_s = time.monotonic() + timeout_s
        failure = stalled = self._failed("stalled", f"no new pair within {timeout_s:g} s")
        waited: StereoPair | None = None
        while True:
            was_asked = self._connection is not None and self._connection.is_asked
            try:
                found = self._answer(deadline_s, waited)
            except TimeoutError:
                return waited or failure
            except Lost as lost:
                self.close()
                failure = self._failed(lost.reason, str(lost))
                if waited is not None or lost.reason != "camera_gone":
                    return waited or failure
            else:
                if isinstance(found, Failure):
                    return waited or self._failed(found.reason, found.detail)
                if found is not None and was_asked:
                    waited = found
                    continue
                if newest := found or waited:
                    return newest
                failure = stalled
            if time.monotonic() + PAUSE_S > deadline_s:
                return failure
            time.sleep(PAUSE_S)

    def _answer(self, deadline_s: float, waited: StereoPair | None) -> StereoPair | Failure | None:
        """To the question that is open, or to a new one. Raises Lost, TimeoutError."""
        left_s = deadline_s - time.monotonic()
        if self._connection is None:
            patience_s = max(left_s, CONNECT_LEAST_S)
            self._connection = Connection(self._config.host, self._config.port, patience_s)
        connection = self._connection
        if not connection.is_asked:
            latest_ns = self._latest_ns if waited is None else waited.t_ns
            wait_s = 0.0 if waited is not None else min(max(0.0, left_s - ANSWER_S), LONGEST_WAIT_S)
            connection.ask(None if connection.is_fresh else latest_ns, wait_s)
        found = connection.answer(deadline_s, self._expected)
        if isinstance(found, StereoPair) and found.t_ns == self._latest_ns:
            return None
        return found

    def _failed(self, reason: Reason, why: str) -> Failure:
        return Failure(reason, f"camera {self._name()}: {why}")

    def _name(self) -> str:
        return f"{self._config.host}:{self._config.port}"
