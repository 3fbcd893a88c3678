"""Compares models with a measured tank: identified on half of a record, tested on the rest.

The wave at a wall of a tank 1.73 m wide in forced sway (Faltinsen, Rognebakke, Lukovsky, Timokha,
J. Fluid Mech. 407, 2000), from SLOSH_SHARED_DATA or ../shared/data. Writes the tables of
docs/results/measured_tank.md, and into out/measured_tank the files that the page's commands read.

    tools/run python validation/studies/measured_tank.py
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from camera_tables import replace_table
from numpy.typing import NDArray
from scipy.optimize import least_squares

from slosh_discovery.discover import discover
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.identify import identify
from slosh_model.measure import predicted_heights
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs
from slosh_motion.signals.metrics import rms_error
from slosh_testing.multimodal import Tanks, simulate_tanks

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "results" / "measured_tank.md"
FILES = ROOT / "out" / "measured_tank"
DATA = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
WIDTH, FILL_HEIGHT = 1.73, 0.6  # m
DEPTH = 0.2  # m; across the motion, where nothing happens
AMPLITUDE, PERIOD = 0.032, 1.3  # of the sway [m, s]
PROBE = 0.05  # m from the wall at -x
HALF = 5.0  # s
STEP = 0.01  # s, of the computed waves
WALL = np.array([math.pi])
MODES = 5  # of the linear multimodal theory
M1 = ("natural_frequency", "damping_ratio")


@dataclass(frozen=True, slots=True)
class Record:
    """Heights [m] at the tank's probe over time [s]."""

    t: Array
    height: Array

    def half(self, *, second: bool) -> Record:
        """Returns the half of the record for identification, or that for prediction."""
        chosen = (self.t >= HALF) == second
        return Record(self.t[chosen], self.height[chosen])


@dataclass(frozen=True, slots=True)
class Candidate:
    """A model's name, identified parameters as text, and heights over time."""

    name: str
    found: str
    heights: Callable[[Array], Array]


def main() -> int:
    """Compares the models and writes the tables; returns the exit code."""
    file = DATA / "faltinsen2000" / "height.csv"
    if not file.is_file():
        print(f"measured_tank: {file} is not there; set SLOSH_SHARED_DATA", file=sys.stderr)
        return 2
    record = read(file)
    table = compared(record, candidates(record))
    print(table)
    replace_table(PAGE, "models", table)
    finding = found_gap(record)
    print(finding)
    replace_table(PAGE, "gap", finding)
    write_files(record)
    answer = told()
    print(answer)
    replace_table(PAGE, "modes", answer)
    return 0


def read(file: Path) -> Record:
    """Reads the digitised heights in order of time, one for each time."""
    points = np.loadtxt(file, delimiter=",", skiprows=1)
    t, first = np.unique(points[:, 0], return_index=True)
    return Record(t, points[first, 1])


def acceleration(t: Array) -> Array:
    """Returns the tank's acceleration along x at given times [m/s²]."""
    rate = 2.0 * math.pi / PERIOD
    return np.asarray(-AMPLITUDE * rate**2 * np.cos(rate * t))


def inputs() -> Inputs:
    """Returns the tank's sway as simulation input."""
    t = np.arange(0.0, 10.2, 0.002)
    return Inputs(t, np.column_stack((acceleration(t), np.zeros((len(t), 2)))))


def motion(record: Record) -> MeasuredMotion:
    """Returns a part of the record as a measured motion."""
    eta = record.height[:, np.newaxis]
    return MeasuredMotion("tank", inputs(), record.t, eta=eta, eta_azimuth=WALL)


def base() -> Model:
    """Returns the pendulum model with the frequency of linear theory."""
    return Model(Rectangle(WIDTH, DEPTH, FILL_HEIGHT), damping_ratio=0.005)


def multimodal() -> Model:
    """Returns the model with many linear modes and no identified parameter."""
    return replace(base(), modes=MODES)


