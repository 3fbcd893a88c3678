"""Tests on measured runs whether left-out heights lie within the observer's intervals.

    tools/run python validation/studies/observer_real.py [--docs] [--tune]

18 runs of a robot's cup and four cups on a tray (AntiSloshing; folders `antisloshing` and `tray`
of SLOSH_SHARED_DATA or ../shared/data). The commanded motion drives the observer. Of the measured
maxima it is given those of the first half of each second; it foretells the others, over one and a
half periods at most. The clock offset of a run is that of the best correlation of all its heights,
the still level that of its quiet part. One number is tuned, `STDDEV`, by the runs of `TUNED`.

The second table is of the stops of the twelve upright runs: when the heights stay within
TOLERANCE, when calm is told with all heights and without any, and what is seen behind that.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Mapping
from typing import NamedTuple

import measured_tray
import numpy as np
import with_tools  # noqa: F401
from discovery_findings import ROBOT_CUP, TILTED_FIT, UNTILTED_FIT, runs_of_kind
from observer_accuracy import PAGE
from result_tables import fill
from scipy.io import loadmat
from scipy.stats import chi2, norm
from tqdm import tqdm

from slosh_base.types import Array
from slosh_discovery.discover import MeasuredMotion
from slosh_discovery.discover.clock import first_offset
from slosh_discovery.discover.problem import prepare
from slosh_estimator.observer.calm import CalmWatch
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import FusedState, Outcome, WallHeights
from slosh_estimator.tuning import TUNING
from slosh_model.kernel import UPRIGHT
from slosh_model.model import Model
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.sampling import Sample
from slosh_motion.signals.alignment import despike, find_still_level
from slosh_replay.tables.antisloshing import read_heights

TUNED = (*UNTILTED_FIT, *TILTED_FIT)
"""Runs that STDDEV was chosen by; the others are reported only."""
STDDEV = 2.5e-3
"""Standard deviation of a measured maximum in motion [m]: the cameras see the near wall alone."""
TRIED = (0.5e-3, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3)
USED, PERIOD, FIRST_NS = 0.5, 1.0, 1_000_000_000
"""The first part of each period is used [s], and the stamp of time zero [ns]."""
REST, STEP = 60.0, 0.002
"""Rest behind a stop, and step of its samples [s]."""
MOVES = 0.05
"""Acceleration of a container that moves [m/s²]."""
NIS = float(chi2.ppf(0.95, 1) / chi2.ppf(norm.cdf(TUNING.innovation_gate), 1))
"""Innovation over its limit that 95 % keep."""
TOLERANCE = 3e-3
"""Of a calm wave at the real stops [m]: the heights do not tell of lower ones."""
STOP_HEAD = (
    "stop", "record behind it [s]", "measured calm [s]", "told with heights [s]",
    "told without [s]",
    "highest after with [mm]", "highest after without [mm]",
)  # fmt: skip
HEAD = (
    "run", "tuned by", "heights left out", "open loop RMS [mm]", "foretold RMS [mm]",
    "inside 1.96 σ [%]", "NEES, mean", "NIS inside 95 % [%]", "rejected",
)  # fmt: skip


class Run(NamedTuple):
    """A measured run: its name, model and motion with heights.

    Attributes:
        name: of it.
        model: of its liquid.
        motion: with its heights, on a clock of their own.
    """

    name: str
    model: Model
    motion: MeasuredMotion


class Found(NamedTuple):
    """Results of the observer on one run: errors of the left-out heights.

    Attributes:
        heights: number of those left out.
        opened, foretold: root mean square error of them [m].
        squares: of each error over its standard deviation.
        innovations: over their limits, of the heights that were given.
        rejected: of these.
    """

    heights: int
    opened: float
    foretold: float
    squares: Array
    innovations: Array
    rejected: int


class Followed(NamedTuple):
    """The observer's fused states, innovations and counts in one run.

    Attributes:
        states: its fused states.
        innovations: over their limits, one for each step that used measurements.
        counts: of the measurements, by outcome.
    """

    states: list[FusedState]
    innovations: list[float]
    counts: Mapping[Outcome, int]


def main() -> int:
    """Runs the study and writes the tables; returns 1 if the data are missing."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true", help="write the table of the page")
    parser.add_argument("--tune", action="store_true", help="try standard deviations on TUNED")
    given = parser.parse_args()
    if not (measured_tray.DATA / "tray").is_dir():
        print(f"observer_real: no data in {measured_tray.DATA}", file=sys.stderr)
        return 1
    cups = robot_runs()
    if given.tune:
        tune([run for run in cups if run.name in TUNED])
        return 0
    lines = ["| " + " | ".join(HEAD) + " |", "|---" + "|--:" * (len(HEAD) - 1) + "|"]
    runs = [*cups, *tray_runs()]
    all_found = {run.name: foretold(run, STDDEV) for run in tqdm(runs, leave=False)}
    lines += [row(name, "yes" if name in TUNED else "", (one,)) for name, one in all_found.items()]
    for told, names in (("yes", TUNED), ("", tuple(set(all_found) - set(TUNED)))):
        lines.append(row("**all**", told, tuple(all_found[name] for name in names)))
    stops = ["| " + " | ".join(STOP_HEAD) + " |", "|---" + "|--:" * (len(STOP_HEAD) - 1) + "|"]
    upright = [run for run in cups if not run.name.startswith("Tilt")]
    stops += [stop_row(run) for run in tqdm(upright, leave=False)]
    for name, table in (("measured", lines), ("stops", stops)):
        text = "\n".join(table)
        print(text)
        if given.docs:
            fill(PAGE, name, text)
    return 0


