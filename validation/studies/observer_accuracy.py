"""Compares fused and open-loop heights with simulated true ones, with standard deviations.

    tools/run python validation/studies/observer_accuracy.py [--runs 100] [--half 1]

A simulated cup makes random moves. Its liquid differs from the estimator's model, its sensors are
noisy, its camera is late; see `drawn`. Even seeds (--half 0) are for tuning, odd ones (--half 1)
for reporting.
"""

from __future__ import annotations

import argparse
import math
import multiprocessing
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import with_tools  # noqa: F401
from camera_sequences import ROOT
from result_tables import fill
from scipy.stats import chi2, norm
from tqdm import tqdm

from slosh_base.types import Array
from slosh_estimator.estimator import Estimator
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import WallHeights
from slosh_estimator.tuning import TUNING
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, State, simulate
from slosh_motion.inputs.sampling import Sample

CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()
STEP, LENGTH, START_NS = 0.002, 10.0, 1_000_000_000
POINTS, HIGHEST = 12, 0.03
"""Points of an image, and the highest wave [m]."""
MEMORY = 0.15
"""How long a lasting error of the camera lasts [s]."""
NIS = float(chi2.ppf(0.95, POINTS) / chi2.ppf(norm.cdf(TUNING.innovation_gate), POINTS))
"""Innovation over its limit that 95 % keep."""
PAGE = ROOT / "docs" / "observer.md"
HEAD = (
    "case", "open loop RMS [mm]", "fused RMS [mm]", "ratio", "inside 1.96 σ [%]",
    "NIS inside 95 % [%]", "worst ratio",
)  # fmt: skip


class Case(NamedTuple):
    """What is wrong in a simulated run: model errors, initial wave, lost images.

    Attributes:
        name: for the table.
        frequency, damping: of the liquid over the model's; None: drawn.
        start: height of the wave at the beginning [m].
        blind: from when to when the camera sees nothing [s].
        judged: from when on errors count [s].
    """

    name: str
    frequency: float | None = None
    damping: float | None = None
    start: float = 0.0
    blind: tuple[float, float] = (math.inf, math.inf)
    judged: tuple[float, float] = (1.0, LENGTH)


CASES = (
    Case("usual errors"),
    Case("starts with a wave of 20 mm, after one period", start=0.02, judged=(0.35, 1.0)),
    Case("ζ × 3, ω × 0.97", 0.97, 3.0),
    Case("no camera for 5 s", blind=(4.0, 9.0), judged=(4.0, 9.0)),
)


class Drawn(NamedTuple):
    """True liquid and sensor errors of one simulated run.

    Attributes:
        truth: the liquid's model.
        gain, noise: of the accelerometer [1, m/s²].
        late: latency of the camera [s].
        clock: offset of its stamps [s].
        stddev: of a height; half of its variance is common to all points of an image, and lasts
            MEMORY [m].
        relative: error of a height as part of the wave; it lasts as long.
        crests: by how much crests are higher than troughs, κ in η + κ η²/R.
        level: error of the still level [m].
        rate: images a second.
    """

    truth: Model
    gain: float
    noise: float
    late: float
    clock: float
    stddev: float
    relative: float
    crests: float
    level: float
    rate: float


def main() -> int:
    """Simulates the runs and writes the table; returns the exit code."""
    rows = [(partial(run, case), partial(row, case.name)) for case in CASES]
    return write_table(__doc__, "accuracy", HEAD, rows)


def write_table(
    doc: str,
    name: str,
    head: Sequence[str],
    rows: Sequence[tuple[Callable[[int], Any], Callable[[Array], str]]],
    page: Path = PAGE,
) -> int:
    """Runs a study according to the command line; prints its table and writes it to a page.

    Args:
        doc: of the study.
        name: of the table on the page.
        head: of the table.
        rows: what is run for each seed, and what makes a row of all that it gives.
        page: that shows the table.

    Returns:
        the exit code.
    """
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("--runs", type=int, default=100, help="number of runs for each table row")
    parser.add_argument(
        "--half", type=int, default=1, choices=(0, 1), help="even (0) or odd (1) seeds"
    )
    parser.add_argument("--docs", action="store_true", help="write the table of the page")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    arguments = parser.parse_args()
    seeds = range(arguments.half, 2 * arguments.runs, 2)
    lines = ["| " + " | ".join(head) + " |", "|---" + "|--:" * (len(head) - 1) + "|"]
    with multiprocessing.get_context("fork").Pool(arguments.workers) as pool:
        for one, told in rows:
            found = pool.imap(one, seeds, chunksize=4)
            lines.append(told(np.array(list(tqdm(found, total=len(seeds), leave=False)))))
    text = "\n".join(lines)
    print(text)
    if arguments.docs:
        fill(page, name, text)
    return 0


def row(name: str, runs: Array) -> str:
    """Formats the results of many runs (N, 4) as a table row."""
    opened, fused = 1e3 * np.sqrt(runs[:, :2].mean(axis=0))
    inside, expected = 100.0 * runs[:, 2:4].mean(axis=0)
    worst = math.sqrt((runs[:, 1] / runs[:, 0]).max())
    return (
        f"| {name} | {opened:.2f} | {fused:.2f} | {fused / opened:.2f} | {inside:.1f} "
        f"| {expected:.1f} | {worst:.2f} |"
    )


