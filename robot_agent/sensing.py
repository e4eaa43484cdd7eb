"""The cycle in a thread of its own, and where everything that it says goes."""

import time
from collections.abc import Callable
from typing import Any, Self

import structlog

from robot_agent.agent import Report
from robot_agent.background import Background
from robot_agent.cameras.camera import Failure
from robot_agent.robot import Robot
from robot_agent.sources.sensors import SensorSource
from robot_agent.uplink import Uplink

LOOK_S = 1.0
PAUSE_S = 0.2
"""After an exposure that failed at once."""
HANGS_S = 120.0
"""No cycle takes so long, whatever fails in it."""
END_S = 15.0
"""How long a cycle that is under way may take to its end when the robot is to stop."""


class Sensing(Background):
    """`with Sensing(...)`: exposures become observations of `source`; poses and results of jobs go
    to `uplink`. A fault of the cycle ends it, see `fault`, and is told to `on_fault`: a robot that
    sees nothing more must not seem to live."""

    def __init__(
        self,
        robot: Robot,
        source: SensorSource,
        uplink: Uplink,
        name: str,
        on_fault: Callable[[], None] = lambda: None,
    ) -> None:
        self._robot, self._source, self._uplink = robot, source, uplink
        self._log: Any = structlog.get_logger().bind(robot=name)
        self._state = ""
        self._map: tuple[str | None, int] = (None, 0)
        self._on_fault = on_fault
        self._began_s = time.monotonic()
        self._dropped = 0
        self.fault: Exception | None = None
        self._watch = Background("sensing-watch", self._look_after)
        super().__init__("sensing", self._run)

    def __enter__(self) -> Self:
        self._began_s = time.monotonic()
        self._watch.__enter__()
        return super().__enter__()

    def __exit__(self, *_: object) -> None:
        self._stopping.set()
        self._thread.join(END_S)
        if self._thread.is_alive():
            self._fail(TimeoutError(f"it does not end within {END_S:g} s"))
        self._watch.__exit__()

    def _run(self) -> None:
        try:
            while not self._stopping.is_set() and not self._is_over():
                began_s = self._began_s = time.monotonic()
                report = self._robot.cycle()
                if report is not None:
                    self._tell(report)
                elif time.monotonic() - began_s < PAUSE_S:
                    self._stopping.wait(PAUSE_S)
        except Exception as error:
            self._fail(error)
        self._source.end()

    def _look_after(self) -> None:
        while self.fault is None and not self._stopping.wait(LOOK_S):
            since_s = time.monotonic() - self._began_s
            if self._thread.is_alive() and since_s > HANGS_S:
                self._fail(TimeoutError(f"it has been under way for {since_s:.0f} s"))

    def _fail(self, error: Exception) -> None:
        self._log.error("the cycle failed", exc_info=error)
        self.fault = self.fault or error
        self._on_fault()

    def _is_over(self) -> bool:
        """The recording that was played is at its end."""
        failure = self._robot.failure
        return isinstance(failure, Failure) and failure.reason == "ended"

    def _tell(self, report: Report) -> None:
        if report.observation is not None:
            self._source.put(report.observation)
            self._tell_dropped()
        self._uplink.publish_pose(report.pose)
        for result in report.results:
            self._uplink.publish_result(result)
        self._log_shots(report)
        if report.pose.state != self._state:
            self._state = report.pose.state
            self._log.info("pose", state=self._state, gauge=report.pose.gauge)
        chart = report.chart
        if chart is not None and (chart.origin, len(chart)) != self._map:
            self._map = chart.origin, len(chart)
            self._log.info("map", origin=chart.origin, tags=len(chart))
            if chart.left_out:
                tag, why = next(iter(chart.left_out.items()))
                left_out = len(chart.left_out)
                self._log.warning("tags of the map left out", count=left_out, tag=tag, reason=why)

    def _tell_dropped(self) -> None:
        """Each time that there are twice as many."""
        if self._source.dropped >= max(1, 2 * self._dropped):
            self._dropped = self._source.dropped
            self._log.error("keyframes dropped: they cannot be kept", count=self._dropped)

    def _log_shots(self, report: Report) -> None:
        for outcome in report.outcomes:
            verdict = outcome.verdict
            self._log.info(
                f"shot {verdict.kind}",
                t_ns=report.pose.t_ns,
                tag=verdict.tag,
                shots=verdict.shots,
                reason=verdict.reason,
                lease=outcome.lease,
            )
        for result in report.results:
            self._log.info("job", tag=result.tag, outcome=result.outcome, reason=result.reason)
