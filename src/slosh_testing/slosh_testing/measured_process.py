"""Runs a command in a process with a memory limit; measures memory peak and processor time."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

PATIENCE = 60.0
"""How long a command may take [s]."""
ADDRESS_SPACE = 12_000_000_000
"""More than any command needs, and less than would harm the machine [bytes]."""
# A process forked from a large one inherits its peak: a small one stands between.
_BETWEEN = """
import json, resource, subprocess, sys
limit, patience, words = json.loads(sys.argv[1])
resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
try:
    done = subprocess.run(words, capture_output=True, text=True, timeout=patience)
    ended = [done.returncode, done.stdout, done.stderr]
except subprocess.TimeoutExpired:
    ended = [-1, "", "it has not ended"]
usage = resource.getrusage(resource.RUSAGE_CHILDREN)
peak, took = usage.ru_maxrss * 1024, usage.ru_utime + usage.ru_stime
print(json.dumps([*ended, peak, took]))
"""


class Ended(NamedTuple):
    """Exit code, output, memory peak and processor time of an ended process.

    Attributes:
        code: its exit code.
        out, error: what it wrote.
        peak: the most memory it had, its children's too [bytes].
        seconds: of the processor, that it took.
    """

    code: int
    out: str
    error: str
    peak: int
    seconds: float


def run_slosh(*words: str | Path) -> Ended:
    """Runs `slosh` with given arguments under a memory limit."""
    command = [sys.executable, "-m", "slosh_bringup.cli", *map(str, words)]
    between = [
        sys.executable,
        "-S",
        "-c",
        _BETWEEN,
        json.dumps([ADDRESS_SPACE, PATIENCE, command]),
    ]
    done = subprocess.run(between, stdout=subprocess.PIPE, text=True, check=True)
    return Ended(*json.loads(done.stdout))
