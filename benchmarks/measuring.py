"""Common parts of the benchmarks: sizes, needed libraries, messages, time and memory."""

from __future__ import annotations

import argparse
import importlib.util
import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

NESTED, FIXED = 2, 3
"""Kinds of fields in rosbags: a message, an array of fixed length; greater: a sequence."""


def parsed(parser: argparse.ArgumentParser, **smallest: Any) -> argparse.Namespace:
    """Parses the command line of a benchmark.

    Args:
        parser: with the benchmark's options.
        smallest: values of options with `--smallest`, for a run that shows only that it works.
    """
    parser.add_argument("--smallest", action="store_true", help="only try whether it runs")
    if "--smallest" in sys.argv[1:]:
        parser.set_defaults(**smallest)
    return parser.parse_args()


def need(module: str, requirements: str) -> None:
    """Ends the benchmark with one line and exit code 2 if a library is not installed.

    Args:
        module: its Python module.
        requirements: file in the folder `requirements` that has it.
    """
    if importlib.util.find_spec(module) is None:
        program = Path(sys.argv[0]).stem
        remedy = f"tools/run python -m pip install --no-deps -r requirements/{requirements}"
        print(f"{program}: needs {module}, which is not installed: {remedy}", file=sys.stderr)
        raise SystemExit(2)


def with_own_modules(environment: Mapping[str, str]) -> dict[str, str]:
    """Returns an environment in which a benchmark's own processes find the modules beside it."""
    paths = [str(Path(__file__).parent), environment.get("PYTHONPATH", "")]
    return {**environment, "PYTHONPATH": os.pathsep.join(filter(None, paths))}


def header_of(store: Any, stamp_ns: int, frame: str) -> Any:
    """Returns a std_msgs/Header of a rosbags type store."""
    seconds, nanoseconds = divmod(stamp_ns, 10**9)
    stamp = store.types["builtin_interfaces/msg/Time"](sec=seconds, nanosec=nanoseconds)
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def message_of(store: Any, kind: str, number: Callable[[], float] = float, **given: Any) -> Any:
    """Returns a message with all fields that its definition has now.

    Args:
        store: rosbags type store that knows the type.
        kind: the type's name.
        number: returns the value of each floating-point field that is not given.
        given: values of fields; others are 0, "3D-NL" or, in sequences, two numbers.
    """
    values = dict(given)
    for name, (node, what) in store.fielddefs[kind][1]:
        if name in values:
            continue
        if node == NESTED:
            values[name] = message_of(store, what, number)
        elif node >= FIXED:
            length = what[1] if node == FIXED else 2
            values[name] = np.array([number() for _ in range(length)], what[0][1][0])
        elif what[0] in ("float64", "float32"):
            values[name] = number()
        else:
            values[name] = {"string": "3D-NL", "bool": False}.get(what[0], 0)
    return store.types[kind](**values)


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
