"""The process of one task: see fleet.benchmarks.estimation.process."""

import sys

import msgspec

from fleet.benchmarks.estimation.process import Task
from fleet.benchmarks.estimation.work import work

sys.stdout.buffer.write(msgspec.json.encode(work(msgspec.json.decode(sys.argv[1], type=Task))))
