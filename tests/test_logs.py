"""A log that nobody can read any more does not end the process that writes it."""

import subprocess
import sys

PROGRAM = """
import os, structlog
from tagmap import logs
logs.configure()
structlog.get_logger().info("before")
os.close(2)
structlog.get_logger().info("after")
print("lives")
"""


def test_stderr_that_is_gone_does_not_matter() -> None:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout) == (0, "lives\n")
    assert '"event": "before"' in done.stderr
