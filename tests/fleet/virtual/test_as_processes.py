"""The same recording through real processes and Zenoh, and in virtual time."""

import numpy as np
import pytest

from fleet.running.run import run_recording
from tagmap.store import SiteStore


@pytest.mark.slow
def test_the_map_is_that_of_the_real_processes(play, recording, surveys, tmp_path):
    survey = tmp_path / "survey.csv"
    lines = [",".join([s.tag, *map(repr, s.p_m), repr(s.sigma_m)]) for s in surveys]
    survey.write_text("\n".join(["tag,x_m,y_m,z_m,sigma_m", *lines]) + "\n")
    db = tmp_path / "site.db"
    run = run_recording(recording, tmp_path, db, (), survey, lambda _: None)
    played = play()
    assert run.results.keyframes_stored == len(played.facts())
    with SiteStore.open(db, read_only=True) as store:
        tags = {tag.tag: tag.p_m for tag in store.tags() if tag.p_m is not None}
    assert tags.keys() == played.tags().keys()
    apart_m = [np.subtract(p_m, tags[tag]) for tag, p_m in played.tags().items()]
    assert np.abs(apart_m).max() < 1e-6