def candidates(record: Record) -> list[Candidate]:
    """Identifies all models on the first half of the record."""
    first = record.half(second=False)
    asymmetric = base().with_effect("crest_asymmetry", kappa=0.1)
    return [
        lumped("M1", first, base(), M1),
        lumped("M2", first, base(), (*M1, "p")),
        lumped("M2, crests sharper", first, asymmetric, (*M1, "p", "crest_asymmetry.kappa")),
        lumped("linear multimodal", first, multimodal(), ("damping_ratio",)),
        lumped("linear multimodal, frequency free", first, multimodal(), M1),
        lumped(
            "linear multimodal, crests sharper",
            first,
            multimodal().with_effect("crest_asymmetry", kappa=0.1),
            ("damping_ratio", "crest_asymmetry.kappa"),
        ),
        lumped(
            "linear multimodal, bound modes by theory",
            first,
            multimodal().with_effect("bound_modes"),
            ("damping_ratio",),
        ),
        lumped(
            "linear multimodal, bound modes",
            first,
            multimodal().with_effect("bound_modes"),
            ("damping_ratio", "bound_modes.kappa", "bound_modes.damping_ratio"),
        ),
        *(wave(order, first, fits) for fits in (False, True) for order in (1, 3)),
    ]


def lumped(name: str, first: Record, model: Model, names: Sequence[str]) -> Candidate:
    """Identifies a pendulum model with given parameters by `slosh identify`."""
    overall = identify([motion(first)], model, names).overall
    words = {
        "natural_frequency": "ω₀ = {:.2f} ± {:.2f} rad/s",
        "damping_ratio": "ζ = {:.3f} ± {:.3f}",
        "accel_gain.gain": "p g/ω₀² = {:.2f} ± {:.2f}",
        "crest_asymmetry.kappa": "κ = {:.1f} ± {:.1f}",
        "bound_modes.kappa": "κ = {:.1f} ± {:.1f}",
        "bound_modes.damping_ratio": "ζ of the bound = {:.1f} ± {:.1f}",
    }
    found = ", ".join(words[one.name].format(one.value, one.error) for one in overall.parameters)

    def heights(t: Array) -> Array:
        return predicted_heights(overall.model, inputs(), t, WALL)[:, 0]

    return Candidate(name, found, heights)


def wave(order: int, first: Record, fits_gain: bool) -> Candidate:
    """Fits damping, and if requested the sway's strength, of a potential-flow model."""

    def heights(t: Array, parameters: Array) -> Array:
        gain = parameters[1] if fits_gain else 1.0
        at = np.arange(0.0, 10.2, STEP)
        sway = gain * acceleration(at)[:, np.newaxis]
        tanks = Tanks.of(WIDTH, FILL_HEIGHT, float(parameters[0]))
        surface = simulate_tanks(tanks, sway, STEP, order=order, modes=9)
        probe = surface.profile(np.array([PROBE / WIDTH - 0.5]))[:, 0, 0]
        return np.asarray(np.interp(t, at, probe))

    start = np.array([0.01, 1.0] if fits_gain else [0.01])

    def missed(parameters: Array) -> Array:
        return heights(first.t, parameters) - first.height

    # The computed wave is a table between whose rows is drawn: finer steps see its corners.
    steps = np.full(len(start), 1e-3)
    solution = least_squares(missed, start, bounds=(0.1 * start, 10.0 * start), diff_step=steps)
    name = f"potential flow, order {order}"
    found = f"ζ = {solution.x[0]:.3f}"
    if fits_gain:
        found += f", sway × {solution.x[1]:.2f}"
    return Candidate(name, found, lambda t: heights(t, solution.x))


