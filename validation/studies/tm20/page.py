"""Formats the study's page, with TM20's tables beside ours."""

from __future__ import annotations

import math

import numpy as np
from tm20.design import FILL_HEIGHT, GEOMETRIES, SPEEDS, Geometry
from tm20.evaluation import Findings, Study

from slosh_model.constants import GRAVITY

HEAD = """# Packaging study (TM20) on synthetic measurements

Six rectangular containers of water, 67 mm deep, on a linear drive: stroke 100 mm, motion during
40 % of the cycle, {speeds} speeds from 12 to 60 cycles a minute, {experiments:,} experiments.
Troll and Majschak (Appl. Sci. 10, 2020, 1859; TM20) measured them. Here the truth is
[potential flow](../physics.md) to the third order with the paper's damping ratios. Measurement
errors: 0.1 mm for each point, 0.1 mm for the whole profile, 1 mrad for its slope; repetitions
differ by 0.3 mm in fill height, 3 % in damping and 0.1 mm of residual wave. Repetitions with a
breaking wave are excluded. The motion law is `harmonic`, the only one tried that gives the
paper's speed limits (below). `make study` writes this page; it resumes an interrupted run.
"""


WHY = """The second mode, bound to the first, sets the limit: its error grows with the fourth
power of the speed, that of linear theory with the second. The study omits surface tension,
because the measured frequencies do not show the increase of 0.6 to 2.3 % that it would cause.
"""


def page(study: Study, images: str) -> str:
    """Returns the study's page as Markdown.

    Args:
        study: what was found.
        images: path of the figures from the page, with a slash.
    """
    parts = [
        HEAD.format(speeds=len(SPEEDS), experiments=study.experiments),
        "## Models and speed limits (Table 4)\n",
        _models(study),
        f"![Identified parameters by width]({images}study_parameters.svg)\n",
        "## Identification strategies (Table 3): maximum SEOE [deg], study / TM20\n",
        _strategies(study),
        f"![SEOE by speed]({images}study_seoe.svg)\n",
        "## Residual vibration (Table 5): study / TM20 [mm]\n",
        _residuals(study),
        f"![Effective heights by speed]({images}study_residual.svg)\n",
        "## Speed limit of the straight line (Figure 7)\n",
        f"![Line errors by speed]({images}study_line_error.svg)\n",
        _limits(study),
        WHY,
        "## Measurement by the camera detector\n",
        _camera(study),
    ]
    return "\n".join(parts)


def _models(study: Study) -> str:
    head = _head(
        "geometry", "ω₀ [rad/s]", "TM20", "deviation", "eq. (20)", "deviation", "ζ", "TM20",
        "p g/ω₀²", "n_max [1/min]", "TM20", "max SEOE, other motion [deg]", "TM20",
    )  # fmt: skip
    return head + "".join(_model_row(g, study.findings[g.number]) for g in GEOMETRIES)


def _model_row(geometry: Geometry, found: Findings) -> str:
    frequency, damping = (one.value for one in found.first.overall.parameters[:2])
    wave = math.pi / geometry.width
    theory = math.sqrt(GRAVITY * wave * math.tanh(wave * FILL_HEIGHT))
    paper = geometry.published
    factor = {one.name: one.value for one in found.second.overall.parameters}["accel_gain.gain"]
    return _row(
        f"G{geometry.number}, {1e3 * geometry.width:.0f} mm", f"{frequency:.2f}",
        f"{paper.natural_frequency:.2f}", _percent(frequency / paper.natural_frequency),
        f"{theory:.2f}", _percent(frequency / theory), f"{damping:.4f}",
        f"{paper.damping_ratio:.3f}", f"{factor:.3f}", f"{found.validity.fastest}",
        f"{paper.fastest}", _degrees(found.validated), f"{paper.validated:.2f}",
    )  # fmt: skip


def _strategies(study: Study) -> str:
    head = _head("geometry", "SOSM M1", "SOSM M2", "MOSM M1", "MOSM M2")
    rows = []
    for geometry in GEOMETRIES:
        found = study.findings[geometry.number]
        ours = (
            found.first.single_errors, found.second.single_errors,
            found.first.overall_errors, found.second.overall_errors,
        )  # fmt: skip
        cells = [
            f"{_degrees(one)} / {paper:.2f}"
            for one, paper in zip(ours, geometry.published.identified, strict=True)
        ]
        rows.append(_row(f"G{geometry.number}", *cells))
    return head + "".join(rows)


def _residuals(study: Study) -> str:
    head = _head("geometry", "max η_eff", "mean Δη_appr", "mean Δη_simul")
    rows = []
    for geometry in GEOMETRIES:
        every = list(study.findings[geometry.number].residuals.values())
        ours = (
            max(one.measured for one in every),
            float(np.mean([one.line_missed for one in every])),
            float(np.mean([one.simulated_missed for one in every])),
        )
        cells = [
            f"{1e3 * one:.2f} / {paper:.2f}"
            for one, paper in zip(ours, geometry.published.effective, strict=True)
        ]
        rows.append(_row(f"G{geometry.number}", *cells))
    return head + "".join(rows)


def _limits(study: Study) -> str:
    names = [f"G{geometry.number}" for geometry in GEOMETRIES]
    head = _head("n_max [1/min] by", *names, "ε̄ at TM20's n_max [mm]")
    rows = [_row("**TM20, measured**", *(f"**{g.published.fastest}**" for g in GEOMETRIES), "0.5")]
    rows += [
        _row(
            one.truth.name,
            *(f"{speed}" if speed else "< 30" for speed in one.fastest),
            ", ".join("breaks" if math.isnan(e) else f"{1e3 * e:.2f}" for e in one.errors),
        )
        for one in study.limits
    ]
    rows.append(
        _row(
            "complete study",
            *(f"{study.findings[g.number].validity.fastest}" for g in GEOMETRIES),
            ", ".join(_error_at_limit(study.findings[g.number], g) for g in GEOMETRIES),
        )
    )
    return head + "".join(rows)


def _error_at_limit(found: Findings, geometry: Geometry) -> str:
    place = found.validity.speeds.index(geometry.published.fastest)
    return f"{1e3 * found.validity.mean[place]:.2f}"


def _camera(study: Study) -> str:
    text = "Side views rendered with noise and blur, measured by the camera's detector.\n\n"
    head = _head(
        "geometry", "images", "θ up to [deg]", "θ error, RMS [deg]", "profile error, RMS [mm]"
    )
    rows = []
    for geometry in GEOMETRIES:
        one = study.samples[geometry.number]
        off = one.slopes[:, 1] - one.slopes[:, 0]
        rows.append(
            _row(
                f"G{geometry.number}",
                f"{len(off)}",
                f"{math.degrees(np.abs(one.slopes[:, 0]).max()):.1f}",
                f"{math.degrees(math.sqrt(float(np.mean(off**2)))):.3f}",
                f"{1e3 * math.sqrt(float(np.nanmean(one.errors**2))):.3f}",
            )
        )
    return text + head + "".join(rows)


def _head(*cells: str) -> str:
    return _row(*cells) + "|---|" + "--:|" * (len(cells) - 1) + "\n"


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |\n"


def _percent(ratio: float) -> str:
    return f"{100.0 * (ratio - 1.0):+.1f} %"


def _degrees(errors: dict[int, float]) -> str:
    return f"{math.degrees(max(errors.values())):.2f}"
