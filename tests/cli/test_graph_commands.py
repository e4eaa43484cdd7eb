"""`tagmap map solve FILE` and `tagmap map export --format g2o`: no service is needed."""

import json

import numpy as np
import pytest
from click.testing import CliRunner

from tagmap.cli import cli
from tagmap.exchange.graph_file import read_graph
from tagmap.records import MapVersion, Tag
from tagmap.store import Batch, SessionPoses, SiteStore
from tests.cli.test_commands import one_line, tagmap
from tests.exchange.graphs import planar, write
from tests.exchange.test_map_graph import world

KEYS = [
    "poses",
    "landmarks",
    "chi2_initial",
    "chi2_final",
    "iterations",
    "converged",
    "wall_s",
    "solve_s",
    "peak_mb",
]


@pytest.fixture
def path(tmp_path):
    vertices, edges, _ = planar(sigma=1.0)
    return write(tmp_path / "ring.g2o", vertices, edges)


def run(*arguments, status=0):
    result = CliRunner().invoke(cli, ["map", *map(str, arguments)])
    assert result.exit_code == status, result.output
    return result.output


def test_the_summary(path):
    found = json.loads(run("solve", path, "--json"))
    assert list(found) == KEYS
    assert (found["poses"], found["landmarks"], found["converged"]) == (40, 12, True)
    assert 0.0 < found["chi2_final"] < found["chi2_initial"]
    assert 0.0 < found["solve_s"] < found["wall_s"]
    assert found["peak_mb"] > 10.0
    told = run("solve", path)
    assert [line.split()[0] for line in told.splitlines()] == KEYS


def test_starts_and_robust_weights(path):
    plain = json.loads(run("solve", path, "--json"))["chi2_final"]
    nothing = json.loads(run("solve", path, "--json", "--start", "nothing"))["chi2_final"]
    assert nothing == pytest.approx(plain, rel=1e-8)
    assert "rejected" in run("solve", path, "--robust")
    assert list(json.loads(run("solve", path, "--robust", "--json"))) == KEYS


def test_the_result_as_a_file(path, tmp_path):
    first = json.loads(run("solve", path, "--json", "--out", tmp_path / "out.g2o"))
    again = json.loads(run("solve", tmp_path / "out.g2o", "--json"))
    assert again["chi2_initial"] == pytest.approx(first["chi2_final"], rel=1e-9)


def test_wrong_usage(path, tmp_path):
    run("solve", "--out", tmp_path / "x", status=2)
    run("solve", "--robust", status=2)
    run("solve", path, "--start", "somewhere", status=2)
    run("export", "--format", "csv", "--db", "site.db", "--out", "x", status=2)
    run("export", "--format", "g2o", "--robot", "r1", "--out", "x", status=2)


def test_refusals_are_one_line(path, tmp_path):
    (tmp_path / "bad.g2o").write_text("VERTEX_SE2 0 0 0\n")
    said = one_line(tagmap("map", "solve", tmp_path / "bad.g2o"))
    assert "bad.g2o: line 1: VERTEX_SE2 with 3 values, expected 4" in said
    assert "none.g2o" in one_line(tagmap("map", "solve", tmp_path / "none.g2o"))
    assert "folder" in one_line(tagmap("map", "solve", path, "--out", tmp_path / "folder" / "x"))
    (tmp_path / "text.txt").write_text("ODOMETRY 0 1 1 0 0 1 0 0 1 0 1\n")
    said = one_line(tagmap("map", "solve", tmp_path / "text.txt", "--start", "file"))
    assert "no vertices" in said


@pytest.fixture
def database(tmp_path):
    """A solved site of one planar session."""
    session, tags = world("planar", "range_bearing")
    n = len(session.seqs)
    with SiteStore.open(tmp_path / "site.db", "site") as store:
        store.commit(Batch(hellos=[session.hello], keyframes=list(session.keyframes)))
        poses = SessionPoses("r1", "session-1", session.seqs, np.arange(n), session.T, None)
        version = MapVersion(
            version=1,
            t_ns=1,
            cause="first map",
            gauge="floating",
            moved=None,
            tags=len(tags),
            withheld=0,
        )
        assert isinstance(tags[0], Tag)
        store.commit_version(version, tags, [poses], {"scale": None, "stereo_scale": None})
    return tmp_path / "site.db"


def test_the_newest_map_as_a_graph(database, tmp_path):
    out = tmp_path / "map.g2o"
    told = json.loads(run("export", "--format", "g2o", "--db", database, "--out", out, "--json"))
    assert told == {
        "out": str(out),
        "tags": 6,
        "poses": 8,
        "steps": 7,
        "sightings": 48,
        "skipped": 0,
    }
    graph = read_graph(out)
    assert (graph.kind, len(graph.steps), len(graph.points)) == ("planar", 7, 48)
    assert "# 8: tag t0" in out.read_text()
    solved = json.loads(run("solve", out, "--json"))
    assert solved["chi2_final"] < 1e-6
    assert "6 tags, 8 poses" in run("export", "--format", "g2o", "--db", database, "--out", out)


def test_a_database_without_a_map(tmp_path):
    SiteStore.open(tmp_path / "site.db", "site").close()
    arguments = ["map", "export", "--format", "g2o", "--out", tmp_path / "x"]
    assert "no map yet" in one_line(tagmap(*arguments, cwd=tmp_path))
    assert "none.db" in one_line(tagmap(*arguments, "--db", tmp_path / "none.db"))
    assert not (tmp_path / "x").exists()