def run(case: Case, seed: int) -> tuple[float, float, float, float]:
    """Simulates one run; returns mean squared errors [m²], share inside σ, and NIS."""
    rng = np.random.default_rng(seed)
    one = drawn(rng, case)
    t, acceleration = moves(rng)
    start = State(-1e-6, first_wave(rng, one.truth, case.start), np.zeros(4))
    while (wall := simulate(one.truth, Inputs(t, acceleration), start)[0]).msh.max() > HIGHEST:
        acceleration = 0.8 * acceleration
    images = seen(rng, one, case, t, np.column_stack([wall.sh_x, wall.sh_y]))
    estimator, observer = Estimator(CUP), Observer(CUP)
    measured = one.gain * acceleration + one.noise * rng.normal(size=acceleration.shape)
    errors, innovations, next_image = [], [], 0
    for i, stamp in enumerate(t):
        while next_image < len(images) and images[next_image][0] <= stamp:
            observer.take(images[next_image][1])
            next_image += 1
        ax, ay, az = measured[i].tolist()
        sample = Sample(stamp_of(stamp), ax, ay, az, restarted=i == 0)
        estimate, taken = estimator.update(sample), observer.taken
        state = observer.follow(sample, estimate.flags)
        if observer.taken > taken:
            innovations.append(observer.innovation <= NIS)
        if state is not None and case.judged[0] <= stamp < case.judged[1]:
            x, y = wall.sh_x[i], wall.sh_y[i]
            errors.append(
                (estimate.nonlinear.sh_x - x, estimate.nonlinear.sh_y - y, state.sh_x - x,
                 state.sh_y - y, state.sh_x_stddev, state.sh_y_stddev)
            )  # fmt: skip
    found = np.array(errors)
    inside = np.abs(found[:, 2:4]) <= 1.96 * found[:, 4:6]
    opened, fused = (float((found[:, k : k + 2] ** 2).mean()) for k in (0, 2))
    return opened, fused, float(inside.mean()), float(np.mean(innovations))


def stamp_of(t: float) -> int:
    """Converts a time [s] to a stamp [ns]."""
    return START_NS + round(t * 1e9)


def drawn(rng: np.random.Generator, case: Case) -> Drawn:
    """Draws a true liquid and sensors with usual errors."""
    frequency = case.frequency or float(rng.normal(1.0, 0.012))
    damping = case.damping or float(np.exp(rng.normal(0.0, 0.4)))
    truth = CUP.with_effect("frequency_mismatch", factor=frequency)
    truth = truth.with_effect("damping_mismatch", factor=damping)
    truth = truth.with_effect("surface_nonlinearity", alpha=float(rng.uniform(0.45, 0.7)))
    return Drawn(
        truth, float(rng.normal(1.0, 0.01)), float(rng.uniform(0.01, 0.1)),
        float(rng.uniform(0.01, 0.2)), float(rng.normal(0.0, 0.002)),
        float(rng.uniform(1e-4, 4e-4)), float(rng.uniform(0.0, 0.03)),
        float(rng.uniform(0.0, 0.4)), float(rng.normal(0.0, 2e-4)),
        float(rng.choice([30.0, 60.0])),
    )  # fmt: skip


def moves(rng: np.random.Generator) -> tuple[Array, Array]:
    """Draws times [s] and accelerations [m/s²] of point-to-point moves."""
    t = np.arange(0.0, LENGTH, STEP)
    acceleration = np.zeros((len(t), 3))
    begin = 0.5 + rng.uniform(0.0, 0.3)
    while begin < LENGTH - 1.0:
        length, peak = rng.uniform(0.3, 1.2), rng.uniform(0.3, 3.0)
        azimuth = rng.uniform(0.0, 2.0 * np.pi)
        u = (t - begin) / length
        pulse = np.where((u >= 0.0) & (u < 1.0), peak * np.sin(2.0 * np.pi * u), 0.0)
        direction = (np.cos(azimuth), np.sin(azimuth), rng.uniform(-0.4, 0.4))
        acceleration += pulse[:, np.newaxis] * np.array(direction)
        begin += length + rng.uniform(0.0, 1.5)
    return t, acceleration


def first_wave(rng: np.random.Generator, truth: Model, height: float) -> Array:
    """Returns the modal state (1, 4) of a wave of given height, random phase and direction."""
    (mode,) = truth.mode_constants()
    place = height / truth.height_gains((mode,), 0)[0]
    azimuth, phase = rng.uniform(0.0, 2.0 * np.pi, 2)
    out = np.array([np.cos(azimuth), np.sin(azimuth)])
    rate = -mode.natural_frequency * np.sin(phase)
    return place * np.concatenate([np.cos(phase) * out, rate * out])[np.newaxis]


def seen(
    rng: np.random.Generator, one: Drawn, case: Case, t: Array, wall: Array
) -> list[tuple[float, WallHeights]]:
    """Yields the arrival times of images [s], with the wall heights that they show."""
    images = []
    lasting, kept = rng.normal(size=2), math.exp(-1.0 / (one.rate * MEMORY))
    for moment in np.arange(rng.uniform(0.0, 1.0 / one.rate), t[-1], 1.0 / one.rate):
        lasting = kept * lasting + math.sqrt(1.0 - kept**2) * rng.normal(size=2)
        azimuth = np.linspace(-np.pi, np.pi, POINTS, endpoint=False)
        noise = math.sqrt(0.5) * (lasting[0] + rng.normal(size=POINTS))
        if case.blind[0] <= moment < case.blind[1]:
            continue
        x, y = (np.interp(moment, t, wall[:, k]) for k in range(2))
        height = x * np.cos(azimuth) + y * np.sin(azimuth)
        read = height * (1.0 + one.relative * lasting[1]) + one.level + one.stddev * noise
        read += one.crests * height**2 / CUP.container.reaches[0]
        points = np.column_stack([azimuth, read, np.full(POINTS, one.stddev)])
        images.append((moment + one.late, WallHeights(stamp_of(moment + one.clock), points)))
    return images


if __name__ == "__main__":
    sys.exit(main())
