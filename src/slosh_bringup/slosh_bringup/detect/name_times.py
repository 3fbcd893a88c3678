"""Reads the times at which images were taken from the names of their files.

Recorders name a picture by its stamp: 1700000000033333333.png, cam_1700000000.033.png or
1700000000_33333333.png. A number is a stamp if it lies in this century in one unit for all files,
or if it grows by thousands from file to file, as no counter does.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slosh_base.files.nanoseconds import SECOND
from slosh_base.types import Array
from slosh_bringup.detect.frame import FOLDER_RATE

_NUMBER = re.compile(r"\d+")
_CENTURY = (946_684_800, 4_102_444_800)
"""Unix time of the years 2000 and 2100 [s]."""
_UNITS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": SECOND}
_RUNNING = (("ns", 1_000_000, 1_000_000_000), ("us", 1_000, 1_000_000))
"""Of stamps since the start of a clock: their unit, and its median step at 1 to 1000 Hz."""
_COUNTED = 5
"""Median step of a number up to which it is a counter without doubt."""


class NameTimes(NamedTuple):
    """The times in the names of files.

    Attributes:
        stamps_ns: of each file [ns].
        unit: in which they are written: ns, us, ms or s.
    """

    stamps_ns: list[int]
    unit: str


def name_times(files: Sequence[Path]) -> NameTimes | None:
    """Returns the times in the files' names; None if the names hold none that are sure.

    Args:
        files: images of one series.
    """
    columns = _columns(files)
    found = next((f for k in range(len(columns)) if (f := _dated(files, columns, k))), None)
    return found or _running(columns)


def doubtful_steps(files: Sequence[Path]) -> str:
    """Returns a warning if the names' number may be a time in milliseconds; empty: it is not."""
    steps = _steps(_changing(_columns(files)))
    if not len(steps) or np.median(steps) <= _COUNTED or np.ptp(steps) == 0:
        return ""
    return (
        f"the number in the names grows by {int(steps.min())} to {int(steps.max())}: counted as "
        f"images at {FOLDER_RATE:g} Hz; give --rate if it is a time"
    )


def _columns(files: Sequence[Path]) -> list[list[str]]:
    """Returns each number of the names, one column of all files each; [] if they are unlike."""
    if len(files) < 2 or len({_NUMBER.sub("#", file.name) for file in files}) > 1:
        return []
    rows = (_NUMBER.findall(file.name) for file in files)
    return [list(column) for column in zip(*rows, strict=True)]


def _dated(files: Sequence[Path], columns: Sequence[list[str]], k: int) -> NameTimes | None:
    """Returns Unix times that begin with the k-th number of the names."""
    values = [int(digits) for digits in columns[k]]
    low, high = _CENTURY
    unit = next(
        (u for u, size in _UNITS.items()
         if all(low * SECOND <= value * size < high * SECOND for value in values)),
        None,
    )  # fmt: skip
    if unit is None:
        return None
    stamps, part = [value * _UNITS[unit] for value in values], None
    if unit == "s" and k + 1 < len(columns):
        part = _below_a_second(columns[k + 1], _between(files[0].name, k))
        if part is not None:
            stamps = [stamp + more for stamp, more in zip(stamps, part, strict=True)]
    if len(set(stamps)) < len(stamps):
        return None
    return NameTimes(stamps, "s and ns" if part and _between(files[0].name, k) != "." else unit)


def _between(name: str, k: int) -> str:
    """Returns what stands between the k-th number of a name and the next one."""
    matches = list(_NUMBER.finditer(name))
    return name[matches[k].end() : matches[k + 1].start()]


def _below_a_second(column: Sequence[str], between: str) -> list[int] | None:
    """Returns the nanoseconds that follow the seconds; None if the number is something else."""
    lengths = {len(digits) for digits in column}
    if between == "." and max(lengths) <= 9:
        return [round(SECOND * float(f"0.{digits}")) for digits in column]
    if len(between) != 1 or max(lengths) > 9:
        return None
    if lengths in ({9}, {6}, {3}):
        return [int(digits) * 10 ** (9 - len(digits)) for digits in column]
    # Nanoseconds without leading zeros: most have nine digits.
    if 9 in lengths and all(digits == "0" or digits[0] != "0" for digits in column):
        return [int(digits) for digits in column]
    return None


def _running(columns: Sequence[list[str]]) -> NameTimes | None:
    """Returns times of a clock that began with the recording or the machine."""
    values = _changing(columns)
    steps = _steps(values)
    if not len(steps) or steps.min() <= 0:
        return None
    middle = float(np.median(steps))
    if np.ptp(steps) == 0 and math.log10(middle).is_integer():
        return None  # a counter in thousands
    unit = next((u for u, low, high in _RUNNING if low <= middle < high), None)
    return None if unit is None else NameTimes([_UNITS[unit] * v for v in values], unit)


def _changing(columns: Sequence[list[str]]) -> list[int]:
    """Returns the only number of the names that is not the same in all files."""
    found = [column for column in columns if len(set(column)) > 1]
    return [int(digits) for digits in found[0]] if len(found) == 1 else []


def _steps(values: Sequence[int]) -> Array:
    # As differences of whole numbers: those of a clock have more digits than a float.
    return np.array([b - a for a, b in pairwise(values)], dtype=np.float64)
