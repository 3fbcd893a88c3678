"""Write the table of the observer on measured runs: are left-out heights within its intervals?

    tools/run python validation/studies/observer_real.py [--docs] [--tune]

18 runs of a robot's cup and four cups on a tray (AntiSloshing; folders `antisloshing` and `tray`
of SLOSH_SHARED_DATA or ../shared/data). The commanded motion drives the observer. Of the measured
maxima it is given those of the first half of each second; it foretells the others, over one and a
half periods at most. The clock offset of a run is that of the best correlation of all its heights,
the still level that of its quiet part. One number is tuned, `STDDEV`, by the runs of `TUNED`.
"""

from __future__ import annotations

import argparse
import math
import sys
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
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import WallHeights
from slosh_estimator.sample import Sample
from slosh_estimator.tuning import TUNING
from slosh_metrics.alignment import despike, find_still_level
from slosh_model.kernel import UPRIGHT
from slosh_model.model import Model
from slosh_model.simulate import Inputs, simulate

TUNED = (*UNTILTED_FIT, *TILTED_FIT)
"""Runs that STDDEV was chosen by; the others are reported only."""
STDDEV = 2.5e-3
"""Standard deviation of a measured maximum in motion [m]: the cameras see the near wall alone."""
TRIED = (0.5e-3, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3)
USED, PERIOD, FIRST_NS = 0.5, 1.0, 1_000_000_000
"""The first part of each period is used [s], and the stamp of time zero [ns]."""
MOVES = 0.05
"""Acceleration of a container that moves [m/s²]."""
NIS = float(chi2.ppf(0.95, 1) / chi2.ppf(norm.cdf(TUNING.innovation_gate), 1))
"""Innovation over its limit that 95 % keep."""
HEAD = (
    "run", "tuned by", "heights left out", "open loop RMS [mm]", "foretold RMS [mm]",
    "inside 1.96 σ [%]", "NEES, mean", "NIS inside 95 % [%]", "rejected",
)  # fmt: skip


class Run(NamedTuple):
    """A measured run.

    Attributes:
        name: of it.
        model: of its liquid.
        motion: with its heights, on a clock of their own.
    """

    name: str
    model: Model
    motion: MeasuredMotion


class Found(NamedTuple):
    """What came of a run.

    Attributes:
        count: heights left out.
        opened, foretold: root mean square error of them [m].
        squares: of each error over its standard deviation.
        innovations: over their limits, of the heights that were given.
        rejected: of these.
    """

    count: int
    opened: float
    foretold: float
    squares: Array
    innovations: Array
    rejected: int


def main() -> int:
    """Runs the command; exit code 1 where the data are missing."""
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
    text = "\n".join(lines)
    print(text)
    if given.docs:
        fill(PAGE, "measured", text)
    return 0


def tune(runs: list[Run]) -> None:
    """Prints coverage and mean NEES of some standard deviations."""
    for stddev in TRIED:
        squares = np.concatenate([foretold(run, stddev).squares for run in runs])
        inside = 100.0 * np.mean(squares <= 1.96**2)
        print(f"{1e3 * stddev:.2f} mm: {inside:.1f} % inside, NEES {squares.mean():.2f}")


def row(name: str, told: str, parts: tuple[Found, ...]) -> str:
    """A row of the table from one or several runs, which count by their heights."""
    counts = np.array([one.count for one in parts], dtype=np.float64)
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
    """The runs with one cup."""
    upright = Model(ROBOT_CUP).spatial().nonlinear()
    kinds = {"": upright, "Tilt": upright.with_effect("gravity_tilt")}
    return [
        Run(name, model, motions[0])
        for prefix, model in kinds.items()
        for name, motions in runs_of_kind(prefix).items()
    ]


def tray_runs() -> list[Run]:
    """The four cups of the tray, at rest behind their motion."""
    motion = measured_tray.tray_motion()
    order, _ = measured_tray.made_order(motion)
    assert motion.attitude is not None
    rest = np.arange(1.0, 5001.0) * 1e-3
    inputs = Inputs(
        np.concatenate([motion.t, motion.t[-1] + rest]),
        np.vstack([motion.acceleration, np.zeros((len(rest), 3))]),
        np.vstack([motion.attitude, np.tile(motion.attitude[-1], (len(rest), 1))]),
    )
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
    """Runs the observer over a run and judges what it was not given.

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
    states, innovations, rejected = followed(run, t[given], points)
    begin = inputs.t[np.linalg.norm(inputs.acceleration, axis=1) > MOVES][0]
    left = ~given & (t > begin)
    expected, deviation, level = (np.interp(t[left], states[:, 0], c) for c in states.T[1:])
    error = height[left] - expected - level
    # As the filter has it: the height's own error, that of the wave's form, that in its size.
    form = TUNING.form_error * expected**2 / run.model.container.reaches[0]
    relative = TUNING.relative_error * expected
    variance = deviation**2 + spread**2 + 2.0 * form**2 + relative**2
    opened = np.interp(t[left], inputs.t, simulate(run.model, inputs)[0].msh) - height[left]
    return Found(
        int(left.sum()), *(float(np.sqrt(np.mean(one**2))) for one in (opened, error)),
        error**2 / variance, innovations, rejected,
    )  # fmt: skip


def still_level(motion: MeasuredMotion) -> tuple[float, float]:
    """Still level and noise of a run's heights [m]; those of the tray are stated to be zero."""
    assert motion.msh is not None
    if motion.level_known:
        return 0.0, 0.0
    still = find_still_level(motion.t, motion.msh)
    return still.level, still.noise


def followed(run: Run, t: Array, points: Array) -> tuple[Array, Array, int]:
    """(N, 4) times, heights, their deviations and levels; innovations; rejected heights.

    Args:
        run: the run.
        t: (M,) times of the heights that the observer is given [s].
        points: (M, 3) as of WallHeights, one for each.
    """
    observer, inputs = Observer(run.model), run.motion.inputs
    upright = np.tile(UPRIGHT, (len(inputs.t), 1))
    poses = inputs.poses if len(inputs.poses) else upright
    yaws = inputs.yaws if len(inputs.yaws) else np.zeros(len(inputs.t))
    states: list[tuple[float, ...]] = []
    innovations: list[float] = []
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
            innovations.append(observer.innovation)
        if state is not None:
            states.append((moment, state.msh, state.msh_stddev, state.level))
    rejected = sum(n for outcome, n in observer.counts.items() if outcome.value == "rejected")
    return np.array(states), np.array(innovations), rejected


if __name__ == "__main__":
    sys.exit(main())
