"""Runs the discovery on published data; fills docs/results/discovery_findings.md.

    tools/run python validation/studies/discovery_findings.py [dl22] [cfd] [untilted] [tilted]

`dl22` simulates the motions of Di Leva et al. (2022) with the 3D-NL model; `cfd` and the runs of
AntiSloshing are looked for in SLOSH_SHARED_DATA or ../shared/data. All four without arguments.
"""

from __future__ import annotations

import itertools
import os
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import with_tools  # noqa: F401
from cylinder_waves import CylinderWaves
from result_tables import fill

from slosh_bringup.cell.motions import make_motion
from slosh_discovery.discover import Finding, MeasuredMotion, discover
from slosh_discovery.discover.finding import FoundEffect, Role
from slosh_discovery.discover_data import read_motions
from slosh_discovery.discovery_report.words import marked
from slosh_model import Cylinder, Inputs, Model, predicted_heights
from slosh_replay.tables.antisloshing import import_antisloshing

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "results" / "discovery_findings.md"
DATA = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
NOISE, CAMERA_RATE, DWELL = 3e-4, 60.0, 2.0
READ_AT = 0.95  # of the radius: where the heights of the motions by CFD were read
DL22_FIT = ("l3-2.5", "e3-2.5", "c3-2.5")
DL22_HELD_OUT = ("l3-4.5", "e3-4.5", "c3-4.5")
LEAST_PROBABILITY = 0.0005  # of an explanation that is listed
CUP = Cylinder(0.05, 0.07)
ROBOT_CUP = Cylinder(0.049, 0.078)
USES = {Role.FIT: "fit", Role.HOLDOUT: "held out"}
WORDS = {Role.FIT: "fitted", Role.HOLDOUT: "held-out"}
UNTILTED_FIT = (
    "LE_2D_0m_4.8s_900deg", "LE_3D_0m_5s_900deg", "RD_2D_0.3m_6.3s_720deg",
    "RD_3D_0.3m_6.5s_720deg", "TRD_2D_0.3m_2.2s_270deg", "TRD_3D_0.3m_2.9s_270deg",
)  # fmt: skip
TILTED_FIT = ("Tilt_LE_2D_0m_6.5s_20deg", "Tilt_RD_2D_0.3m_7s_30deg", "Tilt_TRD_2D_0.3m_3s_30deg")


def main() -> int:
    """Runs the discoveries named on the command line and fills their tables."""
    wanted = sys.argv[1:] or ["dl22", "cfd", "untilted", "tilted"]
    for name in wanted:
        for table, text in {"dl22": dl22, "cfd": cfd, "untilted": untilted, "tilted": tilted}[
            name
        ]():
            fill(PAGE, table, text)
            print(f"{table}\n{text}", flush=True)
    return 0


def dl22() -> Iterable[tuple[str, str]]:
    """Runs the discovery on simulated 3D-NL heights with noise; the base model is 2D-L."""
    truth = Model(CUP).spatial().nonlinear()
    fit, held_out = (
        [dl22_motion(truth, name, seed) for seed, name in enumerate(names, start=start)]
        for start, names in ((0, DL22_FIT), (10, DL22_HELD_OUT))
    )
    yield "dl22", described(discover(fit, Model(CUP), held_out))


def dl22_motion(truth: Model, name: str, seed: int) -> MeasuredMotion:
    """Returns one motion of DL22 and a rest, with simulated camera heights."""
    motion = make_motion(name, 500.0)
    still = np.arange(1, round(DWELL * 500.0) + 1) / 500.0
    t = np.concatenate([motion.t, motion.t[-1] + still])
    acceleration = np.vstack([motion.acceleration, np.zeros((len(still), 3))])
    inputs = Inputs(t, acceleration)
    times = np.arange(0.0, t[-1], 1.0 / CAMERA_RATE)
    noise = NOISE * np.random.default_rng(seed).normal(size=len(times))
    return MeasuredMotion(
        name, inputs, times, msh=predicted_heights(truth, inputs, times)[:, 0] + noise
    )


