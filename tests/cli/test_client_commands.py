"""The client commands against a running service, as people and as programs use them."""

import csv
import json

import pytest
from msgspec.structs import replace

from tagmap.memory.record import TagRecord
from tagmap.memory.slots import encode_for
from tagmap.records import IdentifiedMeasurement
from tests.cli.test_commands import one_line, tagmap
from tests.mapping.messages import SESSION, hello, keyframe
from tests.mapping.world import TAGS, T_map_base, drive, seen

N = 20


@pytest.fixture
def run(serve, client):
    """`run(command)` on a service that knows one robot; JSON in, objects out."""
    client.deliver(hello(), *(drive(seq) for seq in range(1, N + 1)), keyframe(N + 1, site="no"))

    def run(*arguments, as_json=True):
        command = [*arguments, "--connect", serve.endpoint, *(["--json"] if as_json else [])]
        result = tagmap(*command, cwd=serve.folder)
        if result.returncode or not as_json:
            return result
        return json.loads(result.stdout)

    return run


def test_a_day_of_an_administrator(run):
    solved = run("map", "solve")
    assert (solved["gauge"], solved["tags"]) == ("floating", 4)
    assert "floating" in run("tags", "list", as_json=False).stdout
    assert "floating" in run("robots", "list", as_json=False).stdout

    for tag in ("1", "2", "3"):
        x, y = TAGS[tag]
        assert run("tags", "survey", tag, x, y, 0, "--sigma-m", 0.001)["tag"] == tag
    solved = run("map", "solve")
    assert (solved["gauge"], solved["cause"]) == ("anchored", "survey")

    tags = run("tags", "list", "--bbox", "-3,-3,0,3")["tags"]
    assert [tag["tag"] for tag in tags] == ["2", "3"]
    assert tags[0]["p_m"] == pytest.approx([-2.0, 2.0], abs=0.02)
    assert run("tags", "list", "--version", "1")["gauge"] == "floating"
    memories = run("tags", "list", "--memory")["tags"]
    assert [(one["tag"], one["state"]) for one in memories] == [(t, "unread") for t in "1234"]
    assert "0 of 4" in run("tags", "list", "--memory", as_json=False).stdout
    assert run("tags", "list", "--memory", "--state", "mapped").returncode == 2
    shown = run("tags", "show", "2")
    assert (shown["state"], shown["survey"]["sigma_m"]) == ("surveyed", 0.001)

    (robot,) = run("robots", "list")["robots"]
    assert (robot["robot"], robot["number"], robot["keyframes"]) == ("r1", 1, N)
    shown = run("robots", "show", "r1")
    assert shown["sessions"] == [{"session": SESSION, "contiguous": N + 1, "refused": None}]
    assert shown["refusals"][0]["reason"] == "names site no, this is site"

    versions = run("map", "versions")["versions"]
    assert versions[-1]["version"] == solved["version"]
    status = run("status")
    assert (status["keyframes"], status["refusals"], status["surveyed"]) == (N, 1, 3)


def surveyed_memory(tag):
    x_m, y_m = map(float, TAGS[tag])
    cov = (4e-6, 0.0, 0.0, 4e-6, 0.0, 4e-6)
    fields = {"p_m": (x_m, y_m, 0.0), "cov": cov, "site": 1, "t_s": 1, "robot": 0}
    record = TagRecord(map_version=0, surveyed=True, **fields)
    return encode_for(88, record, tag).ljust(88, b"\0")


