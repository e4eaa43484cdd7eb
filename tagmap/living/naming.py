"""Numbers of tags and unknowns that stay while more of them come."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

from tagmap.conventions import Kind
from tagmap.estimation.stack import SurveyedTag
from tagmap.estimation.stated import Stated
from tagmap.estimation.unknowns import Unknown
from tagmap.records import Hello


def tags_with(
    tags: tuple[str, ...], seen: Iterable[Sequence[str]], surveys: Sequence[SurveyedTag]
) -> tuple[str, ...]:
    """`tags`, then the others that are seen or surveyed, in the order of their names."""
    more = {tag for part in seen for tag in part} | {survey.tag for survey in surveys}
    return tags + tuple(sorted(more - set(tags)))


def unknowns_with(
    unknowns: tuple[Unknown, ...], kind: Kind, hellos: Sequence[Hello]
) -> tuple[Unknown, ...]:
    """Likewise with what these robots state; the widest prior that is stated counts."""
    found = {(unknown.name, unknown.robot): unknown for unknown in unknowns}
    for new in Stated.by(kind, hellos).unknowns:
        old = found.get((new.name, new.robot), new)
        found[new.name, new.robot] = replace(old, sigma=max(old.sigma, new.sigma))
    return tuple(found.values())
