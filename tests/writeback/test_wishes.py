"""What the map wants its tags to say."""

from tagmap.memory.provenance import is_prior
from tagmap.records import MapVersion, Tag
from tagmap.writeback.map_wishes import wishes
from tagmap.writeback.wanted import Owner

COV_3 = (1e-4, 0.0, 0.0, 1e-4, 0.0, 1e-4)


def version(gauge="anchored"):
    return MapVersion(
        version=5,
        t_ns=1_770_000_000_900_000_000,
        cause="test",
        gauge=gauge,
        moved=None,
        tags=1,
        withheld=0,
    )


def tag(name="e2000001", p_m=(1.0, 2.0, 3.0), cov=COV_3, state="mapped"):
    return Tag(tag=name, p_m=p_m, cov=cov, state=state, n=7, version=5, gauge="anchored")


def test_of_a_mapped_tag():
    (one,) = wishes(version(), [tag()], {}).values()
    assert (one.p_m, one.cov, one.map_version, one.t_s) == (
        (1.0, 2.0, 3.0),
        COV_3,
        5,
        1_770_000_000,
    )
    assert not is_prior(one.record(Owner(3), 1))


def test_nothing_is_wanted_of_a_floating_map_or_a_withheld_tag():
    assert wishes(version("floating"), [tag()], {}) == {}
    assert wishes(version(), [tag(p_m=None, cov=None, state="withheld")], {}) == {}


def test_a_surveyed_tag_gets_its_survey_and_not_what_the_map_made_of_it():
    cov = (2.5e-5, 1e-6, 0.0, 3.5e-5, 0.0, 2.5e-5)
    surveys = {"e2000001": ((1.01, 2.0, 3.0), cov)}
    (one,) = wishes(version(), [tag(state="surveyed")], surveys).values()
    assert (one.p_m, one.cov) == ((1.01, 2.0, 3.0), cov)
    assert is_prior(one.record(Owner(3), 1))
    (one,) = wishes(version(), [tag()], surveys).values()
    assert not one.surveyed


def test_retired_tags_are_marked():
    (one,) = wishes(version(), [tag(state="retired")], {}).values()
    assert (one.retired, one.surveyed) == (True, False)
    surveys = {"e2000001": ((1.01, 2.0, 3.0), COV_3)}
    (one,) = wishes(version(), [tag(state="retired")], surveys).values()
    assert (one.retired, one.surveyed, one.p_m) == (True, True, (1.01, 2.0, 3.0))


def test_planar_maps_lie_at_height_zero():
    (one,) = wishes(version(), [tag(p_m=(1.0, 2.0), cov=(1e-4, 1e-5, 2e-4))], {}).values()
    assert one.p_m == (1.0, 2.0, 0.0)
    assert one.cov == (1e-4, 1e-5, 0.0, 2e-4, 0.0, 0.0)
