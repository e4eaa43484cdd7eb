"""Commands that need no service: localize with its own tags, dop, map coverage."""

import json
import math
import subprocess
import sys

import msgspec
import numpy as np
import pytest
from click.testing import CliRunner

from tagmap.cli import cli
from tagmap.geometry import se3, stereo
from tagmap.localisation.dop import looking_at
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

TAGS = {
    "a": [0, 1, 0],
    "b": [0.75**0.5, -0.5, 0],
    "c": [-(0.75**0.5), -0.5, 0],
    "d": [0.1, 0.2, 0.4],
}
PRESET = "wide-angle"


def view(both=True, tags="abcd", known=TAGS, **extra):
    """A file for localize, without noise, and the pose that it shows."""
    rig = stereo_rig(find_rig(PRESET))
    T_map_cam = looking_at(np.array([0.4, 0.3, 2.0]), np.array([0.1, 0.0, 0.0]))
    p = np.array([known[tag] for tag in tags])
    z, _ = stereo.project(rig, se3.act(se3.inverse(T_map_cam), p))
    file = {"rig": PRESET, "tags": known, "sigma_px": 0.2}
    file["left"] = {tag: row[:2].tolist() for tag, row in zip(tags, z, strict=True)}
    if both:
        file["right"] = {tag: row[2:].tolist() for tag, row in zip(tags, z, strict=True)}
    return file | extra, T_map_cam


def localize(tmp_path, file, *options):
    path = tmp_path / "view.json"
    path.write_text(json.dumps(file))
    return CliRunner().invoke(cli, ["localize", str(path), *options, "--json"])


def answered(tmp_path, file, *options):
    result = localize(tmp_path, file, *options)
    assert result.exit_code == 0, result.output
    return json.loads(result.output)


def test_a_pose_for_people_is_short_lines(tmp_path):
    path = tmp_path / "view.json"
    for file, words in (
        (view()[0], ["0.4000 0.3000 2.0000 m", "mm along its own", "a, b, c, d", "good"]),
        (view(both=False, tags="abc")[0], ["alternatives", "chi2", "degraded", "second pose"]),
        (view(tags="ab")[0], ["T_map_cam           -", "sigma               -", "lost"]),
        (view(T_base_cam={"p_m": [0, 0, 1], "q_wxyz": [1, 0, 0, 0]})[0], ["T_map_base"]),
    ):
        path.write_text(json.dumps(file))
        told = CliRunner().invoke(cli, ["localize", str(path)])
        assert told.exit_code == 0
        assert all(word in told.output for word in words), told.output
        assert "[" not in told.output


@pytest.mark.parametrize("both", [True, False])
def test_localize_answers_the_contract(tmp_path, both):
    file, T = view(both)
    found = answered(tmp_path, file)
    p, q = se3.to_p_q(T)
    np.testing.assert_allclose(found["T_map_cam"]["p_m"], p, atol=1e-6)
    np.testing.assert_allclose(found["T_map_cam"]["q_wxyz"], q, atol=1e-6)
    assert np.linalg.eigvalsh(np.array(found["cov"]))[0] > 0.0
    assert found["chi2"] < 1e-6
    assert found["dof"] == (10 if both else 2)
    assert found["inliers"] == list("abcd")
    assert found["excluded"] == []
    for name in ("pdop", "odop_deg_per_mm", "ppdop_mm_per_px", "podop_deg_per_px"):
        assert found[name] > 0.0
    assert found["danger_cylinder_m"] > 0.0
    if both:
        assert (found["state"], found["reasons"]) == ("good", [])
        assert found["protection_level_m"] > 4.0 * np.sqrt(np.trace(found["cov"][:3][:3]) / 3)
    else:
        assert (found["state"], found["protection_level_m"]) == ("degraded", None)
        assert "a, b, c, d" in found["reasons"][0]


def test_localize_of_base_and_with_uncertain_tags(tmp_path):
    T_base_cam = se3.from_p_q(np.array([0.1, 0.0, 0.4]), np.array([0.5, -0.5, 0.5, -0.5]))
    mount = {"p_m": [0.1, 0.0, 0.4], "q_wxyz": [0.5, -0.5, 0.5, -0.5]}
    file, T = view(T_base_cam=mount)
    found = answered(tmp_path, file)
    np.testing.assert_allclose(
        found["T_map_base"]["p_m"], (T @ se3.inverse(T_base_cam))[:3, 3], atol=1e-6
    )
    for cov in (
        1e-4,
        [1e-4, 0, 0, 1e-4, 0, 1e-4],
        {tag: [1e-4, 0, 0, 1e-4, 0, 1e-4] for tag in "abcd"},
    ):
        softer = answered(tmp_path, file | {"tag_cov_m2": cov})
        assert np.trace(softer["cov"]) > 2.0 * np.trace(found["cov"])


