"""Memory of a process, for the benchmarks that state it."""

from __future__ import annotations

from pathlib import Path


def peak_memory() -> float:
    """Greatest memory of this process [MiB].

    Not from getrusage: that counts the process it was started by.
    """
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) / 1024
