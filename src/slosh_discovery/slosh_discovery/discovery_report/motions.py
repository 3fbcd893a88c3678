"""Parts of a discovery's document about its motions: agreement, charts, where they disagree."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.finding import Finding, Role
from slosh_discovery.discovery_report.words import LETTERS, highest, part_name
from slosh_model.simulate import Inputs
from slosh_report.document import (
    Block,
    Chart,
    Column,
    Figure,
    Heading,
    Line,
    Table,
    explain,
    numbers,
    table,
)
from slosh_report.page.svg import GAP, LOW, LOW_NARROW, badge
from slosh_report.page.units import shown
from slosh_report.texts import Bars, Mark, Place, Text

DRAWN = 6
"""Most motions that are drawn."""
BAND = 2.0
"""Half width of the band of noise, in standard deviations: 95 % of the noise lies in it."""
TURNING = 1e-3
"""Smaller angles [rad] and rates [rad/s] are not worth a chart."""


def drawn_motions(finding: Finding) -> list[int]:
    """Returns the indices of the motions to draw: held-out ones first, then by residual."""
    motions = finding.motions

    def rank(index: int) -> tuple[bool, float]:
        rms = motions[index].before.rms
        return motions[index].role is not Role.HOLDOUT, -rms if math.isfinite(rms) else 0.0

    # A fitted motion is always among them: the reader sees what the parameters come from.
    order = sorted(range(len(motions)), key=rank)
    fitted = [index for index in order if motions[index].role is Role.FIT][:1]
    chosen = dict.fromkeys([*order[: DRAWN - len(fitted)], *fitted, *order])
    return sorted(list(chosen)[:DRAWN])


def motions_blocks(finding: Finding, data: Place) -> tuple[Block, ...]:
    """Returns the agreement with each motion before and after, and charts of some of them."""

    def name(row: Place) -> Text:
        role = "held out" if row.data["role"] == "holdout" else row.data["role"]
        group = row.data["group"]
        when = Mark(role + (f", {group}" if group else ""), "when")
        return Mark(str(row.index + 1), "badge"), row.data["name"], when

    def pair(group: str, key: str, unit: str) -> Iterator[Column]:
        for when in ("before", "after"):
            cell = partial(_number_of, when=when, key=key, unit=unit)
            yield Column(when, cell, "n", group)

    columns = (
        Column("motion", name, "name"),
        numbers("highest [mm]", "peak", "mm"),
        *pair("RMS [mm]", "residual", "mm"),
        *pair("MAE [mm]", "sigma", "mm"),
        *pair("ε [%]", "epsilon", "%"),
        numbers("closed [%]", "closed", "% of"),
    )
    drawn = drawn_motions(finding)
    count = len(finding.motions)
    left_out = f"{len(drawn)} of {count} motions: those held out and the worst first"
    return (
        table("Motions", columns, data["motions"], kind="matrix wide-names", seen=False),
        explain(
            "MAE is the mean absolute error; ε is the model’s highest height against the measured "
            "one, positive where the model is too high. Closed is the share of the removable gap "
            "that the new model removes: 0 %: no improvement; 100 %: only noise is left; a dash: "
            "the gap does not exceed the noise."
        ),
        *([Heading(left_out)] if len(drawn) < count else []),
        *(_motion(finding, index, data["motions"][index]) for index in drawn),
    )


def _number_of(row: Place, when: str, key: str, unit: str) -> Text:
    return row[when].number(key, unit)


def _motion(finding: Finding, index: int, row: Place) -> Figure:
    """Returns a motion's heights and residuals over time; of heights by azimuth the highest."""
    one, motion = finding.motions[index], finding.motions[index].motion
    before, after = (
        highest(values, motion.heights) for values in (one.before_heights, one.after_heights)
    )
    moments = {
        letter: moment.t
        for letter, moment in zip(LETTERS, finding.worst, strict=False)
        if moment.motion == motion.name
    }
    keys: list[Text] = [Mark(("noise, ± 2 × ", row.number("noise", "mm"), " mm"), "key gap")]
    if row.data["clock_offset"]:
        keys.append(("clock offset ", row.number("clock_offset", "ms", 1), " ms"))
    if row.data["level"]:
        keys.append(("still level ", row.number("level", "mm"), " mm"))
    peaks = [shown(place.data["peak"], "mm") for place in (row, row["before"], row["after"])]
    seen = "measured up to {} mm, before up to {} mm, after up to {} mm.".format(*peaks)
    return compared(
        row, seen, (motion.t, motion.peak_heights, before, after), one.noise, keys,
        draw=partial(_draw_letters, moments=moments),
    )  # fmt: skip


