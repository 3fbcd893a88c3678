"""A page of predicted motions side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from markupsafe import Markup

from slosh_bringup.predict.profiles import (
    Palette,
    Profile,
    draw_acceleration,
    draw_heights,
    scales,
)
from slosh_report.page.lines import SMALL, time_chart, time_ends
from slosh_report.page.svg import INK, LIMIT, LINEAR, NONLINEAR
from slosh_report.page.template import make_environment

COLOURS = Palette(NONLINEAR, LINEAR, LIMIT, INK)
LOW = (SMALL[0], 1.7)


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
