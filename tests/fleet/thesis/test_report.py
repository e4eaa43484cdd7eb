"""What the folder holds: every figure and table, all numbers, and a page that needs no network."""

import re

import numpy as np
import pytest

from fleet.thesis import run as running
from fleet.thesis.effort import MEANING, SAMPLE
from fleet.thesis.report import number
from fleet.thesis.run import SECTIONS, run

FIGURES = ["figure_3_12", *(f"figure_4_{n}" for n in (5, 6, 7, 8, 9)), "danger_cylinder"]
TABLES = [f"table_4_{n}" for n in (1, 2, 3, 4, 5)]


def test_every_figure_and_table_is_there(report):
    assert list(report.sections) == FIGURES + TABLES
    assert report.contract["complete"] is True
    assert len(report.told) == len(SECTIONS)
    for section in report.sections.values():
        picture = (report.folder / section["picture"]).read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 10_000


def test_the_file_holds_what_was_returned(report):
    assert report.numbers == report.contract
    assert report.numbers["seed"] == report.seed
    assert report.numbers["effort"]["trials"] == report.effort.trials


def test_every_count_is_explained(report):
    assert list(MEANING) == list(report.numbers["effort"])
    for name, text in MEANING.items():
        assert f"<td>{name}</td>" in report.html
        assert text in report.html


def test_every_section_says_what_was_reported_found_and_assumed(report):
    for section in report.sections.values():
        keys = {"title", "reported", "finding", "assumed", "notes", "claims", "picture", "data"}
        assert set(section) == keys
        assert section["assumed"]
        assert section["claims"]
        for claim in section["claims"]:
            assert set(claim) == {"what", "thesis", "found", "unit", "holds"}
            assert np.isfinite(claim["found"])


def test_every_curve_sets_the_methods_beside_the_bound(report):
    for n in (5, 6, 7, 8, 9):
        for curve in report.sections[f"figure_4_{n}"]["data"]["curves"]:
            for name in curve["names"]:
                for method in ("bound", "thesis_method", "ours"):
                    assert len(curve[method][name]) == len(curve["tilt_deg"]) == 31
            assert curve["views_per_tilt"] == 40 * report.effort.trials


def test_every_row_sets_the_methods_beside_what_was_printed(report):
    for key in TABLES:
        rows = report.sections[key]["data"]["rows"]
        assert len(rows) == (9 if key in ("table_4_2", "table_4_3") else 3)
        for row in rows:
            assert set(row["thesis"]) == {"mean", "std"}
            for method in ("thesis_method", "ours"):
                assert set(row[method]) == {"mean", "std", "rms", "n", "lost"}
            assert row["bound"] > 0.0
            assert ("error" in row) != ("ours_both" in row)


def test_the_page_opens_offline(report):
    pictures = sorted(section["picture"] for section in report.sections.values())
    assert sorted(re.findall(r'src="([^"#]+)"', report.html)) == pictures
    assert sorted(re.findall(r'<a href="([^"#]+)"><img', report.html)) == pictures
    links = re.findall(r'href="([^"#]+)"', report.html)
    assert sorted(links) == sorted([*pictures, "numbers.json"])
    assert "http" not in report.html
    assert f"--seed {report.seed}" in report.html
    assert not re.search(r">(nan|inf|None)\b", report.html)
    for section in report.sections.values():
        assert section["title"] in report.html


def test_nothing_else_is_left_in_the_folder(report):
    pictures = {section["picture"] for section in report.sections.values()}
    assert {path.name for path in report.folder.iterdir()} == pictures | {
        "numbers.json",
        "report.html",
    }


def test_an_interrupted_run_keeps_what_it_has(tmp_path, monkeypatch):
    def interrupt(*_):
        raise KeyboardInterrupt

    begun = [("danger_cylinder", dict(SECTIONS)["danger_cylinder"]), ("table_4_1", interrupt)]
    monkeypatch.setattr(running, "SECTIONS", tuple(begun))
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, SAMPLE, 1, lambda _: None)
    page = (tmp_path / "report.html").read_text()
    assert "cut short: table_4_1" in page
    assert "<img" in page
    assert b'"complete": false' in (tmp_path / "numbers.json").read_bytes()
    assert (tmp_path / "danger-cylinder.png").exists()


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1.0, "1"), (12458.3, "12500"), (0.00012345, "0.000123"), (-41.81, "-41.8")],
)
def test_numbers_are_short(value, text):
    assert number(value) == text