def cfd() -> Iterable[tuple[str, str]]:
    """Runs the discovery on two CFD motions, for two base models."""
    one, other = (read_motions(DATA / "cfd" / f"{name}.csv.gz") for name in ("e1", "l1"))
    for base in (Model(CUP), Model(CUP).spatial().nonlinear()):
        yield f"cfd_e1 {base.name}", described(discover(one, base, other))
        if base.name == "2D-L":
            yield f"cfd_l1 {base.name}", described(discover(other, base, one))
    both = discover([*one, *other], base)
    yield "cfd_both 3D-NL", described(both)
    yield "flow", flow_table(base, both.model)


def flow_table(base: Model, found: Model) -> str:
    """Compares base and found model with potential flow on motions not used before."""
    lines = [
        "| motion | highest | ε before | ε after | rms before | rms after |",
        "|---|--:|--:|--:|--:|--:|",
    ]
    azimuths = np.radians(np.arange(0.0, 360.0, 10.0))
    for name, share in itertools.product(("l", "e", "c"), (0.7, 1.0)):
        inputs = flow_motion(name, share)
        waves = CylinderWaves(
            CUP.radius, CUP.fill_height, order=3, angular=5, damping_ratio=0.0075,
            tension=7.2e-5, shortest=9.0, held_back=8.0,
        )  # fmt: skip
        amplitudes = waves.simulate(inputs.t, inputs.acceleration[:, :2])
        truth = waves.heights(amplitudes, azimuths, READ_AT)
        cells = [f"{name} × {share:g}", f"{1e3 * truth.max():.1f}"]
        heights = [predicted_heights(model, inputs, inputs.t, azimuths) for model in (base, found)]
        cells += [f"{1e2 * (one.max() / truth.max() - 1.0):+.1f}" for one in heights]
        cells += [f"{1e3 * np.sqrt(np.mean((one - truth) ** 2)):.2f}" for one in heights]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def flow_motion(name: str, share: float) -> Inputs:
    """Returns a planar motion of DL22 and a rest, with its acceleration scaled by a share."""
    motion = make_motion(name, 200.0)
    still = np.arange(1, round(DWELL * 200.0) + 1) / 200.0
    acceleration = np.vstack([share * motion.acceleration, np.zeros((len(still), 3))])
    return Inputs(np.concatenate([motion.t, motion.t[-1] + still]), acceleration)


def untilted() -> Iterable[tuple[str, str]]:
    """Runs the discovery on the measured runs without tilt; the base model is 2D-NL."""
    yield "untilted", described(robot_runs(UNTILTED_FIT, "", Model(ROBOT_CUP).nonlinear()))


def tilted() -> Iterable[tuple[str, str]]:
    """Runs the discovery on the measured runs with tilt; the base model ignores the tilt."""
    base = Model(ROBOT_CUP).nonlinear().spatial()
    yield "tilted", described(robot_runs(TILTED_FIT, "Tilt", base))


def robot_runs(names: Sequence[str], prefix: str, base: Model) -> Finding:
    """Runs the discovery on some measured runs of a kind; the others are held out.

    The runs along one path were measured together, with one set-up of cameras and cup.
    """
    runs = runs_of_kind(prefix)
    fit = [motion for name in names for motion in runs[name]]
    rest = [motion for name, motions in runs.items() if name not in names for motion in motions]
    return discover(fit, base, rest)


def runs_of_kind(prefix: str) -> dict[str, list[MeasuredMotion]]:
    """Reads the measured runs with or without tilt by name; each path's runs form a group."""
    with tempfile.TemporaryDirectory() as folder:
        bags = sorted(import_antisloshing(DATA / "antisloshing", Path(folder)))
        return {
            bag.name: [replace(one, group=path_of(bag.name)) for one in read_motions(bag)]
            for bag in bags
            if bag.name.startswith("Tilt") == bool(prefix)
        }


