"""Odometry that comes in datagrams, see datagram.py. A thread listens."""

import copy
import re
import socket
import threading
import time
from collections.abc import Callable
from typing import Annotated, TypeAlias

import msgspec
from msgspec import Meta

from robot_agent.odometry.datagram import BYTES
from robot_agent.odometry.hearing import NS, Counts, Hearing
from robot_agent.odometry.odometry import Failure, Odometer, OdometerInfo, OdomPose, Reason
from robot_agent.odometry.still import Still, StillRules
from robot_agent.odometry.track import OdometryTrack, Speeds

LOOK_S = 0.05
PAUSE_S = 0.25
"""After it could not listen."""
PROBE_S, MEASURED_S = 2.0, 0.5
"""How long a probe listens for a rate, and over how long at least that is one."""

Speed: TypeAlias = Annotated[float, Meta(gt=0.0, le=100.0)]
Small: TypeAlias = Annotated[float, Meta(gt=0.0, le=1.0)]
Seconds: TypeAlias = Annotated[float, Meta(ge=0.02, le=60.0)]


class UdpConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """`sender`: the address that alone is believed. `most_*`: what the robot cannot exceed, see
    track.Speeds. `still_*`: when it stands, see still.StillRules. A reading that is older than
    `stale_s` says nothing of now."""

    listen: str = "127.0.0.1:5086"
    sender: str | None = None
    most_m_s: Speed = 5.0
    most_rad_s: Speed = 10.0
    still_m: Small = 0.002
    still_rad: Small = 0.002
    still_s: Seconds = 0.2
    stale_s: Seconds = 0.3

    def __post_init__(self) -> None:
        self.address()

    def address(self) -> tuple[str, int]:
        found = re.fullmatch(r"(.+):(\d{1,5})", self.listen)
        if not found or int(found[2]) > 65535:
            raise ValueError(f"listen is {self.listen!r}, expected HOST:PORT")
        return found[1], int(found[2])


class UdpOdometer(Odometer):
    """Listens from now on until it is closed; where it cannot, it tries again and again."""

    def __init__(self, config: UdpConfig) -> None:
        self._config = config
        self._hearing = Hearing(
            OdometryTrack(Speeds(config.most_m_s, config.most_rad_s)),
            Still(StillRules(config.still_m, config.still_rad, config.still_s)),
            config.stale_s,
            config.sender,
            time.monotonic_ns(),
        )
        self._callbacks: list[Callable[[], None]] = []
        self._deaf: str | None = None
        self._fault: str | None = None
        self._news = threading.Condition()
        self._stopping = threading.Event()
        self._socket = self._bound()
        self._thread = threading.Thread(target=self._work, name="odometry", daemon=True)
        self._thread.start()

    @property
    def address(self) -> tuple[str, int] | None:
        """Where it listens; None while it does not."""
        with self._news:
            return None if self._socket is None else self._socket.getsockname()

    @property
    def counts(self) -> Counts:
        """Up to now."""
        with self._news:
            return copy.copy(self._hearing.counts)

    @property
    def failure(self) -> Failure | None:
        with self._news:
            return self._failure()

    def probe(self) -> OdometerInfo | Failure:
        with self._news:
            is_over = self._stopping.is_set
            self._news.wait_for(lambda: is_over() or self._hearing.rate_hz(MEASURED_S), PROBE_S)
            failure, rate_hz = self._failure(), self._hearing.rate_hz(0.0)
            if failure is not None:
                return failure
            if rate_hz is None:
                return self._failed("silent", f"no second reading within {PROBE_S:g} s")
            utc_ns = time.time_ns()
            return OdometerInfo(
                f"datagrams at {self._config.listen}",
                rate_hz,
                (utc_ns - self._hearing.latest_ns) * NS,
                self._hearing.still_since_ns(time.monotonic_ns(), utc_ns),
            )

    def at(self, t_ns: int, wait_s: float = 0.0) -> OdomPose | None:
        with self._news:
            track = self._hearing.track
            self._news.wait_for(lambda: self._unheard() or track.reaches(t_ns), wait_s)
            return track.at(t_ns)

    def still_since_ns(self, now_ns: int) -> int | None:
        with self._news:
            return self._hearing.still_since_ns(time.monotonic_ns(), now_ns)

    def on_motion(self, callback: Callable[[], None]) -> None:
        with self._news:
            self._callbacks.append(callback)

    def close(self) -> None:
        self._stopping.set()
        if threading.current_thread() is not self._thread:
            self._thread.join()

    def _failure(self) -> Failure | None:
        if self._fault is not None:
            return self._failed("fault", self._fault)
        return self._unheard()

    def _unheard(self) -> Failure | None:
        """Why there are no readings to trust."""
        if self._deaf is not None:
            return self._failed("not_listening", self._deaf)
        wrong = self._hearing.wrong(time.monotonic_ns())
        return None if wrong is None else self._failed(*wrong)

    def _failed(self, reason: Reason, why: str) -> Failure:
        return Failure(reason, f"odometry at {self._config.listen}: {why}")

    def _bound(self) -> socket.socket | None:
        """Bind, and note why not."""
        line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            line.bind(self._config.address())
        except (OSError, ValueError) as error:
            line.close()
            self._deaf = f"cannot listen: {getattr(error, 'strerror', None) or error}"
            return None
        line.settimeout(LOOK_S)
        self._deaf = None
        return line

    def _work(self) -> None:
        while not self._stopping.is_set():
            received = self._received()
            with self._news:
                now_ns = time.monotonic_ns()
                if received is None:
                    is_over = self._hearing.miss(now_ns)
                else:
                    is_over = self._hearing.hear(*received, now_ns, time.time_ns())
                self._news.notify_all()
            self._tell(is_over)
        with self._news:
            self._shut("it was closed")
            is_over = self._hearing.still.forget()
        self._tell(is_over)

    def _received(self) -> tuple[bytes, str] | None:
        """A datagram and its sender; None: there was none for a moment."""
        if self._socket is None:
            self._stopping.wait(PAUSE_S)
            with self._news:
                self._socket = self._bound()
            return None
        try:
            data, (sender, _) = self._socket.recvfrom(BYTES + 1)
        except TimeoutError:
            return None
        except OSError as error:
            with self._news:
                self._shut(error.strerror or str(error))
            return None
        return data, sender

    def _shut(self, why: str) -> None:
        if self._socket is not None:
            self._socket.close()
        self._socket, self._deaf = None, why
        self._news.notify_all()

    def _tell(self, is_over: bool) -> None:
        """A callback with a fault must not end the listening, and must not be unheard."""
        for callback in tuple(self._callbacks) if is_over else ():
            try:
                callback()
            except Exception as error:
                why = f"what was to be called on motion failed: {type(error).__name__}: {error}"
                with self._news:
                    self._fault = why
