"""Measures time and memory of what the benchmarks run."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path


def timed(work: Callable[[], object]) -> float:
    """Returns the elapsed time of a function call [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def peak_memory() -> float:
    """Returns the peak memory of this process [MiB].

    Not from getrusage: that counts the process it was started by.
    """
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024


def greatest_memory(program: str, *words: Path) -> float:
    """Returns the peak memory [MiB] that `PROGRAM --measure WORD…` prints in its last line."""
    command = [sys.executable, program, "--measure", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return float(done.stdout.splitlines()[-1])