def compared(record: Record, every: Sequence[Candidate]) -> str:
    """Formats the errors of all models on both halves as a table."""
    text = (
        "| model | identified on the first 5 s | RMS there [mm] | RMS after [mm] | r after | "
        "highest, lowest after [mm] |\n|---|---|--:|--:|--:|--:|\n"
    )
    first, second = record.half(second=False), record.half(second=True)
    for one in every:
        there, after = one.heights(first.t), one.heights(second.t)
        text += (
            f"| {one.name} | {one.found} | {1e3 * rms_error(first.height, there):.1f} | "
            f"{1e3 * rms_error(second.height, after):.1f} | "
            f"{np.corrcoef(after, second.height)[0, 1]:.3f} | "
            f"{1e3 * after.max():+.0f}, {1e3 * after.min():+.0f} |\n"
        )
    height = second.height
    return text + f"| measured | | | | | {1e3 * height.max():+.0f}, {1e3 * height.min():+.0f} |\n"


def found_gap(record: Record) -> str:
    """Describes the effects that the discovery finds in addition to an identified model."""
    first, names = record.half(second=False), (*M1, "p")
    model = identify([motion(first)], base(), names).overall.model
    finding = discover([motion(first)], model)
    effects = " + ".join(f"`{effect.name}`" for effect in finding.effects) or "nothing"
    text = f"Verdict `{finding.verdict.value}`: {effects}.\n\n"
    text += "| explanation | probability | RMS on the first 5 s [mm] |\n|---|--:|--:|\n"
    for row in [row for row in finding.candidates if not row.reason][:5]:
        name = " + ".join(f"`{effect}`" for effect in row.effects) or "M2 unchanged"
        text += f"| {name} | {row.probability:.3f} | {1e3 * row.fit_rms:.1f} |\n"
    return text


def write_files(record: Record) -> None:
    """Writes the motion tables of both halves, and the model file."""
    FILES.mkdir(parents=True, exist_ok=True)
    halves = {"first": record.half(second=False), "second": record.half(second=True)}
    for name, part in halves.items():
        # Each motion begins at rest; where it was not measured there is no height.
        t = np.union1d(np.arange(0.0, part.t[-1], STEP), part.t)
        height = np.full(len(t), np.nan)
        height[np.searchsorted(t, part.t)] = part.height
        zeros = np.zeros(len(t))
        columns = np.column_stack((t, acceleration(t), zeros, zeros, height))
        np.savetxt(
            FILES / f"{name}.csv", columns, "%.9g", ",", header="t,ax,ay,az,eta_180", comments=""
        )
    (FILES / "model.yaml").write_text(format_model(multimodal()), encoding="utf-8")


def told() -> str:
    """Returns the output of `slosh discover` for the linear multimodal model."""
    with tempfile.TemporaryDirectory() as folder:
        options = ["--holdout", "second.csv", "--model", "model.yaml", "--json"]
        done = subprocess.run(
            ["slosh", "discover", "first.csv", *options, "-o", f"{folder}/found"],
            cwd=FILES,
            stdout=subprocess.PIPE,
            check=True,
        )
    document = json.loads(done.stdout)
    effects = " + ".join(f"`{effect['name']}`" for effect in document["effects"]) or "nothing"
    text = f"Verdict `{document['verdict']}`: {effects}.\n\n"
    text += "| explanation | probability | RMS [mm] | RMS left out [mm] |\n|---|--:|--:|--:|\n"
    for row in [row for row in document["candidates"] if not row["reason"]][:6]:
        name = " + ".join(f"`{effect}`" for effect in row["effects"]) or "base model"
        text += (
            f"| {name} | {row['probability']:.3f} | {1e3 * row['fit_rms']:.1f} | "
            f"{millimetres(row['holdout_rms'])} |\n"
        )
    before, after = (document["gap"][when]["holdout"] for when in ("before", "after"))
    return text + (
        f"\nOn the second half: {millimetres(before)} mm with the base model, "
        f"{millimetres(after)} mm with the exported model.\n"
    )


def millimetres(value: float | None) -> str:
    """Formats a length [m] in millimetres; a dash if it is unknown."""
    return "–" if value is None else f"{1e3 * value:.1f}"


if __name__ == "__main__":
    sys.exit(main())
