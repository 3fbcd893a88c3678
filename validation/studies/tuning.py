"""Changes each tuning number of a package by 20 % and reports changed results.

    tools/run python validation/studies/tuning.py slosh_camera.cylinder [-o TABLE.csv]

A room is a package with a module `tuning`. A whole number is moved by 1 at least. Every process
imports the room anew and measures all scenes with one number changed; its compiled code is kept
in out/tuning.
"""

from __future__ import annotations

import argparse
import csv
import dataclasses
import importlib
import math
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from tqdm import tqdm
from tuning_scenes import (
    Answer,
    Scene,
    at_rest,
    bags,
    calibrated,
    detected,
    drawn,
    rendered,
    replayed,
    traced,
)

ROOT = Path(__file__).resolve().parents[2]
STEP = 0.2
HEAD = ("number", "unit", "value", "meaning")
SHOWN = ("RMS [mm]", "flags", "refused")


Answers = dict[str, list[Answer] | str]
"""By scene; words where it was refused."""


class Change(NamedTuple):
    """Changed results: rms of lengths [mm], images with other flags, refused scenes."""

    rms: float
    flags: int
    refused: int

    @property
    def told(self) -> tuple[str, int, int]:
        """Formats the changed results as a table cell."""
        return f"{self.rms:.3g}", self.flags, self.refused


def main() -> int:
    """Changes all tuning numbers of a package and prints the table; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("room", choices=ROOMS, help="package whose numbers are moved")
    parser.add_argument("-o", dest="output", type=argparse.FileType("w"), default=sys.stdout)
    parser.add_argument(
        "--only", default="", metavar="NAME", help="change only numbers with NAME in their name"
    )
    parser.add_argument("--workers", type=int, default=2, help="processes at a time")
    arguments = parser.parse_args()
    cv2.setNumThreads(1)
    os.environ["NUMBA_CACHE_DIR"] = str(ROOT / "out" / "tuning")
    context = multiprocessing.get_context("fork")
    with context.Pool(1, maxtasksperchild=1) as pool:
        rows = pool.apply(numbers_of, (arguments.room,))
        SCENES.update(pool.apply(prepared, (arguments.room,)))
    rows = [row for row in rows if arguments.only in row[0]]
    moves = [{name: moved(value, by)} for name, _, value, _ in rows for by in (-STEP, STEP)]
    still = []
    with context.Pool(arguments.workers, maxtasksperchild=1) as pool, arguments.output as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*HEAD, *(f"{sign}20 % {word}" for sign in "-+" for word in SHOWN)])
        usual = pool.apply(measured, (arguments.room, {}))
        found = pool.imap(partial(measured, arguments.room), moves)
        for row in tqdm(rows):
            low, high = change(usual, next(found)), change(usual, next(found))
            writer.writerow([*row, *low.told, *high.told])
            file.flush()
            still += [] if any((*low, *high)) else [row[0]]
    print(f"nothing changes with {len(still)} of {len(rows)}: {', '.join(still)}", file=sys.stderr)
    return 0


def numbers_of(room: str) -> list[tuple[str, str, Any, str]]:
    """Returns name, unit, value and meaning of each tuning number of a package."""
    tuning: Any = importlib.import_module(f"{room}.tuning").TUNING
    return [
        (one.name, one.metadata["unit"], getattr(tuning, one.name), one.metadata["meaning"])
        for one in dataclasses.fields(tuning)
    ]


def moved(value: Any, by: float) -> Any:
    """Returns a number, or each number of a tuple, changed by a relative amount."""
    if isinstance(value, tuple):
        return tuple(moved(one, by) for one in value)
    if isinstance(value, int):
        return value + round(math.copysign(max(1, round(abs(by * value))), by))
    return value * (1.0 + by)


def prepared(room: str) -> dict[str, Scene]:
    """Returns the test scenes of a package by name."""
    return {name: scene for make in ROOMS[room][0] for name, scene in make().items()}


def measured(room: str, numbers: dict[str, Any]) -> Answers:
    """Measures all scenes of a package with changed values of some tuning numbers."""
    module: Any = importlib.import_module(f"{room}.tuning")
    module.TUNING = dataclasses.replace(module.TUNING, **numbers)
    answers: Answers = {}
    for name, scene in SCENES.items():
        try:
            answers[name] = list(ROOMS[room][1](scene))
        except (ValueError, ArithmeticError, LookupError, TypeError, cv2.error) as error:
            answers[name] = str(error)
    return answers


def change(usual: Answers, other: Answers) -> Change:
    """Compares the results with usual and with changed tuning numbers."""
    differences, flags, refused = [0.0], 0, 0
    for name, before in usual.items():
        after = other[name]
        if isinstance(before, str) or isinstance(after, str):
            refused += type(before) is not type(after)
            continue
        for one, two in zip(before, after, strict=True):
            lengths = np.array([one.lengths, two.lengths])
            known = np.isfinite(lengths)
            flags += one.flags != two.flags or not np.array_equal(*known)
            differences += np.diff(lengths[:, known.all(axis=0)], axis=0).ravel().tolist()
    return Change(1e3 * float(np.sqrt(np.mean(np.square(differences)))), flags, refused)


Maker = Callable[[], dict[str, Scene]]
ROOMS: dict[str, tuple[list[Maker], Callable[[Scene], Iterator[Answer]]]] = {
    "slosh_camera.cylinder": ([rendered, drawn], detected),
    "slosh_camera.rectangle": ([traced], detected),
    "slosh_camera.images": ([rendered, drawn, traced], detected),
    "slosh_camera.calibrate": ([at_rest], calibrated),
    "slosh_estimator": ([bags], replayed),
}
SCENES: dict[str, Scene] = {}


if __name__ == "__main__":
    sys.exit(main())
