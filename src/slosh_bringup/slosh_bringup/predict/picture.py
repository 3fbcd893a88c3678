"""A picture of predicted motions side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from slosh_base.files.plain_text import plain_line
from slosh_bringup.predict.profiles import (
    Palette,
    Profile,
    draw_acceleration,
    draw_heights,
    scales,
)
from slosh_bringup.simulate.chart import new_picture

COLOURS = Palette("tab:blue", "tab:orange", "tab:red", "dimgray")
PANEL, HEIGHT = 3.6, 5.4
"""Width of a motion's panels and height of the picture [in]."""


def write_picture(path: Path, shown: Sequence[Profile]) -> None:
    """Draws each motion's heights and acceleration, with the same scales.

    Args:
        path: the `.png` or `.svg` file.
        shown: at least one.

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    height, acceleration = scales(shown)
    with new_picture(path, (max(PANEL * len(shown), 6.0), HEIGHT)) as figure:
        rows = figure.subplots(
            2, len(shown), sharey="row", sharex="col", height_ratios=(2, 1), squeeze=False
        )
        for one, upper, lower in zip(shown, *rows, strict=True):
            draw_heights(upper, one, COLOURS, height)
            draw_acceleration(lower, one, COLOURS, acceleration)
            title = [plain_line(one.answer.name), *one.words()]
            upper.set_title("\n".join(title), fontsize=10.0)
            lower.set_xlabel("time [s]")
        rows[0][0].set_ylabel("height [mm], dashed: linear")
        rows[1][0].set_ylabel("‖a‖ [m/s²]")
