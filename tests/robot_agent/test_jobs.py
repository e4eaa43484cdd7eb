"""Jobs: one for each tag, carried out once, answered again, and answered when they are over."""

from robot_agent.jobs import MOST_ANSWERED, Jobs
from tagmap.records import JobResult, WriteJob

SECOND_NS = 1_000_000_000


def job(number=1, tag="a", valid_s=10.0):
    return WriteJob(job=number, tag=tag, record=b"r", valid_s=valid_s)


def written(number=1, tag="a"):
    return JobResult(robot="r1", job=number, tag=tag, outcome="written", read=b"r")


def test_a_job_waits_for_its_tag_and_is_answered():
    jobs = Jobs("r1")
    assert jobs.hear([job(), job(2, "b")], 0) == []
    assert jobs.open == {"a": job(), "b": job(2, "b")}
    jobs.answer(written())
    assert set(jobs.open) == {"b"}


def test_an_answer_that_was_lost_is_given_again_without_light():
    jobs = Jobs("r1")
    jobs.hear([job()], 0)
    jobs.answer(written())
    assert jobs.hear([job()], 3600 * SECOND_NS) == [written()]
    assert jobs.open == {}
    assert jobs.hear([job(5)], 3600 * SECOND_NS) == []
    assert jobs.open == {"a": job(5)}


def test_a_job_whose_time_is_over_is_expired_and_said_so_once():
    jobs = Jobs("r1")
    jobs.hear([job()], 0)
    assert jobs.hear([], 9 * SECOND_NS) == []
    [result] = jobs.hear([], 10 * SECOND_NS)
    assert (result.robot, result.job, result.outcome, result.read) == ("r1", 1, "expired", None)
    assert "in time" in result.reason
    assert jobs.open == {}
    assert jobs.hear([], 11 * SECOND_NS) == []


def test_the_same_job_again_does_not_prolong_a_newer_one():
    jobs = Jobs("r1")
    jobs.hear([job(1)], 0)
    jobs.hear([job(2, valid_s=5.0)], SECOND_NS)
    assert jobs.open == {"a": job(2, valid_s=5.0)}
    [result] = jobs.hear([], 6 * SECOND_NS)
    assert result.job == 2


def test_any_validity_that_comes_over_the_wire():
    jobs = Jobs("r1")
    [result] = jobs.hear([job(1, "a", 1e12), job(2, "b", 1e-12)], SECOND_NS)
    assert (result.tag, result.outcome) == ("b", "expired")
    assert jobs.hear([], 3600 * SECOND_NS) == []


def test_answers_are_not_kept_for_ever():
    jobs = Jobs("r1")
    for k in range(MOST_ANSWERED + 10):
        jobs.hear([job(k + 1, f"t{k}")], 0)
        jobs.answer(written(k + 1, f"t{k}"))
    assert jobs.hear([job(1, "t0")], 0) == []
    assert jobs.hear([job(11, "t10")], 0) == [written(11, "t10")]