def path_of(run: str) -> str:
    """Returns the path's name in a run's name: LE, RD or TRD."""
    return run.removeprefix("Tilt_").partition("_")[0]


def described(finding: Finding) -> str:
    """Formats a discovery's result as two Markdown tables: motions and verdict."""
    lines = [
        "| motion | used for | MAE before | MAE after | ε before | ε after |",
        "|---|---|--:|--:|--:|--:|",
    ]
    for case in finding.motions:
        before, after = case.before, case.after
        lines.append(
            f"| {case.motion.name} | {USES[case.role]} | "
            f"{1e3 * before.sigma:.2f} | {1e3 * after.sigma:.2f} | "
            f"{1e2 * before.epsilon:+.1f} | {1e2 * after.epsilon:+.1f} |"
        )
    if sum(case.role is judged_by(finding) for case in finding.motions) > 1:
        lines.append(_mean_row(finding))
    return "\n".join([*lines, "", *_verdict_table(finding)])


def _verdict_table(finding: Finding) -> list[str]:
    """Formats verdict, effects, remaining error and alternatives as table lines."""
    most = max((effect.confidence for effect in finding.effects), default=finding.confidence)
    tried = [candidate for candidate in finding.candidates if not candidate.reason]
    best, *others = [row for row in tried[:5] if row.probability >= LEAST_PROBABILITY]
    rows = [("verdict", f"{finding.verdict.value}, confidence {most:.2f}")]
    rows += [("effect", _named(effect, most)) for effect in finding.effects]
    rows.append(
        ("residual, left out [mm rms]", f"{1e3 * best.fit_rms:.2f}, {1e3 * best.holdout_rms:.2f}")
    )
    rows += [
        (
            "other explanation",
            f"{' + '.join(marked(row.effects, row.per_group)) or 'the base'} "
            f"(probability {row.probability:.3f})",
        )
        for row in others
    ]
    rows.append(
        (
            f"removable gap closed, {WORDS[judged_by(finding)]} motions",
            f"{1e2 * finding.gap.closed:.0f} %",
        )
    )
    return ["| result | value |", "|---|---|", *(f"| {name} | {value} |" for name, value in rows)]


def judged_by(finding: Finding) -> Role:
    """Returns which motions decide: the held-out ones if there are any, else the fitted."""
    held = any(case.role is Role.HOLDOUT for case in finding.motions)
    return Role.HOLDOUT if held else Role.FIT


def _mean_row(finding: Finding) -> str:
    held = [case for case in finding.motions if case.role is judged_by(finding)]
    cells = [
        f"{1e3 * np.mean([case.before.sigma for case in held]):.2f}",
        f"{1e3 * np.mean([case.after.sigma for case in held]):.2f}",
        f"{1e2 * np.mean([abs(case.before.epsilon) for case in held]):.1f}",
        f"{1e2 * np.mean([abs(case.after.epsilon) for case in held]):.1f}",
    ]
    return f"| **mean, size of ε** | {USES[judged_by(finding)]} | {' | '.join(cells)} |"


def _named(effect: FoundEffect, most: float) -> str:
    """Formats a found effect with its fitted parameters, and its confidence if lower."""
    notes = [_fitted(effect)] if _fitted(effect) != "–" else []
    if effect.confidence < most - 0.015:
        notes.append(f"confidence {effect.confidence:.2f}")
    if effect.alternatives:
        notes.append(f"or {', '.join(effect.alternatives)}")
    return effect.name + (f" ({'; '.join(notes)})" if notes else "")


def _fitted(effect: FoundEffect) -> str:
    """Formats an effect's fitted parameters, for each group of motions if they differ."""
    if not effect.by_group:
        return _values(effect.parameters)
    return "; ".join(
        f"{group}: {_values(fitted.parameters)}" for group, fitted in effect.by_group.items()
    )


def _values(parameters: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value:.4g}" for name, value in parameters.items()) or "–"


if __name__ == "__main__":
    sys.exit(main())
