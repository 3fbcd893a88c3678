"""Draws the study's figures like TM20's Figures 7, 9, 11 and 12."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from effect_pages import STYLE
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure
from matplotlib.style import context
from tm20.design import FILL_HEIGHT, GEOMETRIES, TOLERANCE
from tm20.evaluation import Fits, Study

from slosh_model.constants import GRAVITY

OURS, PAPER, THEORY = "#0b5fa5", "#d1495b", "#5a5a5a"
SPEED = "operating speed n [1/min]"


def draw_all(study: Study) -> dict[str, str]:
    """Returns all figures as SVG texts by file name."""
    return {
        "study_line_error.svg": _drawn((9.0, 5.2), 6, 3, lambda axes: _line_errors(study, axes)),
        "study_seoe.svg": _drawn((9.0, 3.4), 2, 2, lambda axes: _standard_errors(study, axes)),
        "study_parameters.svg": _drawn((9.0, 3.2), 2, 2, lambda axes: _parameters(study, axes)),
        "study_residual.svg": _drawn((9.0, 5.2), 6, 3, lambda axes: _residuals(study, axes)),
    }


def _drawn(
    size: tuple[float, float], count: int, columns: int, draw: Callable[[Sequence[Any]], None]
) -> str:
    with context({**STYLE, "svg.hashsalt": "packaging study"}, after_reset=True):
        figure = Figure(figsize=size, layout="constrained")
        FigureCanvasSVG(figure)
        rows = math.ceil(count / columns)
        grid = figure.subplots(rows, columns, sharey=count > 2, squeeze=False)
        draw(list(grid.ravel()))
        text = io.StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()


def _line_errors(study: Study, axes: Sequence[Any]) -> None:
    for geometry, axis in zip(GEOMETRIES, axes, strict=True):
        limits = study.findings[geometry.number].validity
        axis.errorbar(
            limits.speeds, 1e3 * limits.mean, 1e3 * limits.spread, color=OURS, capsize=2, lw=1.2
        )
        axis.axhline(1e3 * TOLERANCE, color=THEORY, lw=0.8, ls="--")
        axis.axvline(geometry.published.fastest, color=PAPER, lw=1.2, ls=":")
        axis.set_title(f"G{geometry.number}: w = {1e3 * geometry.width:.0f} mm", fontsize=9)
        axis.set_xlim(10, 62)
        axis.set_ylim(0.0, 1.2)
    _outer_labels(axes, "ε̄ [mm]")
    axes[0].annotate(
        "n_max of TM20", (GEOMETRIES[0].published.fastest - 1, 1.1), color=PAPER, ha="right"
    )


def _standard_errors(study: Study, axes: Sequence[Any]) -> None:
    for number, axis in zip((1, 2), axes, strict=True):
        found = study.findings[number]
        for name, fits, colour in (("M1", found.first, OURS), ("M2", found.second, PAPER)):
            for label, errors, style in _strategies(fits):
                values = np.degrees(list(errors.values()))
                axis.plot(
                    list(errors), values, color=colour, ls=style, marker="o", ms=3,
                    label=f"{label} {name}",
                )  # fmt: skip
        axis.set_title(f"G{number}", fontsize=9)
        axis.set_xlabel(SPEED)
        axis.set_ylabel("SEOE [deg]")
        axis.set_ylim(bottom=0.0)
    axes[0].legend(fontsize=8)


def _strategies(fits: Fits) -> tuple[tuple[str, dict[int, float], str], ...]:
    return (("SOSM", fits.single_errors, "--"), ("MOSM", fits.overall_errors, "-"))


def _parameters(study: Study, axes: Sequence[Any]) -> None:
    order = sorted(GEOMETRIES, key=lambda geometry: geometry.width)
    widths = [1e3 * geometry.width for geometry in order]
    found = [study.findings[geometry.number].first.overall for geometry in order]
    fine = np.linspace(0.036, 0.083, 100)
    wave = np.pi / fine
    theory = np.sqrt(GRAVITY * wave * np.tanh(wave * FILL_HEIGHT))
    axes[0].plot(1e3 * fine, theory, color=THEORY, lw=1.0, label="eq. (20)")
    paper = (
        [geometry.published.natural_frequency for geometry in order],
        [geometry.published.damping_ratio for geometry in order],
    )
    for axis, place, unit in zip(axes, (0, 1), ("ω₀ [rad/s]", "ζ"), strict=True):
        values = [one.parameters[place].value for one in found]
        axis.plot(widths, values, "o", color=OURS, label="study")
        axis.plot(widths, paper[place], "x", color=PAPER, label="TM20")
        axis.set_xlabel("width w [mm]")
        axis.set_ylabel(unit)
    axes[1].set_ylim(0.0, 0.06)
    axes[0].legend(fontsize=8)


def _residuals(study: Study, axes: Sequence[Any]) -> None:
    for geometry, axis in zip(GEOMETRIES, axes, strict=True):
        residuals = study.findings[geometry.number].residuals
        for name, label, colour, style in (
            ("measured", "measured", THEORY, "-"),
            ("line", "line", OURS, "--"),
            ("simulated", "model M1", PAPER, "-"),
        ):
            values = [1e3 * getattr(one, name) for one in residuals.values()]
            axis.plot(list(residuals), values, color=colour, ls=style, lw=1.2, label=label)
        axis.set_title(f"G{geometry.number}", fontsize=9)
    _outer_labels(axes, "η_eff [mm]")
    axes[0].legend(fontsize=8)


def _outer_labels(axes: Sequence[Any], unit: str) -> None:
    for axis in axes[3:]:
        axis.set_xlabel(SPEED)
    for axis in (axes[0], axes[3]):
        axis.set_ylabel(unit)