def test_who_surveyed_a_tag(run, serve, client):
    """Three tags say that people did; an operator knows better of one of them."""
    seen = drive(N + 2)
    sightings = [
        replace(one, memory=bytes(88) if one.tag == "4" else surveyed_memory(one.tag))
        for one in seen.sightings
    ]
    client.deliver(hello(), replace(seen, sightings=tuple(sightings)))
    assert client.admin("map", "solve")["gauge"] == "anchored"
    assert run("tags", "survey", "3", *TAGS["3"], 0, "--sigma-m", 0.001)["surveyed"] == 3
    serve.kill()
    serve.start()
    assert client.admin("map", "solve")["gauge"] == "anchored"
    status = client.admin("site", "status")
    assert (status["surveyed"], status["surveyed_by_memory"], status["memories_refused"]) == (
        3,
        2,
        0,
    )
    listed = [tag["survey"] for tag in run("tags", "list")["tags"]]
    assert listed == ["memory", "memory", "operator", None]
    memories = [one["survey"] for one in client.admin("tags", "memory")["tags"]]
    assert memories == ["counts", "counts", "an operator's counts", None]
    lines = run("tags", "show", "2", as_json=False).stdout.splitlines()
    told = dict(line.rsplit(maxsplit=1) for line in lines)
    assert (told["survey source"], told["survey read_by"]) == ("memory", "r1")
    assert told["survey sigma_m"] == "0.0020"
    assert "an operator's counts" in run("tags", "list", "--memory", as_json=False).stdout


def test_tables_for_people(run):
    run("map", "solve")
    for arguments in (
        ["status"],
        ["tags", "list"],
        ["tags", "show", "1"],
        ["robots", "list"],
        ["robots", "show", "r1"],
        ["map", "versions"],
        ["map", "solve"],
    ):
        result = run(*arguments, as_json=False)
        assert result.returncode == 0, result.stderr
        assert result.stdout.strip()


def test_exports(run, serve):
    run("map", "solve")
    assert run("map", "export", "--format", "csv", "--out", "tags.csv")["tags"] == 4
    with (serve.folder / "tags.csv").open() as file:
        assert [row["tag"] for row in csv.DictReader(file)] == ["1", "2", "3", "4"]
    assert run("map", "export", "--format", "json", "--out", "map.json")["poses"] == N
    exported = json.loads((serve.folder / "map.json").read_text())
    assert [pose["seq"] for pose in exported["trajectories"]["r1"]] == list(range(1, N + 1))
    assert run("map", "export", "--format", "tum", "--out", "tracks")["poses"] == N
    folder = (serve.folder / "tracks" / "r1.tum").read_text()
    run("map", "export", "--format", "tum", "--out", "r1.tum", "--robot", "r1")
    assert (serve.folder / "r1.tum").read_text() == folder
    assert len(folder.splitlines()) == N
    assert all(len(line.split()) == 8 for line in folder.splitlines())


def test_localize(run, serve):
    import msgspec

    run("map", "solve")
    measurements = [
        IdentifiedMeasurement(tag=tag, z=seen(T_map_base(4), tag, p).z) for tag, p in TAGS.items()
    ]
    request = {
        "kind": "planar",
        "T_base_cam": {"p_m": [0, 0], "theta_rad": 0},
        "measurements": msgspec.to_builtins(measurements),
    }
    (serve.folder / "seen.json").write_text(json.dumps(request))
    reply = run("localize", "seen.json")
    assert reply["T_map_base"]["p_m"] == pytest.approx([0.3, 0.0], abs=0.05)
    assert reply["gauge"] == "floating"
    (serve.folder / "bad.json").write_text('{"kind": "round"}')
    assert "bad.json" in one_line(run("localize", "bad.json"))


def test_what_is_refused_is_one_line_and_exit_1(run):
    for arguments, said in [
        (["tags", "show", "99"], "99"),
        (["tags", "list", "--bbox", "1"], "bbox"),
        (["tags", "list", "--version", "77"], "77"),
        (["tags", "survey", "1", "0", "0", "0", "--sigma-m", "-1"], "sigma"),
        (["tags", "survey", "1", "-1", "nan", "0", "--sigma-m", "1"], "y is"),
        (["tags", "survey", "1", "1e300", "0", "0", "--sigma-m", "1"], "x is"),
        (["robots", "show", "r9"], "r9"),
        (["map", "export", "--format", "tum", "--out", "x", "--robot", "r9"], "r9"),
        (["map", "export", "--format", "csv", "--out", "no/such/folder.csv"], "folder.csv"),
        (["status", "--site", "other"], "no map service of site 'other'"),
    ]:
        assert said in one_line(run(*arguments))
