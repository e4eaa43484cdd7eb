"""Write-back jobs of one robot: what waits for its tag, and what is answered without any light."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from tagmap.records import JobResult, WriteJob

MOST_ANSWERED = 1024


@dataclass(slots=True)
class Jobs:
    """One for each tag. `now_ns`: of a clock that never jumps."""

    robot: str
    _open: dict[str, tuple[WriteJob, int]] = field(default_factory=dict)
    _answered: dict[str, JobResult] = field(default_factory=dict)

    @property
    def open(self) -> Mapping[str, WriteJob]:
        """By tag."""
        return {tag: job for tag, (job, _) in self._open.items()}

    def hear(self, jobs: Iterable[WriteJob], now_ns: int) -> list[JobResult]:
        """What comes in; the answers to jobs that come again, and to those whose time is over."""
        again = [result for job in jobs if (result := self._take(job, now_ns))]
        over = [job for job, until_ns in self._open.values() if until_ns <= now_ns]
        expired = [self._expired(job) for job in over]
        for result in expired:
            self.answer(result)
        return again + expired

    def answer(self, result: JobResult) -> None:
        """It was carried out, or cannot be."""
        self._open.pop(result.tag, None)
        self._answered.pop(result.tag, None)
        self._answered[result.tag] = result
        if len(self._answered) > MOST_ANSWERED:
            del self._answered[next(iter(self._answered))]

    def _take(self, job: WriteJob, now_ns: int) -> JobResult | None:
        """An answer may have been lost, so one is given again: a job is carried out once."""
        before = self._answered.get(job.tag)
        if before is not None and before.job == job.job:
            return before
        self._open[job.tag] = job, now_ns + round(1e9 * job.valid_s)
        return None

    def _expired(self, job: WriteJob) -> JobResult:
        reason = "the tag was not in view, or could not be lit, in time"
        return JobResult(
            robot=self.robot, job=job.job, tag=job.tag, outcome="expired", read=None, reason=reason
        )
