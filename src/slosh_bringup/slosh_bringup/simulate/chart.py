"""Draws simulated heights over time with peak, limit and rim, above a plot of the motion."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.style import context

from slosh_base.files import NewFile
from slosh_base.types import Array
from slosh_bringup.simulate.answer import SimulationAnswer
from slosh_model.simulate import Inputs
from slosh_report.page.series import envelope

SIZE = (9.6, 5.4)
DPI = 120
FAR = 3.0
"""A limit that lies so many times as high as everything else is not drawn."""
# From matplotlib's own defaults, whatever the user's matplotlibrc says; the same file each time.
STYLE = {"svg.hashsalt": "simulate", "svg.fonttype": "none", "text.parse_math": False,
         "axes.grid": True, "grid.alpha": 0.4, "font.size": 10.0}  # fmt: skip


def write_chart(
    path: Path, inputs: Inputs, msh: Array, answer: SimulationAnswer, allowed: float
) -> None:
    """Draws simulated heights to a `.png` or `.svg` file.

    Args:
        path: the file.
        inputs: the motion.
        msh: (N,) height as a sensor would read it [m].
        answer: what it comes to.
        allowed: ‖a‖ up to which the model holds [m/s²].

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    with new_picture(path, SIZE) as figure:
        figure.suptitle(answer.text().replace("), ", "),\n"), fontsize=10.0)
        heights, motion = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1))
        _draw_heights(heights, inputs.t, msh, answer)
        strength = np.linalg.norm(inputs.acceleration, axis=1)
        motion.plot(*envelope(inputs.t, strength), color="tab:gray")
        _draw_bound(motion, allowed, "validity limit of the model", answer.acceleration)
        motion.set(xlabel="time [s]", ylabel="‖a‖ [m/s²]")


@contextmanager
def new_picture(path: Path, size: tuple[float, float]) -> Iterator[Figure]:
    """Yields an empty figure of a given size [in] and writes it as `.png` or `.svg` on exit.

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    form = path.suffix.removeprefix(".")
    with context(STYLE, after_reset=True), NewFile(path) as new, new.open() as stream:
        figure = Figure(figsize=size, layout="constrained")
        yield figure
        metadata = {"Date": None} if form == "svg" else None
        figure.savefig(stream, format=form, dpi=DPI, metadata=metadata)


def _draw_heights(axes: Any, t: Array, msh: Array, answer: SimulationAnswer) -> None:
    axes.plot(*envelope(t, 1e3 * msh), color="tab:blue")
    axes.plot(answer.peak_time, 1e3 * answer.peak, "o", color="tab:blue", fillstyle="none")
    axes.annotate(f"{1e3 * answer.peak:.1f} mm", (answer.peak_time, 1e3 * answer.peak),
                  xytext=(6, 4), textcoords="offset points")  # fmt: skip
    for name, bound in (("limit", answer.limit), ("rim", answer.freeboard)):
        if bound is not None:
            _draw_bound(axes, 1e3 * bound, name, 1e3 * answer.peak)
    axes.set_ylabel("height [mm]")
    axes.margins(y=0.12)


def _draw_bound(axes: Any, bound: float, name: str, peak: float) -> None:
    """Draws a dotted limit line, unless it lies far above the curve."""
    if bound < FAR * peak:
        axes.axhline(bound, color="tab:red", linestyle=":")
        axes.annotate(name, (0.995, bound), xycoords=axes.get_yaxis_transform(), ha="right",
                      va="bottom", color="tab:red")  # fmt: skip
