"""At a tag that is lit and known: read its memory, and write where a job says so."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from robot_agent.activation.commands import Act, Denied, Light, Read, Write
from robot_agent.activation.rules import ShotRules
from robot_agent.rfid.reader import Failure, UserWords
from tagmap.errors import RecordRefused
from tagmap.memory.writing import WritePlan, compare, plan_write
from tagmap.records.job import JobResult, WriteJob


@dataclass(frozen=True, slots=True)
class Work:
    """Who writes: robot, number of the site, its key; and `jobs` by tag."""

    robot: str
    site: int | None = None
    key: bytes | None = None
    jobs: Mapping[str, WriteJob] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Done:
    """`memory` as it was read last. `trouble`: why something of it was not done."""

    memory: bytes | None = None
    result: JobResult | None = None
    trouble: str | None = None


def at_the_tag(rules: ShotRules, tag: str, work: Work) -> Act[Done]:
    """In the light, which each part prolongs for itself."""
    job = work.jobs.get(tag)
    if job is None and not rules.memory_s:
        return Done()
    memory = yield from _read(rules, tag)
    if job is None:
        return Done(memory) if isinstance(memory, bytes) else Done(trouble=memory)
    return (yield from _carry_out(rules, job, work, memory))


def _carry_out(rules: ShotRules, job: WriteJob, work: Work, memory: bytes | str) -> Act[Done]:
    """Read before writing, and write nothing that is there already: a job may come twice."""
    if isinstance(memory, str):
        return Done(None, _result(work, job, None, memory), memory)
    try:
        plan = plan_write(memory, job.record, job.tag, work.key, work.site)
    except RecordRefused as refusal:
        return Done(memory, _result(work, job, memory, refusal.reason))
    if plan is None:
        return Done(memory, _result(work, job, memory, None))
    trouble = yield from _write(rules, job, plan)
    after = yield from _read(rules, job.tag)
    if isinstance(after, str):
        return Done(None, _result(work, job, None, trouble or after), trouble or after)
    # What is there counts, not what was said about writing it.
    why = compare(plan, after)
    return Done(after, _result(work, job, after, why and (trouble or why)))


def _result(work: Work, job: WriteJob, read: bytes | None, why: str | None) -> JobResult:
    return JobResult(
        robot=work.robot,
        job=job.job,
        tag=job.tag,
        outcome="failed" if why else "written",
        read=read,
        reason=why,
    )


def _read(rules: ShotRules, tag: str) -> Act[bytes | str]:
    """The whole user memory, or why not."""
    timeout_s = rules.memory_s or rules.window_s
    reply = yield Light(timeout_s + rules.margin_s)
    if isinstance(reply.value, Denied):
        return reply.value.why
    reply = yield Read(tag, timeout_s)
    if isinstance(reply.value, UserWords):
        return b"".join(word.to_bytes(2, "big") for word in reply.value.words)
    return reply.value.detail if isinstance(reply.value, Failure) else "not read"


def _write(rules: ShotRules, job: WriteJob, plan: WritePlan) -> Act[str | None]:
    reply = yield Light(rules.write_s + rules.margin_s)
    if isinstance(reply.value, Denied):
        return reply.value.why
    reply = yield Write(job.tag, plan.first_word, plan.words, rules.write_s)
    return reply.value.detail if isinstance(reply.value, Failure) else None
