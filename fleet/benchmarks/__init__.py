"""How fast and how good the real programs are. Benchmarks are data: metrics, and what they were.

A suite measures everything several times in one run, each time next to a reference that suffers
from the same machine. Only such ratios, and accuracies, are compared with the committed baseline.
"""

NAMES = (
    "startup",
    "store",
    "service",
    "replay",
    "spots",
    "poses",
    "constellation",
    "integrity",
    "estimation",
    "scanner",
    "tag_memory",
    "activation",
    "harness",
)
