"""What the robot believes of tags' places: the map, what tags remember, and never two frames."""

import numpy as np
import pytest

from robot_agent.atlas.atlas import Atlas
from robot_agent.atlas.served import ServedMap, load, save
from tagmap.errors import DataError
from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for
from tagmap.records import MapVersion, Tag

COV = (1e-6, 0.0, 0.0, 1e-6, 0.0, 1e-6)
TAGS = [f"e2{n:022x}" for n in range(6)]


def served(gauge="anchored", version=3, tags=TAGS[:3], states=()):
    about = MapVersion(
        version=version, t_ns=1, cause="test", gauge=gauge, moved=None, tags=len(tags), withheld=0
    )
    states = states or ["mapped"] * len(tags)
    return ServedMap(
        site="site",
        version=about,
        tags=tuple(
            Tag(
                tag=tag,
                p_m=None if state == "withheld" else (float(n), 0.0, 3.0),
                cov=None if state == "withheld" else COV,
                state=state,
                n=5,
                version=version,
                gauge=gauge,
            )
            for n, (tag, state) in enumerate(zip(tags, states, strict=True))
        ),
    )


def memory(tag, p_m=(9.0, 0.0, 3.0), site=1, key=None, **more):
    record = TagRecord(
        map_version=2, p_m=p_m, cov=COV, site=site, t_s=1000, robot=1, count=9, **more
    )
    data = encode_for(128, record, tag, key)
    return data + bytes(128 - len(data))


def place(chart, tag):
    return chart.table.p_map[chart.table.index[tag]]


def test_nothing_is_known_at_first():
    chart = Atlas().chart()
    assert (chart.origin, chart.gauge, chart.version, len(chart)) == (None, "floating", None, 0)


def test_an_anchored_map_wins_and_records_fill_its_gaps():
    atlas = Atlas(site_number=1)
    assert atlas.read(TAGS[0], memory(TAGS[0]))
    assert atlas.read(TAGS[5], memory(TAGS[5]))
    assert atlas.serve(served())
    chart = atlas.chart()
    assert (chart.origin, chart.gauge, chart.version, len(chart)) == ("service", "anchored", 3, 4)
    assert place(chart, TAGS[0])[0] == 0.0
    assert place(chart, TAGS[5])[0] == 9.0
    assert set(chart.catalogue.ids) == set(chart.table.index)


def test_records_are_never_mixed_with_a_floating_map():
    atlas = Atlas(site_number=1)
    atlas.serve(served("floating"))
    atlas.read(TAGS[4], memory(TAGS[4]))
    assert set(atlas.chart().table.index) == set(TAGS[:3]), "one record fixes no pose"
    for tag in TAGS[3:]:
        atlas.read(tag, memory(tag))
    chart = atlas.chart()
    assert (chart.origin, chart.gauge, chart.version) == ("memory", "anchored", 2)
    assert set(chart.table.index) == set(TAGS[3:])
    assert chart.T_new_old is None, "another frame"


def test_a_frame_that_stays_keeps_the_pose():
    atlas = Atlas()
    atlas.serve(served(version=3))
    atlas.chart()
    atlas.serve(served(version=4, tags=TAGS[:4]))
    assert (atlas.chart().T_new_old == np.eye(4)).all()


def test_the_same_map_again_is_no_news():
    atlas = Atlas()
    assert atlas.serve(served())
    assert not atlas.serve(served())


def test_what_is_withheld_or_retired_is_not_localised_by():
    atlas = Atlas()
    atlas.read(TAGS[2], memory(TAGS[2]))
    atlas.read(TAGS[3], memory(TAGS[3], retired=True))
    atlas.serve(served(states=["mapped", "withheld", "retired"]))
    assert set(atlas.chart().table.index) == {TAGS[0]}


@pytest.mark.parametrize(
    ("data", "reason"),
    [
        (memory(TAGS[1]), "another tag's"),
        (memory(TAGS[0], site=7), "of site 7"),
        (bytes(128), "blank"),
        (bytes(4), "memory of 4 bytes"),
        (memory(TAGS[0])[:40] + b"\x00" + memory(TAGS[0])[41:], "damaged"),
    ],
)
def test_what_is_no_record_of_this_tag_is_refused_with_the_reason(data, reason):
    atlas = Atlas(site_number=1)
    atlas.read(TAGS[0], memory(TAGS[0]))
    atlas.read(TAGS[0], data)
    assert TAGS[0] not in atlas.records, "what counted before is no longer there"
    assert reason in atlas.refused[TAGS[0]]


def test_a_site_with_a_key_believes_signed_records_only():
    key = bytes(range(32))
    atlas = Atlas(key, 1)
    atlas.read(TAGS[0], memory(TAGS[0]))
    assert not atlas.records
    atlas.read(TAGS[0], memory(TAGS[0], key=key))
    assert list(atlas.records) == [TAGS[0]]


def test_the_map_outlives_a_restart(tmp_path):
    path = tmp_path / "r1.map"
    assert load(path, "site") is None
    save(path, served())
    assert load(path, "site") == served()
    with pytest.raises(DataError, match="of site site, this is hall"):
        load(path, "hall")
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(DataError, match="not a map"):
        load(path, "site")
