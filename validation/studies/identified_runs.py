"""Identifies a robot's measured cup and fills the tables of docs/identify.md.

    tools/run python validation/studies/identified_runs.py

The runs of AntiSloshing are looked for in SLOSH_SHARED_DATA or ../shared/data.
"""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from result_tables import fill

from slosh_discovery.discover.input_series import motion_span
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover_data import read_motions
from slosh_discovery.discovery_report.words import shown_value
from slosh_discovery.identify import Identification, identify
from slosh_discovery.identify.result import FoundParameter
from slosh_discovery.identify.trials import make_trials
from slosh_discovery.identify.workflow import answered
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_replay.tables.antisloshing import import_antisloshing

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "identify.md"
DATA = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
CUP = Model(Cylinder(0.049, 0.078))
FIT = (
    "LE_2D_0m_4.8s_900deg", "LE_3D_0m_5s_900deg", "RD_2D_0.3m_6.3s_720deg",
    "RD_3D_0.3m_6.5s_720deg", "TRD_2D_0.3m_2.2s_270deg", "TRD_3D_0.3m_2.9s_270deg",
)  # fmt: skip
AFTER, LONGEST = 0.3, 6.0
"""A decay begins and ends so long after the motion's end [s]."""
LEVEL = ("container.fill_height", "damping_ratio")

Motions = Mapping[str, MeasuredMotion]


def main() -> int:
    """Identifies the models and fills the tables."""
    runs = untilted_runs(DATA / "antisloshing")
    decays = {name: free_decay(run) for name, run in runs.items()}
    for name, make in (("runs", by_run), ("joint", joint)):
        text = make(runs, decays)
        print(f"{name}\n{text}", flush=True)
        fill(PAGE, name, text)
    return 0


def untilted_runs(folder: Path) -> dict[str, MeasuredMotion]:
    """Reads the measured runs in which the cup stays upright, by name."""
    model = driven_model()
    with tempfile.TemporaryDirectory() as room:
        bags = sorted(import_antisloshing(folder, Path(room)))
        upright = [bag for bag in bags if not bag.name.startswith("Tilt")]
        return {bag.name: read_motions(bag, model)[0] for bag in upright}


def driven_model() -> Model:
    """Returns the 3D-NL model of the cup, which describes the moving cup best."""
    return CUP.spatial().nonlinear()


def free_decay(run: MeasuredMotion) -> MeasuredMotion:
    """Returns the free decay of the wave after a run's motion, as a measured motion.

    The cameras see the near side of the wall, so that the height swings to both sides of the still
    level: it is taken for the height at one place there.
    """
    (trial,), _ = make_trials([run], driven_model(), 0.4)
    assert run.msh is not None
    end = motion_span(run.inputs)[1] + trial.clock_offset
    kept = (run.t > end + AFTER) & (run.t < end + LONGEST)
    t = run.t[kept] - end
    still = Inputs(np.array([0.0, t[-1]]), np.zeros((2, 3)))
    return MeasuredMotion(
        run.name, still, t, eta=run.msh[kept][:, np.newaxis], eta_azimuth=np.zeros(1),
        level_known=False,
    )  # fmt: skip


def by_run(runs: Motions, decays: Motions) -> str:
    """Tabulates what each run alone identifies: from its motion, and from the decay after it."""
    lines = [
        "| run | ω₁ from the motion | ζ | rms | ω₁ from the decay after it | ζ | rms |",
        "|---|--:|--:|--:|--:|--:|--:|",
    ]
    rows = []
    for name, run in runs.items():
        driven, free = identify([run], driven_model()), identify([decays[name]], CUP)
        rows.append([*values_of(driven), *values_of(free)])
        cells = [*cells_of(driven), *cells_of(free)]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    table = np.array(rows)
    mean, spread = table.mean(axis=0), table.std(axis=0, ddof=1)
    cells = [f"{mean[0]:.2f} ± {spread[0]:.2f}", f"{mean[1]:.4f} ± {spread[1]:.4f}", ""]
    cells += [f"{mean[2]:.2f} ± {spread[2]:.2f}", f"{mean[3]:.4f} ± {spread[3]:.4f}", ""]
    lines.append(f"| **mean ± standard deviation of the runs** | {' | '.join(cells)} |")
    return "\n".join(lines)


def joint(runs: Motions, decays: Motions) -> str:
    """Identifies from all decays and half of the motions; predicts the other motions."""
    lines = [
        "| from | ω₁ [rad/s] | ζ | h [mm] | errors raised by |", "|---|--:|--:|--:|--:|"
    ]  # fmt: skip
    halves = [runs[name] for name in FIT]
    rest = [run for name, run in runs.items() if name not in FIT]
    for label, motions, base in (
        (f"{len(decays)} decays", list(decays.values()), CUP),
        (f"{len(halves)} motions", halves, driven_model()),
    ):
        found = identify(motions, base)
        level = identify(motions, base, LEVEL)
        cells = [interval(entry) for entry in found.overall.parameters]
        cells.append(interval(level.overall.parameters[0]))
        lines.append(f"| {label} | {' | '.join(cells)} | {found.overall.scatter:.1f} |")
    model = identify(list(decays.values()), CUP).overall.model
    decayed = replace(
        driven_model(),
        damping_ratio=model.damping_ratio,
        natural_frequency=model.natural_frequency,
    )
    lines += ["", "| run not used | MAE as it was | with the motions' values | with the decays' |",
              "|---|--:|--:|--:|"]  # fmt: skip
    models = (driven_model(), identify(halves, driven_model()).overall.model, decayed)
    sigmas = np.array([sigma_of(model, rest) for model in models]).T
    for run, row in zip(rest, sigmas, strict=True):
        lines.append(f"| {run.name} | {' | '.join(f'{1e3 * s:.2f}' for s in row)} |")
    lines.append(f"| **mean** | {' | '.join(f'{1e3 * s:.2f}' for s in sigmas.mean(axis=0))} |")
    return "\n".join(lines)


def sigma_of(model: Model, runs: Sequence[MeasuredMotion]) -> list[float]:
    """Returns the model's MAE for each run [m]; only the clock offsets are fitted."""
    return [motion.sigma for motion in answered(runs, model)]


def values_of(found: Identification) -> list[float]:
    """Returns the values of the identified parameters."""
    return [entry.value for entry in found.overall.parameters]


def cells_of(found: Identification) -> list[str]:
    """Formats the identified parameters with standard errors, and the residual [mm]."""
    return [
        *(shown(entry) for entry in found.overall.parameters),
        f"{1e3 * found.overall.seoe:.2f}",
    ]


def shown(entry: FoundParameter) -> str:
    """Formats an identified parameter with its standard error."""
    text = shown_value(entry.name, entry.unit, entry.value, entry.error)
    return f"{text.value} ± {text.error}"


def interval(entry: FoundParameter) -> str:
    """Formats an identified parameter with its 95 % interval."""
    low, high = (
        shown_value("", entry.unit, end, entry.error).value for end in (entry.lower, entry.upper)
    )
    return f"{shown(entry)} ({low} … {high})"


if __name__ == "__main__":
    sys.exit(main())
