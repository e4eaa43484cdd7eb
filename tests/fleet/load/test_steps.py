"""Faster and faster until it breaks twice at the same rate: trials that are made up."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from fleet.load import run as running
from fleet.load.judging import queue, times
from fleet.load.plan import Load
from fleet.load.run import why_broken
from fleet.load.trial import Trial
from tagmap.errors import ConfigError

T_S = np.arange(0.0, 10.0, 0.1)


def made_up(rate_hz: float, ack_s: float = 0.02, slope: float = 0.0) -> Trial:
    some = times(np.full(100, ack_s))
    return Trial(
        rate_hz=rate_hz,
        duration_s=10.0,
        sent=100,
        settled=100,
        resent=0,
        refused=0,
        ack=some,
        pose=some,
        late=some,
        queue=queue(T_S, slope * T_S, 500.0),
        series=[],
        cores={},
        rss_mb={},
        load_average=(0.0, 0.0),
    )


def stepped(monkeypatch: pytest.MonkeyPatch, trials: list[Trial], stop_after: int = 99):
    """What is done with these, and the rates that were asked for."""
    rates: list[float] = []

    def trial(_robots: object, load: Load, *_: object) -> Trial:
        rates.append(load.rate_hz)
        return trials[len(rates) - 1]

    monkeypatch.setattr(running, "trial", trial)
    site = SimpleNamespace(robots=[], meter=lambda: None)
    load = Load([], 10.0, 10.0, 1, {})
    return running._steps(site, load, lambda: len(rates) >= stop_after, lambda _: None), rates


def test_what_breaks_a_trial():
    assert why_broken(made_up(10.0)) is None
    assert "p99 of acknowledgements is 60.0 ms" in str(why_broken(made_up(10.0, ack_s=0.06)))
    assert "the queue grows by 9 keyframes per s" in str(why_broken(made_up(10.0, slope=9.0)))
    lost = replace(made_up(10.0), ack=times(np.full(100, np.nan)))
    assert "infinite" in str(why_broken(lost))


def test_one_bad_trial_is_tried_again(monkeypatch: pytest.MonkeyPatch):
    slow = made_up(12.5, ack_s=0.2)
    trials = [made_up(10.0), slow, made_up(12.5), slow, slow]
    (found, broke), rates = stepped(monkeypatch, trials)
    assert rates == [10.0, 12.5, 12.5, 15.625, 15.625]
    assert found == trials
    assert "200.0 ms" in broke


def test_ending_early_is_no_break(monkeypatch: pytest.MonkeyPatch):
    (found, broke), _ = stepped(monkeypatch, [made_up(10.0), made_up(12.5, 0.2)], stop_after=2)
    assert (len(found), broke) == (2, None)


def test_more_than_can_be_held_is_refused():
    with pytest.raises(ConfigError, match="3000000 keyframes, at most 2000000"):
        Load([None] * 100, 100.0, 300.0, 1, {})  # type: ignore[list-item]
