"""Runs of consecutive seqs: which keyframes of a session are meant, in little room."""

from bisect import bisect_right
from collections.abc import Iterable
from typing import TypeAlias

Spans: TypeAlias = "tuple[tuple[int, int], ...]"
"""(first, last), both included, ascending, apart from each other."""


def spans_of(seqs: Iterable[int]) -> Spans:
    """Of seqs in any order."""
    return united(tuple((seq, seq) for seq in sorted(seqs)))


def united(*parts: Spans) -> Spans:
    """What is in any of them."""
    runs: list[tuple[int, int]] = []
    for first, last in sorted(run for part in parts for run in part):
        if runs and first <= runs[-1][1] + 1:
            runs[-1] = runs[-1][0], max(last, runs[-1][1])
        else:
            runs.append((first, last))
    return tuple(runs)


def has(spans: Spans, seq: int) -> bool:
    i = bisect_right(spans, seq, key=lambda run: run[0]) - 1
    return i >= 0 and seq <= spans[i][1]


def count(spans: Spans) -> int:
    return sum(last - first + 1 for first, last in spans)
