"""New keyframes a lot at a time: what is wrong with them shows before they are condensed."""

from collections.abc import Iterator, Sequence

from tagmap.estimation.stack import SessionData
from tagmap.living.kept import Kept
from tagmap.records.spans import has

LOT = 100


def lots_of(sessions: Sequence[SessionData], kept: Kept) -> Iterator[list[SessionData]]:
    """Of each session everything up to its first LOT new keyframes, then up to the next, ..."""
    ends = [_ends(session, kept) for session in sessions]
    for i in range(max(map(len, ends))):
        yield [
            _up_to(session, own[min(i, len(own) - 1)])
            for session, own in zip(sessions, ends, strict=True)
        ]


def alive_of(sessions: Sequence[SessionData], kept: Kept) -> list[SessionData]:
    """Without what is covered by now."""
    alive = []
    for session in sessions:
        covered = kept.covered.get((session.hello.robot, session.hello.session), ())
        keyframes = [k for k in session.keyframes if not has(covered, k.seq)]
        if keyframes:
            alive.append(SessionData(session.hello, keyframes))
    return alive


def _ends(session: SessionData, kept: Kept) -> list[int]:
    """The last seq of each lot."""
    known = kept.poses.get((session.hello.robot, session.hello.session))
    newest = -1 if known is None or not len(known.seqs) else int(known.seqs[-1])
    seqs = sorted(keyframe.seq for keyframe in session.keyframes)
    new = [seq for seq in seqs if seq > newest]
    return [*new[LOT - 1 :: LOT][: (len(new) - 1) // LOT], seqs[-1]]


def _up_to(session: SessionData, last: int) -> SessionData:
    return SessionData(session.hello, [k for k in session.keyframes if k.seq <= last])