def test_three_tags_in_one_image_have_alternatives_until_up_is_known(tmp_path):
    file, T = view(both=False, tags="abc")
    found = answered(tmp_path, file)
    assert found["state"] == "degraded"
    assert len(found["alternatives"]) >= 1
    assert found["reasons"]
    up = {"up_cam": T[2, :3].tolist(), "sigma_up_rad": 0.001}
    known = answered(tmp_path, file | {"prior": up})
    assert (known["alternatives"], known["dof"]) == ([], 2)
    np.testing.assert_allclose(known["T_map_cam"]["p_m"], T[:3, 3], atol=1e-6)


def test_a_prior_pose_carries_two_tags(tmp_path):
    file, T = view(tags="ab")
    nothing = answered(tmp_path, file)
    assert (nothing["T_map_cam"], nothing["cov"], nothing["state"]) == (None, None, "lost")
    assert "three" in nothing["reasons"][0]
    p, q = se3.to_p_q(T)
    cov = [1e-4 if i == j else 0.0 for i in range(6) for j in range(i, 6)]
    prior = {"T_map_cam": {"p_m": p.tolist(), "q_wxyz": q.tolist()}, "cov": cov}
    found = answered(tmp_path, file | {"prior": prior})
    assert found["state"] == "degraded"
    np.testing.assert_allclose(found["T_map_cam"]["p_m"], p, atol=1e-6)


