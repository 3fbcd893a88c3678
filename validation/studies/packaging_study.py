"""Repeats TM20's study with 1,530 simulated experiments; compares tables and figures.

Experiments that are there already are not carried out again: an interrupted study goes on.

    tools/run python validation/studies/packaging_study.py [-o out/study] [--jobs N] [--docs]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TypeVar

import with_tools  # noqa: F401
from result_tables import with_files
from tm20.camera_sample import Sample, sample
from tm20.design import GEOMETRIES, IDENTIFICATION, SPEEDS, VALIDATION, Series
from tm20.drawings import draw_all
from tm20.evaluation import M1, M2, Findings, Study, fits, residual, standard_error, validity
from tm20.experiments import EDGES, Experiment, Measured, measure, read
from tm20.line_limits import TRUTHS, limits
from tm20.page import page

from slosh_base.files.new_file import NewFile
from slosh_bringup.cli.progress import Progress, Unit, say
from slosh_bringup.many_files import map_files

Item = TypeVar("Item")
Value = TypeVar("Value")
ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs" / "results" / "packaging_study.md"
IMAGES = ROOT / "docs" / "images"
SAMPLES = tuple((geometry.number, 36) for geometry in GEOMETRIES)
"""Experiments that go through the whole camera."""


def experiments(series: Series, folder: Path) -> list[Experiment]:
    """Returns all experiments of a series, those that take longest first."""
    return [
        Experiment(geometry.number, series.law, speed, series.repetitions, EDGES, folder)
        for speed in SPEEDS
        for geometry in GEOMETRIES
    ]


def evaluated(geometry: int, folder: Path) -> Findings:
    """Evaluates the experiments of one container."""

    def measured(series: Series) -> list[Measured]:
        every = experiments(series, folder)
        return [read(one) for one in every if one.geometry == geometry]

    identifying, validating = measured(IDENTIFICATION), measured(VALIDATION)
    limits = validity(identifying)
    valid = [one for one in identifying if one.experiment.speed <= limits.fastest]
    first, second = fits(valid, M1), fits(valid, M2)
    usable = [
        one for one in validating if one.experiment.speed <= limits.fastest and not one.broke
    ]
    model = first.overall.model
    return Findings(
        limits,
        first,
        second,
        {one.experiment.speed: standard_error(one, model) for one in usable},
        {one.experiment.speed: residual(one, model) for one in usable},
    )


def _sample(item: tuple[int, int]) -> Sample:
    return sample(*item)


def carry_out(folder: Path, jobs: int | None) -> Study:
    """Runs missing experiments and evaluates all.

    Raises:
        RuntimeError: an experiment or its evaluation failed.
    """
    begun = time.monotonic()
    folder.mkdir(parents=True, exist_ok=True)
    every = [*experiments(IDENTIFICATION, folder), *experiments(VALIDATION, folder)]
    _run("experiments", measure, every, jobs)
    samples = _run("camera", _sample, SAMPLES, jobs)
    bent = _run("limits", limits, TRUTHS, jobs)
    numbers = [geometry.number for geometry in GEOMETRIES]
    found = _run("models", partial(evaluated, folder=folder), numbers, jobs)
    return Study(
        dict(zip(numbers, found, strict=True)),
        dict(zip(numbers, samples, strict=True)),
        tuple(bent),
        sum(one.repetitions for one in every),
        time.monotonic() - begun,
    )


def _run(
    name: str, work: Callable[[Item], Value], items: Sequence[Item], jobs: int | None
) -> list[Value]:
    """Runs a function for all items in parallel; returns the values in the items' order."""
    values: dict[int, Value] = {}
    with Progress(name, len(items), Unit(name)) as progress:
        for outcome in map_files(work, items, jobs=jobs):
            if outcome.value is None:
                raise RuntimeError(f"{name}, {outcome.item}: {outcome.error}")
            values[outcome.index] = outcome.value
            progress.add()
    return [values[index] for index in range(len(items))]


def main() -> int:
    """Runs the study and writes its page; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=Path, default=ROOT / "out" / "study")
    parser.add_argument("--jobs", type=int, help="processes; one for each core")
    parser.add_argument("--docs", action="store_true", help="write the page in docs/")
    arguments = parser.parse_args()
    try:
        study = carry_out(arguments.output, arguments.jobs)
    except (RuntimeError, OSError, ValueError) as error:
        print(f"study: {error}", file=sys.stderr)
        return 2
    target = DOCS if arguments.docs else arguments.output / "study.md"
    images = IMAGES if arguments.docs else arguments.output
    for name, drawing in draw_all(study).items():
        with NewFile(images / name) as file, file.open() as stream:
            stream.write(drawing.encode())
    with NewFile(target) as file, file.open() as stream:
        text = page(study, "../images/" if arguments.docs else "")
        stream.write((with_files(target, "", text) if arguments.docs else text).encode())
    say(f"{target}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