def compared(
    row: Place,
    seen: str,
    series: tuple[Array, Array, Array, Array],
    noise: float,
    beside: Sequence[Text],
    **more: Any,
) -> Figure:
    """Returns a motion's heights and residuals before and after, over time.

    Args:
        row: of the motion in the document's data.
        seen: what the heights come to, for screen readers.
        series: (N,) times [s], measured heights, those of both models [m].
        noise: standard deviation of the heights [m]; NaN: unknown.
        beside: entries of the residual's legend.
        more: attributes of the chart of the heights.
    """
    t, measured, before, after = series
    badge_of = Mark(str(row.index + 1), "badge")
    heights = Chart(
        f"motion-{row.index}",
        Mark((badge_of, row.data["name"]), "b"),
        f"Line chart of motion {row.index + 1}: {seen}",
        (
            Line("measured", "measured", t, measured),
            Line("before", "linear", t, before),
            Line("after", "nonlinear", t, after),
        ),
        **more,
    )
    residual = Chart(
        f"residual-{row.index}",
        Mark("measured − model"),
        "Line chart of measured minus model, before and after",
        (Line("", "linear", t, measured - before), Line("", "nonlinear", t, measured - after)),
        "measured − model [mm]",
        draw=partial(_draw_noise, noise=noise),
        keys=tuple(map(Mark, beside)),
        sizes=(LOW, LOW_NARROW),
    )
    return Figure((heights, residual))


def _draw_letters(axes: Any, *, moments: Mapping[str, float]) -> None:
    for letter, moment in moments.items():
        badge(axes, moment, letter)


def _draw_noise(axes: Any, *, noise: float) -> None:
    if np.isfinite(noise):
        axes.axhspan(-1e3 * BAND * noise, 1e3 * BAND * noise, color=GAP, linewidth=0.0)


def where_blocks(data: Place) -> Iterator[Block]:
    """Yields a table for each criterion, such as time or phase."""
    groups: dict[str, list[Place]] = {}
    for row in data["where"]:
        groups.setdefault(row.data["by"], []).append(row)
    if groups:
        yield explain(
            Mark("before", "key swatch"), " \xa0", Mark("after", "key swatch held"),
            " \xa0Root mean square of the residual in each part of the data, and the part’s share "
            "of the squared residual before.",
        )  # fmt: skip
    for by, rows in groups.items():
        yield _parts(by, rows)


def _parts(by: str, rows: Sequence[Place]) -> Table:
    correlates = by == "input"
    known = [row.data[key] for row in rows for key in ("before", "after")]
    length = 1.0 if correlates else max((v for v in known if v is not None), default=0.0)
    unit, suffix = ("", "") if correlates else ("mm", " [mm]")

    def bars(row: Place) -> Text:
        return Bars(tuple((row.data[key], length, key) for key in ("before", "after")))

    columns = [
        Column(part_name(by), lambda row: row.data["label"], "name"),
        Column("", bars, "bars"),
        numbers(f"before{suffix}", "before", unit, 2),
        numbers(f"after{suffix}", "after", unit, 2),
        *([] if correlates else [numbers("share [%]", "share", "% of")]),
        numbers("samples", "samples"),
    ]
    what = ": correlation with the residual’s size, 0 to 1" if correlates else ""
    return table((Mark(f"By {part_name(by)}", "b"), what), columns, rows, kind="where")


def worst_blocks(data: Place) -> tuple[Block, ...]:
    """Returns the moments at which the base model is off most."""

    def name(row: Place) -> Text:
        letter = LETTERS[row.index : row.index + 1]
        return (*([Mark(letter, "badge")] if letter else []), row.data["motion"])

    columns = (
        Column("motion", name, "name"),
        numbers("at [s]", "t", "s"),
        numbers("measured [mm]", "measured", "mm"),
        numbers("before [mm]", "before", "mm"),
        numbers("after [mm]", "after", "mm"),
    )
    if not data.data["worst"]:
        return ()
    return (table("Worst moments", columns, data["worst"], seen=False),)


def vector_figure(
    name: str, index: int, t: Array, values: Array, scale: float, label: str,
    components: tuple[str, ...],
) -> Figure:  # fmt: skip
    """Returns a chart of the components (N, K) of a vector over time (N,) [s].

    Args:
        name: of the vector.
        index: of the separating motion.
        t, values: its series.
        scale, label: of the vertical axis.
        components: their names.
    """
    kinds = ("measured", "linear", "nonlinear")
    lines = tuple(
        Line(one, kind, t, column)
        for one, kind, column in zip(components, kinds, values.T, strict=False)
    )
    seen = f"Line chart of the container's {name} over time"
    caption = Mark(name.capitalize(), "b")
    sizes = (LOW, LOW_NARROW)
    return Figure((Chart(f"{name}-{index}", caption, seen, lines, label, scale, sizes=sizes),))


def turning_of(inputs: Inputs) -> tuple[Array, str, tuple[str, ...]] | None:
    """Returns tilt and yaw (N, 2) or rates (N, 3) [rad/s] with label and names of the columns.

    None: the container does not turn.
    """
    if inputs.attitude is not None:
        x, y, z, w = (inputs.attitude / np.linalg.norm(inputs.attitude, axis=1)[:, None]).T
        upright = np.clip(1.0 - 2.0 * (x**2 + y**2), -1.0, 1.0)
        angles = np.column_stack([np.arccos(upright), np.unwrap(2.0 * np.arctan2(z, w))])
        turns = np.ptp(angles, axis=0).max() > TURNING
        return (angles, "angle [°]", ("tilt", "yaw")) if turns else None
    if inputs.angular_velocity is None or np.abs(inputs.angular_velocity).max() < TURNING:
        return None
    return inputs.angular_velocity, "rate [°/s]", ("about x", "y", "z")