def test_rig_in_the_file_and_beside_it(tmp_path):
    file, _ = view()
    rig = msgspec.to_builtins(find_rig(PRESET))
    first = answered(tmp_path, file | {"rig": rig})
    assert first["state"] == "good"
    none = localize(tmp_path, file | {"rig": "none.toml"})
    assert none.exit_code == 1


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"left": {"x": [1, 2]}}, "tag x"),
        ({"left": {"a": [1, 2, 3]}}, "left"),
        ({"sigma_px": 0}, "sigma_px"),
        ({"tags": {"a": [0, 1]}}, "tags"),
        ({"tag_cov_m2": [1, 2, 3]}, "tag_cov_m2"),
        ({"sigma": 1}, "sigma"),
        ({"prior": {"up_base": [0, 0, 1]}}, "T_base_cam"),
        ({"prior": {"up_cam": [0, 0, 0]}}, "up"),
    ],
)
def test_wrong_views_are_refused_by_name(tmp_path, change, word):
    path = tmp_path / "view.json"
    path.write_text(json.dumps(view()[0] | change))
    command = [sys.executable, "-m", "tagmap.cli", "localize", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert word in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.fixture
def tags_file(tmp_path):
    path = tmp_path / "tags.json"
    path.write_text(json.dumps({tag: TAGS[tag] for tag in "abc"}))
    return str(path)


def dop(tags_file, *more):
    place = ["--camera-position", "0.3,0.2,1.4", "--look-at", "0,0,0", *more]
    return CliRunner().invoke(cli, ["dop", "--tags", tags_file, *place])


def test_dop_answers_the_contract(tags_file):
    single = json.loads(dop(tags_file, "--focal-px", "1425", "--json").output)
    assert list(single) == [
        "pdop",
        "odop_deg_per_mm",
        "ppdop_mm_per_px",
        "podop_deg_per_px",
        "danger_cylinder_m",
    ]
    assert single["danger_cylinder_m"] == pytest.approx(1.0 - math.hypot(0.3, 0.2))
    stereo_pair = json.loads(dop(tags_file, "--rig", PRESET, "--json").output)
    assert stereo_pair["pdop"] < single["pdop"]


def test_dop_by_trial(tags_file):
    found = json.loads(
        dop(tags_file, "--focal-px", "1425", "--monte-carlo", "3000", "--json").output
    )
    for name in ("pdop", "odop_deg_per_mm", "ppdop_mm_per_px", "podop_deg_per_px"):
        assert found["monte_carlo"][name] == pytest.approx(found[name], rel=0.05)


def test_dop_of_too_few_tags_is_null(tmp_path):
    path = tmp_path / "two.json"
    path.write_text(json.dumps({tag: TAGS[tag] for tag in "ab"}))
    found = json.loads(dop(str(path), "--focal-px", "1425", "--json").stdout)
    assert set(found.values()) == {None}


def test_dop_wrong_usage(tags_file):
    assert dop(tags_file).exit_code == 2
    wrong = ["dop", "--tags", tags_file, "--camera-position", "1,2", "--look-at", "0,0,0"]
    assert CliRunner().invoke(cli, [*wrong, "--focal-px", "1"]).exit_code == 2


def test_coverage_writes_what_map_server_reads(tmp_path):
    rng = np.random.default_rng(0)
    tags = {f"t{i}": [*map(float, rng.uniform([0, 0], [6, 4])), 3.0] for i in range(20)}
    path = tmp_path / "tags.json"
    path.write_text(json.dumps(tags))
    stem = tmp_path / "floor"
    options = ["--rig", PRESET, "--mount-z-m", "0.5", "--tilt-rad", "1.3", "--cell-m", "0.5"]
    command = ["map", "coverage", "--tags", str(path), *options, "--out", str(stem), "--json"]
    result = CliRunner().invoke(cli, command)
    assert result.exit_code == 0, result.output
    facts = json.loads(result.output)
    assert facts["covered_share"] > 0.5
    assert 0.0 < facts["sigma_median_m"] < facts["sigma_p90_m"] < 0.1
    header, grey = (tmp_path / "floor.pgm").read_bytes().split(b"\n255\n", 1)
    kind, columns, rows = header.split()
    assert kind == b"P5"
    assert int(columns) * int(rows) == len(grey) == facts["cells"]
    yaml = (tmp_path / "floor.yaml").read_text()
    assert "image: floor.pgm" in yaml
    assert "resolution: 0.5" in yaml
    assert (tmp_path / "floor.png").read_bytes().startswith(b"\x89PNG")


MORE = TAGS | {"e": [0.5, 0.4, 0.1], "f": [-0.4, 0.5, 0.3]}


def test_a_moved_tag_is_left_out_and_the_rest_promised_anew(tmp_path):
    file, T = view(tags="abcdef", known=MORE)
    whole = answered(tmp_path, file)
    moved = answered(tmp_path, file | {"tags": MORE | {"b": [0.9, -0.3, 0.1]}})
    assert (moved["excluded"], moved["inliers"]) == (["b"], list("acdef"))
    assert (moved["state"], moved["dof"]) == ("good", 14)
    np.testing.assert_allclose(moved["T_map_cam"]["p_m"], T[:3, 3], atol=1e-6)
    assert moved["protection_level_m"] > whole["protection_level_m"]


def test_contradictions_without_a_majority_are_no_pose(tmp_path):
    file, _ = view()
    wrong = {"a": [0.5, 1.0, 0.0], "b": [1.0, -0.9, 0.3]}
    found = answered(tmp_path, file | {"tags": TAGS | wrong})
    assert (found["T_map_cam"], found["state"], found["inliers"]) == (None, "lost", [])
    assert found["chi2"] > 100.0
    assert "agrees" in found["reasons"][0]


def test_three_tags_are_promised_only_what_surer_tags_allow(tmp_path):
    file, _ = view(tags="abc")
    found = answered(tmp_path, file)
    assert (found["protection_level_m"], found["state"]) == (None, "degraded")
    assert "a, b, c" in found["reasons"][-1]
    sure = answered(tmp_path, file, "--p-wrong", "1e-6", "--p-swapped", "0")
    surer = answered(tmp_path, file, "--p-wrong", "1e-6", "--p-swapped", "0", "--risk", "1e-5")
    assert 0.0 < sure["protection_level_m"] < surer["protection_level_m"]


def test_the_level_is_that_of_the_base(tmp_path):
    mount = {"p_m": [0.0, 0.0, 3.0], "q_wxyz": [1.0, 0.0, 0.0, 0.0]}
    of_cam = answered(tmp_path, view()[0])
    of_base = answered(tmp_path, view(T_base_cam=mount)[0])
    assert of_base["protection_level_m"] > 1.5 * of_cam["protection_level_m"]


def test_promises_that_cannot_be_are_refused(tmp_path):
    file, _ = view()
    assert localize(tmp_path, file, "--risk", "2").exit_code == 2
    assert localize(tmp_path, file, "--risk", "1e-6", "--p-false-alarm", "1e-5").exit_code == 1
    service = {"kind": "spatial", "measurements": []}
    assert localize(tmp_path, service, "--risk", "1e-3").exit_code == 2
