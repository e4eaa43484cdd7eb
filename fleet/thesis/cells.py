"""The rows of the tables as the report shows them: as printed, and what the thesis had no way of
knowing."""

from typing import Any

from fleet.thesis.section import Table


def as_printed(quantity: str, rows: list[dict[str, Any]]) -> Table:
    columns = (
        "distance, m",
        "baseline, mm",
        "",
        "thesis: mean",
        "thesis: STD",
        "its method: mean",
        "STD",
        "RMS",
        "ours: mean",
        "STD",
        "RMS",
        "expected RMS",
    )
    cells = tuple(
        (
            row["distance_m"],
            row["baseline_mm"],
            row["quantity"],
            *(row["thesis"][k] for k in ("mean", "std")),
            *(row["thesis_method"][k] for k in ("mean", "std", "rms")),
            *(row["ours"][k] for k in ("mean", "std", "rms")),
            row["bound"],
        )
        for row in rows
    )
    return Table(f"As printed: {quantity}", columns, cells)


def beyond(rows: list[dict[str, Any]]) -> Table:
    head = ("distance, m", "baseline, mm", "")
    place = ("distance_m", "baseline_mm", "quantity")
    if "ours_both" in rows[0]:
        columns = (*head, "ours, both images: RMS", "bound")
        cells = tuple(
            (*(row[k] for k in place), row["ours_both"]["rms"], row["bound_both"]) for row in rows
        )
        return Table("The same from both images", columns, cells)
    names = {
        "thesis_single": "its method, one image",
        "ours_single": "ours, one image",
        "bound_single": "bound",
        "thesis_stereo": "its method, two images",
        "ours_both": "ours, two images",
        "bound_both": "bound",
    }
    cells = tuple((*(row[k] for k in place), *(row["error"][k] for k in names)) for row in rows)
    unit = rows[0]["unit"]
    return Table(f"RMS error against the truth, {unit}", (*head, *names.values()), cells)
