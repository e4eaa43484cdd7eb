"""check() names what is wrong, and nothing else."""

import math
import sqlite3
import struct
from pathlib import Path

import pytest

from tagmap.store import Batch, SiteStore
from tagmap.store.check import MOST_OF_A_KIND, check
from tests.store.records import SITE, keyframe

NAN = struct.pack("<d", math.nan)


def tamper(path: Path, script: str) -> None:
    """Change what the triggers forbid, and put the triggers back."""
    db = sqlite3.connect(path, isolation_level=None)
    query = "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"
    triggers = db.execute(query).fetchall()
    for name, _ in triggers:
        db.execute(f"DROP TRIGGER {name}")
    db.executescript(script)
    for _, sql in triggers:
        db.execute(sql)
    db.close()


def test_a_healthy_database(mapped: SiteStore, path: Path) -> None:
    assert check(path) == []
    mapped.close()
    assert check(path) == []


def test_an_empty_site(path: Path) -> None:
    SiteStore.open(path, SITE).close()
    assert check(path) == []


@pytest.mark.parametrize(
    ("script", "expected"),
    [
        (
            "UPDATE keyframes SET T_base_cam = x'0011' WHERE seq = 2",
            "keyframe 2 (r1, session-1, 2)",
        ),
        ("UPDATE keyframes SET odom_cov = NULL WHERE seq = 3", "keyframe 3"),
        ("UPDATE keyframes SET t_ns = -5 WHERE seq = 1", "keyframe 1"),
        ("UPDATE keyframes SET t_ns = 'noon' WHERE seq = 1", "keyframe 1"),
        (f"UPDATE sightings SET z = x'{(NAN * 4).hex()}' WHERE keyframe_id = 4", "keyframe 4"),
        (f"UPDATE sightings SET cov = x'{(NAN * 3).hex()}' WHERE keyframe_id = 4", "keyframe 4"),
        (
            "UPDATE sightings SET cov = zeroblob(80) WHERE keyframe_id = 4",
            "not a positive definite",
        ),
        ("UPDATE sightings SET form = 'sonar' WHERE keyframe_id = 1 AND i = 0", "form 'sonar'"),
        ("UPDATE sightings SET id_by = 'luck' WHERE keyframe_id = 1 AND i = 0", "id_by"),
        ("UPDATE sightings SET p_false = 2.0 WHERE keyframe_id = 1 AND i = 0", "p_false"),
        (
            "DELETE FROM sightings WHERE keyframe_id = 2 AND i = 0",
            "keyframe 2: a sighting is missing",
        ),
        ("DELETE FROM sightings WHERE keyframe_id = 2", "6 sightings stored, expected 8"),
        ("DELETE FROM keyframes WHERE seq = 4", "sightings: a row refers to one of keyframes"),
        ("DELETE FROM keyframes WHERE seq = 4", "3 keyframes stored, expected 4"),
        ("DELETE FROM keyframes WHERE seq = 4", "keyframes that do not exist: seq [4]"),
        ("UPDATE sessions SET hello = x'00'", "session r1 session-1: hello: malformed"),
        ("UPDATE robots SET number = 9", "its hello is of ('site', 'r1', 1, 'session-1')"),
        ("UPDATE site SET name = 'other'", "its hello is of"),
        ("DELETE FROM site", "site: 0 rows, expected 1"),
        ("UPDATE surveys SET p_m = x'0000000000000000'", "survey of tag tag0: p_m has 1 numbers"),
        ("UPDATE surveys SET sigma_m = 9e999", "survey of tag tag0: sigma_m"),
        ("UPDATE map_versions SET version = 3", "map versions are not contiguous"),
        ("UPDATE map_versions SET gauge = 'loose'", "map version 1"),
        ("UPDATE map_versions SET moved = x'00'", "map version 1"),
        ("UPDATE map_versions SET summary = '{'", "map version 1"),
        (f"UPDATE tag_estimates SET p_m = x'{(NAN * 3).hex()}' WHERE n = 4", "tag tag0"),
        ("UPDATE tag_estimates SET p_m = NULL WHERE tag = 'tag0'", "is mapped with p_m None"),
        ("UPDATE tag_estimates SET cov = zeroblob(48) WHERE tag = 'tag0'", "positive definite"),
        ("UPDATE keyframe_poses SET T_map_base = x'00'", "keyframe_poses of session session-1"),
        (f"UPDATE keyframe_poses SET T_map_base = x'{(NAN * 48).hex()}'", "not finite"),
        ("UPDATE keyframe_poses SET seq = x''", "keyframe_poses of session session-1"),
        ("UPDATE keyframe_poses SET first_t_ns = 7", "is not in time order"),
        (
            "INSERT INTO map_versions SELECT 2, t_ns, cause, gauge, moved, tags, withheld, summary "
            "FROM map_versions",
            "of version 1, the newest is 2",
        ),
        ("DROP INDEX keyframe_poses_by_time", "schema: keyframe_poses_by_time is missing"),
        ("ALTER TABLE surveys ADD COLUMN mood TEXT", "schema: surveys is not as the migrations"),
        (
            "INSERT INTO memory_surveys (tag, p_m, t_ns) VALUES ('tag1', zeroblob(24), 1)",
            "survey in the memory of tag tag1",
        ),
        (
            "INSERT INTO memory_surveys (tag, p_m, cov, t_ns) "
            "VALUES ('tag1', zeroblob(24), zeroblob(48), 1)",
            "cov is not a positive definite 3x3",
        ),
        (
            "DELETE FROM _sqlite_migrations WHERE name = 'memory_surveys'",
            "lacks memory_surveys",
        ),
    ],
)
def test_each_corruption_is_found(
    mapped: SiteStore, path: Path, script: str, expected: str
) -> None:
    mapped.close()
    tamper(path, script)
    problems = check(path)
    assert any(expected in problem for problem in problems), problems


def test_a_missing_trigger(mapped: SiteStore, path: Path) -> None:
    mapped._db.execute("DROP TRIGGER sightings_no_delete")
    assert check(path) == ["schema: sightings_no_delete is missing"]


def test_an_index_that_contradicts_its_table(mapped: SiteStore, path: Path) -> None:
    mapped.close()
    db = sqlite3.connect(path)
    root = db.execute(
        "SELECT rootpage FROM sqlite_master WHERE name = 'keyframe_poses_by_time'"
    ).fetchone()[0]
    page_size = db.execute("PRAGMA page_size").fetchone()[0]
    db.close()
    content = bytearray(path.read_bytes())
    content[(root - 1) * page_size + 3 : (root - 1) * page_size + 5] = b"\0\0"
    path.write_bytes(content)
    assert "damaged" in check(path)[0]


def test_a_long_list_is_cut(path: Path) -> None:
    with SiteStore.open(path, SITE) as store:
        store.commit(Batch(keyframes=[keyframe(i, sightings=0) for i in range(1, 101)]))
    tamper(path, "UPDATE keyframes SET T_base_cam = x'00'")
    problems = check(path)
    assert len(problems) == MOST_OF_A_KIND + 1
    assert problems[-1] == "and 80 more of that kind"


def test_no_file_and_no_database(path: Path) -> None:
    assert check(path) == [f"{path}: no such file"]
    path.write_text("nothing of the kind" * 100)
    assert "not an SQLite database" in check(path)[0]


def test_checking_changes_nothing(mapped: SiteStore, path: Path) -> None:
    mapped.close()
    before = path.read_bytes()
    check(path)
    assert path.read_bytes() == before
