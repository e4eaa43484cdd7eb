"""The cycle in a thread of its own, and where everything that it says goes."""

import time
from typing import Any

import structlog

from robot_agent.agent import Report
from robot_agent.background import Background
from robot_agent.cameras.camera import Failure
from robot_agent.robot import Robot
from robot_agent.sources.sensors import SensorSource
from robot_agent.uplink import Uplink

PAUSE_S = 0.2
"""After an exposure that failed at once."""


class Sensing(Background):
    """`with Sensing(...)`: exposures become observations of `source`; poses and results of jobs go
    to `uplink`. A fault of the cycle ends it: see `fault`."""

    def __init__(self, robot: Robot, source: SensorSource, uplink: Uplink, name: str) -> None:
        self._robot, self._source, self._uplink = robot, source, uplink
        self._log: Any = structlog.get_logger().bind(robot=name)
        self._state = ""
        self._map: tuple[str | None, int] = (None, 0)
        self.fault: Exception | None = None
        super().__init__("sensing", self._run)

    def _run(self) -> None:
        try:
            while not self._stopping.is_set() and not self._is_over():
                began_s = time.monotonic()
                report = self._robot.cycle()
                if report is not None:
                    self._tell(report)
                elif time.monotonic() - began_s < PAUSE_S:
                    self._stopping.wait(PAUSE_S)
        except Exception as error:
            self._log.exception("the cycle failed")
            self.fault = error
        self._source.end()

    def _is_over(self) -> bool:
        """The recording that was played is at its end."""
        failure = self._robot.failure
        return isinstance(failure, Failure) and failure.reason == "ended"

    def _tell(self, report: Report) -> None:
        if report.observation is not None:
            self._source.put(report.observation)
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
