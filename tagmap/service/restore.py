"""A mapper as the database knows it: at the start, and after a commit that failed."""

from typing import Any

import msgspec

from tagmap.mapper import Mapper
from tagmap.mapping.live import Known
from tagmap.mapping.session import MAX_RECENT, MAX_REFUSALS, SessionIndex
from tagmap.mapping.surveying import Source, SurveyedPosition, Surveys
from tagmap.store import SessionRow, SiteStore, Survey


class _Found(msgspec.Struct, frozen=True):
    """A calibration unknown as the summary of a version has it."""

    name: str
    robot: str | None
    value: float
    sigma: float
    prior_sigma: float


def restore(store: SiteStore) -> Mapper:
    mapper = Mapper(store.site)
    version = store.latest_version()
    summary: dict[str, Any] = {}
    if version is not None:
        summary = store.summary(version.version) or {}
        scales = summary.get("scale"), summary.get("stereo_scale")
        found = [_Found(**one) for one in summary.get("calibration", ())]
        mapper.book.restore(version, store.tags(), *scales, found)
    mapper.surveys = _surveys(store)
    rows = store.sessions()
    for row in rows:
        mapper.ingest.restore(_index(store, row), row.number)
    ends = summary.get("ends", {})
    for row in {row.robot: row for row in rows if row.hello}.values():
        _restore_live(store, mapper, row, ends.get(f"{row.robot}/{row.session}"))
    return mapper


def remembered(store: SiteStore) -> dict[str, SurveyedPosition]:
    """What the tags' own memories say people surveyed."""
    return {survey.tag: _position(survey) for survey in store.memory_surveys()}


def _surveys(store: SiteStore) -> Surveys:
    told = {one.tag: _position(one) for one in store.surveys() if one.robot is None}
    return Surveys(told, remembered(store))


def _position(survey: Survey) -> SurveyedPosition:
    x, y, z = (*survey.p_m, 0.0)[:3]
    source: Source = "operator" if survey.robot is None else "memory"
    return SurveyedPosition(survey.tag, (x, y, z), survey.sigma_m, survey.cov, source, survey.robot)


def _index(store: SiteStore, row: SessionRow) -> SessionIndex:
    refused = row.refused if row.hello is None else None
    index = SessionIndex(row.robot, row.session, row.hello, refused)
    index.settle(store.settled(row.robot, row.session))
    for run in store.archived(row.robot, row.session):
        index.settle_run(*run)
    for refusal in reversed(store.refusals(row.robot, row.session, limit=MAX_REFUSALS)):
        if refusal.seq is not None:
            index.refusals[refusal.seq] = refusal.reason
    index.announced = index.contiguous
    return index


def _restore_live(store: SiteStore, mapper: Mapper, row: SessionRow, end: Any) -> None:
    """Go on from the session's last solved pose with the keyframes after it."""
    index = mapper.ingest.robots[row.robot].sessions[row.session]
    from_seq = max(1, index.contiguous - MAX_RECENT + 1)
    for keyframe in store.keyframes_of(row.robot, row.session, from_seq):
        index.remember(keyframe)
        index.recent[keyframe.seq] = keyframe
    mapper.live.open(index, mapper.book, None if end is None else msgspec.convert(end, Known))
    index.forget_recent()