def stop_row(run: Run) -> str:
    """Formats a run's table row of reported and actual calm after its stop."""
    inputs, t, height, end = whole_record(run)
    high = t[(height > TOLERANCE) & (t > end)]
    needed = float(high[-1]) - end if len(high) else 0.0
    unended = needed > 0.0 and high[-1] > t[-1] - 1.0
    cells = [run.name, f"{t[-1] - end:.1f}", f"{'> ' if unended else ''}{needed:.1f}"]
    seen = np.column_stack([np.full(len(t), math.nan), height, np.full(len(t), STDDEV)])
    highest = []
    for points in (seen, seen[:0]):
        watch = CalmWatch(TOLERANCE)
        states = followed(run.model, inputs, t[: len(points)], points).states
        calm = [one for one in map(watch.update, states) if one.calm]
        moments = [1e-9 * (one.stamp_ns - FIRST_NS) - end for one in calm]
        told = next((moment for moment in moments if moment > 0.0), math.inf)
        behind = height[t > end + told]
        highest.append(f"{1e3 * behind.max():.1f}" if len(behind) else "")
        cells.append(f"{told:.1f}" if told < math.inf else "never")
    return "| " + " | ".join([*cells, *highest]) + " |"


def whole_record(run: Run) -> tuple[Inputs, Array, Array, float]:
    """Returns a run up to its last height, with the rest after the motion.

    Returns:
        the motion; (M,) times of the heights on its clock [s] and heights [m]; when it ends [s].
    """
    motion, inputs = run.motion, run.motion.inputs
    assert motion.msh is not None
    t, height = read_heights(measured_tray.DATA / "antisloshing" / "heights" / f"{run.name}.mat")
    first = int(np.flatnonzero(height == motion.msh[0])[0])
    level, _ = still_level(motion)
    t = t - t[first] + motion.t[0] - first_offset(prepare(motion), run.model)
    height = despike(height) - level
    known = np.isfinite(height) & (t >= inputs.t[0])
    moves = inputs.t[np.linalg.norm(inputs.acceleration, axis=1) > MOVES]
    return rested(inputs, REST), t[known], height[known], float(moves[-1])


def rested(inputs: Inputs, seconds: float) -> Inputs:
    """Returns a motion followed by a rest of given duration [s]."""
    rest = np.arange(STEP, seconds, STEP)
    attitude = inputs.attitude
    assert attitude is not None
    return Inputs(
        np.concatenate([inputs.t, inputs.t[-1] + rest]),
        np.vstack([inputs.acceleration, np.zeros((len(rest), 3))]),
        np.vstack([attitude, np.tile(attitude[-1], (len(rest), 1))]),
    )


def tune(runs: list[Run]) -> None:
    """Prints coverage and mean NEES for several standard deviations of heights."""
    for stddev in TRIED:
        squares = np.concatenate([foretold(run, stddev).squares for run in runs])
        inside = 100.0 * np.mean(squares <= 1.96**2)
        print(f"{1e3 * stddev:.2f} mm: {inside:.1f} % inside, NEES {squares.mean():.2f}")


def row(name: str, told: str, parts: tuple[Found, ...]) -> str:
    """Formats the results of one or several runs as a table row."""
    counts = np.array([one.heights for one in parts], dtype=np.float64)
    opened, error = (
        1e3 * math.sqrt(np.average([getattr(one, key) ** 2 for one in parts], weights=counts))
        for key in ("opened", "foretold")
    )
    squares = np.concatenate([one.squares for one in parts])
    innovations = np.concatenate([one.innovations for one in parts])
    return (
        f"| {name} | {told} | {counts.sum():.0f} | {opened:.2f} | {error:.2f} "
        f"| {100.0 * np.mean(squares <= 1.96**2):.0f} | {squares.mean():.2f} "
        f"| {100.0 * np.mean(innovations <= NIS):.0f} | {sum(one.rejected for one in parts)} |"
    )


