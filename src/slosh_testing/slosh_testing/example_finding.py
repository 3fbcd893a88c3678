"""Makes example results of discoveries with every verdict, for tests and for viewing pages.

tools/run python -m slosh_testing.example_finding named -o page.html
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.finding import (
    Agreement,
    Candidate,
    Finding,
    FoundEffect,
    HeightGap,
    MotionFinding,
    Proposal,
    Role,
    SeparatingMotion,
    Verdict,
    WhereRow,
    WorstMoment,
)
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discovery_report import Command, DiscoveryReport, discovery_document
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs
from slosh_report.page.html import html_page
from slosh_report.text import document_text, json_text

Array = NDArray[np.float64]

NAN = float("nan")
NOISE = 0.3e-3
T = np.arange(0.0, 6.0, 1.0 / 60.0)
BASE = Model(Cylinder(0.05, 0.07))
FOUND = BASE.with_effect("vertical_acceleration").with_effect("fill_level", delta=-0.0031234)
_WHERE = (
    WhereRow("phase", "motion", 1.234e-3, 0.31e-3, 0.71234, 720),
    WhereRow("phase", "dwell", 0.81e-3, 0.30e-3, 0.28766, 1080),
    WhereRow("amplitude", "0 … 5 mm", 0.5e-3, 0.3e-3, 0.2, 900),
    WhereRow("amplitude", "5 … 10 mm", 1.4e-3, 0.32e-3, 0.8, 900),
    WhereRow("frequency", "near ω₁ (2.5 … 3.5 Hz)", 1.1e-3, 0.1e-3, 0.77, 1800),
    WhereRow("input", "‖a‖", 0.4321, 0.05, NAN, 1800),
    WhereRow("input", "jerk", 0.6, NAN, NAN, 1800),
)


def example_inputs() -> Inputs:
    """Returns a container motion of 2 s with some yaw, followed by 4 s at rest."""
    t = np.arange(0.0, 6.0, 0.002)
    shape = np.where(t < 2.0, np.sin(np.pi * t / 2.0) ** 2, 0.0)
    acceleration = np.column_stack([3.0 * shape * np.sin(9.0 * t), 2.0 * shape, shape * np.cos(t)])
    yaw = 0.2 * np.cumsum(shape) * 0.002
    attitude = np.column_stack([0.0 * t, 0.0 * t, np.sin(yaw), np.cos(yaw)])
    return Inputs(t, acceleration, attitude)


def example_motion(name: str, seed: int, *, azimuths: int = 0) -> MeasuredMotion:
    """Returns an example motion with invented heights, some of which are missing."""
    heights = _wave(1.0) + NOISE * np.random.default_rng(seed).standard_normal(len(T))
    heights[(T > 1.0) & (T < 1.3)] = np.nan
    if not azimuths:
        return MeasuredMotion(name, example_inputs(), T, msh=np.abs(heights))
    azimuth = np.linspace(0.0, 2.0 * np.pi, azimuths, endpoint=False)
    eta = heights[:, None] * np.cos(azimuth)
    return MeasuredMotion(name, example_inputs(), T, eta_azimuth=azimuth, eta=eta)


def example_motion_finding(
    name: str, role: Role, seed: int, *, azimuths: int = 0
) -> MotionFinding:
    """Returns a motion whose base model is 25 % too high and whose found model is exact."""
    motion = example_motion(name, seed, azimuths=azimuths)
    truth = np.abs(_wave(1.0))[:, None]
    if motion.eta_azimuth is not None:
        truth = _wave(1.0)[:, None] * np.cos(motion.eta_azimuth)
    before = 1.25 * truth
    return MotionFinding(
        motion, role, NOISE, 0.0123, 0.0001, before, truth,
        _agreement(motion, before), _agreement(motion, truth),
    )  # fmt: skip


def example_finding(verdict: Verdict = Verdict.NAMED) -> Finding:
    """Returns an example discovery result with content in every part that its verdict allows."""
    motions = (
        example_motion_finding("day_1#1", Role.FIT, 1),
        example_motion_finding("day_1#2", Role.FIT, 2),
        example_motion_finding("cup_profile", Role.HOLDOUT, 3, azimuths=12),
    )
    candidates = (
        _candidate(("fill_level", "vertical_acceleration"), 0.9612, 412.3, 0.31e-3, 0.32e-3),
        _candidate(("height_scale", "vertical_acceleration"), 0.0371, 409.0, 0.35e-3, 0.41e-3),
        *(_candidate((name,), 1e-4, 80.0 - k, 1.1e-3, 1.2e-3) for k, name in enumerate(_SINGLE)),
        _candidate((), 0.0, 0.0, 1.912e-3, 2.012e-3),
        Candidate(("yaw_coupling",), reason="the motions have no yaw"),
        Candidate(("gravity_tilt",), reason="the motions have no attitude"),
    )
    finding = Finding(
        verdict=verdict,
        base=BASE,
        model=FOUND,
        effects=(
            FoundEffect("fill_level", {"delta": -0.0031234}, {"delta": 0.0000456}, 0.9612,
                        ("height_scale",)),
            FoundEffect("vertical_acceleration", {}, {}, 0.9991),
        ),
        confidence=0.9604,
        gap=HeightGap(NOISE, 1.912e-3, 0.31e-3, 2.012e-3, 0.32e-3, 0.99829, 0.99687),
        motions=motions,
        where=_WHERE,
        worst=(WorstMoment("day_1#2", 1.52, 8.1e-3, 11.1e-3, 8.2e-3),
               WorstMoment("cup_profile", 0.71, 4.3e-3, 6.1e-3, 4.1e-3)),
        candidates=candidates,
        remarks=("The still level of 2 motions was not known and was fitted.",),
    )  # fmt: skip
    return _WITH[verdict](finding)


def example_report(verdict: Verdict = Verdict.NAMED) -> DiscoveryReport:
    """Returns a report of an example discovery result."""
    finding = example_finding(verdict)
    files = tuple(f"separating_{n + 1}.csv" for n in range(len(finding.separating)))
    return DiscoveryReport(
        finding,
        subtitle="base 2D-L, 3 motions, 1 of them held out",
        notes=("Every third motion is held out of the fit.",),
        commands=(
            Command("the better model over a recording", "slosh replay BAG --model model.yaml"),
            Command(
                "the better model in the running estimator",
                'slosh call /slosh/load_model "path: /home/cell/out/model.yaml"',
            ),
        ),
        separating_files=files,
    )


def forms_of(report: DiscoveryReport) -> tuple[str, str, str]:
    """Returns a report as JSON, as text of the terminal, and as a page."""
    document = discovery_document(report)
    return json_text(document.data), document_text(document), html_page(document)


_SINGLE = (
    "height_scale", "height_offset", "second_mode", "time_offset", "damping_mismatch",
    "quadratic_damping", "contact_line_friction", "accel_gain", "static_tilt", "robot_dynamics",
)  # fmt: skip


def _wave(scale: float) -> Array:
    wave: Array = scale * 0.012 * np.sin(19.0 * T) * np.exp(-0.4 * T) * np.minimum(T, 1.0)
    return wave


def _agreement(motion: MeasuredMotion, heights: Array) -> Agreement:
    measured, model = motion.peak_heights, heights.max(axis=1)
    off = (model - measured)[np.isfinite(measured)]
    top = float(np.nanmax(measured))
    return Agreement(
        float(np.sqrt(np.mean(off**2))), float(np.mean(np.abs(off))),
        (float(model.max()) - top) / top, float(model.max()),
    )  # fmt: skip


def _candidate(
    effects: tuple[str, ...], probability: float, evidence: float, fit: float, holdout: float
) -> Candidate:
    known = {"fill_level": {"delta": -0.0031234}, "height_scale": {"gain": 0.87654321}}
    parameters = {name: known[name] for name in effects if name in known}
    return Candidate(effects, parameters, probability, evidence, fit, holdout)


def _named(finding: Finding) -> Finding:
    return finding


def _none(finding: Finding) -> Finding:
    gap = HeightGap(NOISE, 0.302e-3, 0.302e-3, NAN, NAN, NAN, NAN)
    motions = tuple(replace(each, role=Role.FIT) for each in finding.motions)
    return replace(
        finding,
        model=BASE,
        effects=(),
        gap=gap,
        motions=motions,
        candidates=finding.candidates[-3:],
    )


def _ambiguous(finding: Finding) -> Finding:
    names = ("fill_level + vertical_acceleration", "height_scale + vertical_acceleration")
    separating = SeparatingMotion(
        names, example_inputs(), "a sway of 3 m/s² at the first mode along x", 2.1e-3, 0.04e-3
    )
    effects = (replace(finding.effects[0], confidence=0.55), finding.effects[1])
    return replace(finding, effects=effects, confidence=0.55, separating=(separating,))


def _unexplained(finding: Finding) -> Finding:
    terms = (("q³/R²", -1.2345, "1/s²"), ("q̇·‖a‖/g", 0.0567, "1/s"))
    return replace(
        finding,
        model=BASE.with_effect("vertical_acceleration"),
        effects=finding.effects[1:],
        confidence=0.31,
        gap=replace(
            finding.gap,
            holdout_after=1.1e-3,
            fit_after=1.0e-3,
            fit_closed=0.7448,
            holdout_closed=0.7123,
        ),
        proposal=Proposal(terms, "q̈ += −1.23 q³/R² + 0.057 q̇·‖a‖/g", 0.61),
    )


_WITH = {
    Verdict.NAMED: _named,
    Verdict.NONE: _none,
    Verdict.AMBIGUOUS: _ambiguous,
    Verdict.UNEXPLAINED: _unexplained,
}


def main() -> None:
    """Writes the HTML page of an example discovery result."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("verdict", choices=[verdict.value for verdict in Verdict])
    parser.add_argument("-o", "--output", type=Path, required=True)
    arguments = parser.parse_args()
    _, text, page = forms_of(example_report(Verdict(arguments.verdict)))
    arguments.output.write_text(page, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    main()
