"""What `tagmap map coverage` computes and writes."""

from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from tagmap.errors import DataError
from tagmap.exchange.coverage_raster import write_picture, write_raster
from tagmap.exchange.tags_json import read_tags_json
from tagmap.localisation.coverage import Coverage, coverage
from tagmap.records.arrays import stereo_rig
from tagmap.records.rig_file import find_rig

LEAST_TAGS = 3
MOST_CELLS = 1_000_000


def cover(
    tags_path: Path,
    out: Path,
    worst_m: float,
    rig: str,
    mount_z_m: float,
    tilt_rad: float,
    cell_m: float,
) -> dict[str, Any]:
    """Raises DataError and ConfigError, which name the file."""
    tags = read_tags_json(tags_path)
    if len(tags) < LEAST_TAGS:
        raise DataError(f"{tags_path}: {len(tags)} tags, expected at least {LEAST_TAGS}")
    p_map = np.array(list(tags.values()))
    with np.errstate(over="ignore"):
        cells = np.prod(np.ptp(p_map[:, :2], axis=0) / cell_m + 1.0)
    if cells > MOST_CELLS:
        raise DataError(f"{cells:.0f} cells of {cell_m:g} m, expected at most {MOST_CELLS}")
    found = coverage(stereo_rig(find_rig(rig)), p_map, mount_z_m, tilt_rad, cell_m)
    try:
        files = write_raster(out, found, worst_m)
        with suppress(ImportError):
            files.append(write_picture(out, found, tags, worst_m))
    except OSError as error:
        raise DataError(f"{out}: cannot be written: {error.strerror}") from None
    return {"files": list(map(str, files)), **_summary(found)}


def _summary(found: Coverage) -> dict[str, Any]:
    known = found.sigma_m[np.isfinite(found.sigma_m)]
    median, tenth = np.quantile(known, [0.5, 0.9]) if len(known) else (None, None)
    return {
        "cells": found.sigma_m.size,
        "covered_share": len(known) / found.sigma_m.size,
        "sigma_median_m": None if median is None else float(median),
        "sigma_p90_m": None if tenth is None else float(tenth),
    }