def robot_runs() -> list[Run]:
    """Reads the measured runs with one cup."""
    upright = Model(ROBOT_CUP).spatial().nonlinear()
    kinds = {"": upright, "Tilt": upright.with_effect("gravity_tilt")}
    return [
        Run(name, model, motions[0])
        for prefix, model in kinds.items()
        for name, motions in runs_of_kind(prefix).items()
    ]


def tray_runs() -> list[Run]:
    """Reads the measured runs of the four cups on the tray, with a rest added."""
    motion = measured_tray.tray_motion()
    order, _ = measured_tray.made_order(motion)
    inputs = rested(Inputs(motion.t, motion.acceleration, motion.attitude), 5.0)
    runs = []
    cups = measured_tray.tray_of(order).containers
    for number, cup in zip(measured_tray.CUPS, cups, strict=True):
        name = f"{measured_tray.RUN}_c{number}"
        data = loadmat(measured_tray.DATA / "tray" / f"container_{number}_full_slosh_{name}.mat")
        heights = 1e-3 * (data["world_points"][:, 1] - data["h0_point"].item())
        measured = MeasuredMotion(
            name, inputs, data["slosh_times"].ravel(), msh=heights, same_clock=False,
        )  # fmt: skip
        runs.append(Run(f"tray {name}", cup.placed, measured))
    return runs


def foretold(run: Run, stddev: float) -> Found:
    """Runs the observer over a run and evaluates the heights that were withheld from it.

    Args:
        run: the run.
        stddev: of a measured height in motion [m].
    """
    motion, inputs = run.motion, run.motion.inputs
    assert motion.msh is not None
    level, noise = still_level(motion)
    t = motion.t - first_offset(prepare(motion), run.model)
    known = (t >= inputs.t[0]) & (t <= inputs.t[-1])
    height = despike(motion.msh) - level
    known &= np.isfinite(height)
    t, height = t[known], height[known]
    spread = math.hypot(stddev, noise)
    given = t % PERIOD < USED
    points = np.array([[math.nan, one, spread] for one in height[given]])
    states, innovations, counts = followed(run.model, inputs, t[given], points)
    moments = np.array([1e-9 * (state.stamp_ns - FIRST_NS) for state in states])
    told = np.array([(state.msh, state.msh_stddev, state.level) for state in states])
    begin = inputs.t[np.linalg.norm(inputs.acceleration, axis=1) > MOVES][0]
    left = ~given & (t > begin)
    expected, deviation, level = (np.interp(t[left], moments, column) for column in told.T)
    error = height[left] - expected - level
    # As the filter has it: the height's own error, that of the wave's form, that in its size.
    form = TUNING.form_error * expected**2 / run.model.container.reaches[0]
    relative = TUNING.relative_error * expected
    variance = deviation**2 + spread**2 + 2.0 * form**2 + relative**2
    opened = np.interp(t[left], inputs.t, simulate(run.model, inputs)[0].msh) - height[left]
    rms = [float(np.sqrt(np.mean(one**2))) for one in (opened, error)]
    return Found(
        int(left.sum()), rms[0], rms[1], error**2 / variance, np.array(innovations),
        counts[Outcome.REJECTED],
    )  # fmt: skip


def still_level(motion: MeasuredMotion) -> tuple[float, float]:
    """Returns still level and noise of a run's heights [m]."""
    assert motion.msh is not None
    if motion.level_known:
        return 0.0, 0.0
    still = find_still_level(motion.t, motion.msh)
    return still.level, still.noise


def followed(model: Model, inputs: Inputs, t: Array, points: Array) -> Followed:
    """Runs the observer over a motion with given measurements.

    Args:
        model: of the liquid.
        inputs: the motion.
        t: (M,) times of the heights that it is given [s].
        points: (M, 3) as of WallHeights, one for each.
    """
    observer = Observer(model)
    found = Followed([], [], observer.counts)
    upright = np.tile(UPRIGHT, (len(inputs.t), 1))
    poses = inputs.poses if len(inputs.poses) else upright
    yaws = inputs.yaws if len(inputs.yaws) else np.zeros(len(inputs.t))
    following = 0
    for i, moment in enumerate(inputs.t):
        while following < len(t) and t[following] <= moment:
            stamp_ns = FIRST_NS + round(1e9 * t[following])
            observer.take(WallHeights(stamp_ns, points[following : following + 1]))
            following += 1
        ax, ay, az = inputs.acceleration[i].tolist()
        taken = observer.taken
        state = observer.follow(
            Sample(
                FIRST_NS + round(1e9 * moment), ax, ay, az, float(yaws[i]), i == 0,
                tuple(poses[i].tolist()),
            )
        )  # fmt: skip
        if observer.taken > taken:
            found.innovations.append(observer.innovation)
        if state is not None:
            found.states.append(state)
    return found


if __name__ == "__main__":
    sys.exit(main())
