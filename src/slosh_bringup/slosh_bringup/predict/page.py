"""A page and a picture of predicted motions side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from slosh_base.files.plain_text import plain_line
from slosh_bringup.predict.profiles import (
    Palette,
    Profile,
    draw_acceleration,
    draw_heights,
    scales,
)
from slosh_bringup.simulate.chart import new_picture
from slosh_report.page.lines import SMALL, time_chart, time_ends
from slosh_report.page.svg import INK, LIMIT, LINEAR, NONLINEAR
from slosh_report.page.template import make_environment

COLOURS = Palette(NONLINEAR, LINEAR, LIMIT, INK)
LOW = (SMALL[0], 1.7)

PICTURE_COLOURS = Palette("tab:blue", "tab:orange", "tab:red", "dimgray")
PANEL, PICTURE_HEIGHT = 3.6, 5.4
"""Width of a motion's panels and height of the picture [in]."""


def render_page(facts: Sequence[Mapping[str, Any]], shown: Sequence[Profile]) -> str:
    """The page as HTML text; every text in it is escaped.

    Args:
        facts: of all motions, as `slosh predict --json` gives them.
        shown: those that are drawn, the first ones.
    """
    headline = f"{len(facts)} predicted motions"
    if any(one.answer.limits.given for one in shown):
        kept = sum(bool(row["kept"]) for row in facts)
        headline = f"{kept} of {len(facts)} motions within their limits"
    template = make_environment("slosh_bringup.predict").get_template("predict.html.j2")
    return template.render(
        facts=facts,
        headline=headline,
        shown=shown,
        charts=[_charts(one, number, *scales(shown)) for number, one in enumerate(shown)],
    )


def _charts(
    one: Profile, number: int, height: float, acceleration: float
) -> tuple[Markup, Markup]:
    """Heights and acceleration of a motion, as SVG text."""

    def heights(axes: Any) -> None:
        draw_heights(axes, one, COLOURS, height)
        axes.set_ylabel("height [mm]")

    def strength(axes: Any) -> None:
        draw_acceleration(axes, one, COLOURS, acceleration)
        axes.set_ylabel("‖a‖ [m/s²]")

    ends = time_ends(one.t)
    return (
        Markup(time_chart(heights, ends, SMALL, f"height-{number}")),
        Markup(time_chart(strength, ends, LOW, f"acceleration-{number}")),
    )


def write_picture(path: Path, shown: Sequence[Profile]) -> None:
    """Draws each motion's heights and acceleration, with the same scales.

    Args:
        path: the `.png` or `.svg` file.
        shown: at least one.

    Raises:
        OSError: the file cannot be written; what was there is as it was.
    """
    height, acceleration = scales(shown)
    with new_picture(path, (max(PANEL * len(shown), 6.0), PICTURE_HEIGHT)) as figure:
        rows = figure.subplots(
            2, len(shown), sharey="row", sharex="col", height_ratios=(2, 1), squeeze=False
        )
        for one, upper, lower in zip(shown, *rows, strict=True):
            draw_heights(upper, one, PICTURE_COLOURS, height)
            draw_acceleration(lower, one, PICTURE_COLOURS, acceleration)
            title = [plain_line(one.answer.name), *one.words()]
            upper.set_title("\n".join(title), fontsize=10.0)
            lower.set_xlabel("time [s]")
        rows[0][0].set_ylabel("height [mm], dashed: linear")
        rows[1][0].set_ylabel("‖a‖ [m/s²]")
