"""The demo, shortened: from nothing to a map, in a folder of its own choosing."""

import json
import subprocess
import sys
from pathlib import Path

from tagmap.store.check import check

SHORT = ("--duration-s", "20", "--speed", "20", "--json")


def test_a_demo_maps_tags_in_the_working_directory(tmp_path: Path):
    command = [sys.executable, "-m", "fleet.cli", "demo", *SHORT]
    done = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(done.stdout)
    (folder,) = tmp_path.iterdir()
    assert folder.name.startswith("demo-")
    assert Path(result["db"]) == folder / "site.db"
    assert result["keyframes_stored"] == result["keyframes_sent"] > 0
    assert result["landmarks"]["n"] >= 15
    assert result["landmarks"]["rmse_m"] < 0.03
    assert (tmp_path / result["floor_plan"]).read_bytes().startswith(b"\x89PNG")
    assert check(folder / "site.db") == []
