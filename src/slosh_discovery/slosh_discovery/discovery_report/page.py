"""Draws the charts and fills the HTML template of a discovery's page."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np
from jinja2 import Template
from markupsafe import Markup

from slosh_base.types import Array
from slosh_discovery.discover.finding import (
    Finding,
    MotionFinding,
    Role,
    SeparatingMotion,
    Verdict,
)
from slosh_discovery.discovery_report import words
from slosh_discovery.discovery_report.data import DiscoveryReport, Document, discovery_document
from slosh_discovery.discovery_report.words import (
    NAN,
    highest,
    shown_confidence,
    shown_parameter,
)
from slosh_model.simulate import Inputs
from slosh_report.page.series import time_ends
from slosh_report.page.svg import (
    DASHES,
    GAP,
    INK,
    LINEAR,
    MEASURED,
    NARROW,
    NONLINEAR,
    WIDE,
    badge,
    chart_points,
    draw_line,
    time_chart,
)
from slosh_report.page.template import data_element, make_environment
from slosh_report.page.units import shown

ROWS = 100
"""Most rows of a table on the page; the JSON document holds them all."""
UNFOLDED = 10
"""Explanations that are shown at once."""
DRAWN = 6
"""Most motions that are drawn."""
LOW = (9.6, 2.2)
LOW_NARROW = (4.1, 2.4)
"""Sizes of the residual's charts [in]."""
SIZES = (("wide", WIDE), ("narrow", NARROW))
LOW_SIZES = (("wide", LOW), ("narrow", LOW_NARROW))
CONFIDENT = 0.9
"""A name with less is shown as something to doubt."""

Size = tuple[float, float]

BAND = 2.0
"""Half width of the band of noise, in standard deviations: 95 % of the noise lies in it."""
COLOURS = (MEASURED, LINEAR, NONLINEAR)
STYLES: tuple[Any, ...] = ("-", DASHES, "-")
"""Of the three components of a vector."""
TURNING = 1e-3
"""Smaller angles [rad] and rates [rad/s] are not worth a chart."""


def render_discovery(report: DiscoveryReport) -> str:
    """Renders the HTML page of a discovery; every text in it is escaped."""
    finding, document = report.finding, discovery_document(report)
    drawn = drawn_motions(finding)
    return _template().render(
        report=report,
        finding=finding,
        doc=document,
        rows=ROWS,
        unfolded=UNFOLDED,
        status=_status(finding),
        headline=words.headline(finding),
        sentences=(words.verdict_sentence(finding), words.gap_sentence(finding)),
        winner=_winner(document),
        tried=[entry for entry in enumerate(document["candidates"]) if entry[1]["applicable"]],
        refused=[
            entry for entry in enumerate(document["candidates"]) if not entry[1]["applicable"]
        ],
        widest=_widest(document["candidates"]),
        groups=_groups(document["where"]),
        letters=dict(enumerate(words.LETTERS)),
        drawn=drawn,
        charts=_charts(report, drawn),
        turning=[turning_of(motion.inputs) is not None for motion in finding.separating],
        seen=_seen(document),
        models=[
            (name, _changes(document["base"]["text"], model["text"]))
            for name, model in (document["group_models"] or {"": document["model"]}).items()
        ],
        changed=finding.changed,
    )


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


def _charts(report: DiscoveryReport, drawn: Sequence[int]) -> dict[str, Markup]:
    """Returns the charts of a discovery's HTML page as SVG, by name."""
    finding = report.finding
    charts: dict[str, str | None] = {}
    for index in drawn:
        motion = finding.motions[index]
        moments = {
            letter: moment.t
            for letter, moment in zip(words.LETTERS, finding.worst, strict=False)
            if moment.motion == motion.motion.name
        }
        for width, size in SIZES:
            name = f"motion-{index}-{width}"
            charts[name] = heights_chart(motion, moments, size, name)
        for width, size in LOW_SIZES:
            name = f"residual-{index}-{width}"
            charts[name] = residual_chart(motion, size, name)
    for index, separating in enumerate(finding.separating):
        for width, size in LOW_SIZES:
            for kind, draw in (("acceleration", acceleration_chart), ("turning", turning_chart)):
                name = f"{kind}-{index}-{width}"
                charts[name] = draw(separating, size, name)
    return {name: Markup(svg) for name, svg in charts.items() if svg is not None}


def _status(finding: Finding) -> str:
    """Returns the CSS class that colours the verdict of the discovery."""
    if finding.verdict is Verdict.UNEXPLAINED:
        return "failed"
    doubtful = finding.verdict is Verdict.NAMED and not finding.confidence >= CONFIDENT
    return "open" if doubtful or finding.verdict is Verdict.AMBIGUOUS else "passed"


def _winner(document: Document) -> int | None:
    """Returns the index of the candidate model that the verdict names; None if it names none."""
    names = {effect["name"] for effect in document["effects"]}
    apart = {effect["name"] for effect in document["effects"] if effect["by_group"]}
    tried = [entry for entry in enumerate(document["candidates"]) if entry[1]["applicable"]]
    return next(
        (
            index
            for index, entry in tried
            if set(entry["effects"]) == names and set(entry["per_group"]) == apart
        ),
        None,
    )


def _widest(candidates: Sequence[Document]) -> float:
    """Returns the largest residual of all candidate models [m], which has the longest bar."""
    known = [value for row in candidates for value in (row["fit_rms"], row["holdout_rms"])]
    return max((value for value in known if value is not None), default=0.0)


def _groups(rows: Sequence[Document]) -> list[dict[str, Any]]:
    """Groups rows of the residual table by the criterion, such as time or phase; keeps indices."""
    found: dict[str, list[tuple[int, Document]]] = {}
    for index, row in enumerate(rows):
        found.setdefault(row["by"], []).append((index, row))
    groups = []
    for by, entries in found.items():
        values = [v for _, row in entries for v in (row["before"], row["after"]) if v is not None]
        length = 1.0 if by == "input" else max(values, default=0.0)
        groups.append({"by": by, "name": words.part_name(by), "rows": entries, "length": length})
    return groups


def _seen(document: Document) -> dict[int, str]:
    """Describes the charts of each motion in words, for screen readers."""
    return {
        index: f"Line chart of motion {index + 1}: measured up to {shown(row['peak'], 'mm')} mm, "
        f"before up to {shown(row['before']['peak'], 'mm')} mm, "
        f"after up to {shown(row['after']['peak'], 'mm')} mm."
        for index, row in enumerate(document["motions"])
    }


def _changes(base: str, model: str) -> list[tuple[bool, str]]:
    """Returns the lines of a model file, each with whether it is new relative to the base."""
    lines = difflib.ndiff(base.splitlines(), model.splitlines())
    return [(line[0] == "+", line[2:]) for line in lines if line[0] in "+ "]


def parameter(
    path: str, effect: str, name: str, value: float | None, error: float | None
) -> Markup:
    """Formats a fitted parameter's value or standard error as HTML."""
    entry = shown_parameter(effect, name, *(NAN if v is None else v for v in (value, error)))
    text = data_element(f"{path}/parameters/{name}", value, entry.value)
    if error is not None:
        error_path = f"{path}/standard_errors/{name}"
        text += Markup(" ± ") + data_element(error_path, error, entry.error)
    return text + (Markup("&nbsp;") + entry.unit if entry.unit else "")


def fitted(
    path: str,
    parameters: Mapping[str, Mapping[str, float | None]],
    under: str = "/parameters/",
) -> Markup:
    """Formats the fitted parameters of a candidate model as HTML."""
    parts = []
    for effect, values in parameters.items():
        for name, value in values.items():
            entry = shown_parameter(effect, name, NAN if value is None else value)
            number = data_element(f"{path}{under}{effect}/{name}", value, entry.value)
            unit = Markup("&nbsp;") + entry.unit if entry.unit else ""
            whose = name if len(parameters) == 1 else f"{effect}.{name}"
            parts.append(Markup("{} = {}{}").format(whose, number, unit))
    return Markup(", ").join(parts)


def fitted_by_group(
    path: str, groups: Mapping[str, Mapping[str, Mapping[str, float | None]]]
) -> Markup:
    """Formats the parameters of a candidate model that differ between groups as HTML."""
    return Markup("; ").join(
        Markup("{}: {}").format(group, fitted(f"{path}/by_group/{group}", effects, "/"))
        for group, effects in groups.items()
    )


def named_set(names: Sequence[str], per_group: Sequence[str] = ()) -> Markup:
    """Formats a set of physical effects as HTML, without line breaks inside their names."""
    ids = (
        Markup('<span class="id" title="{}">{}</span>').format(
            words.effect_meaning(name), shown_as
        )
        for name, shown_as in zip(names, words.marked(names, per_group), strict=True)
    )
    return Markup(" + ").join(ids) or Markup(words.AS_IT_IS)


def probability(path: str, value: float | None) -> Markup:
    """Formats a probability as HTML."""
    return data_element(path, value, shown_confidence(NAN if value is None else value))


def bar(value: float | None, length: float, kind: str) -> Markup:
    """Draws a horizontal bar whose full length is `length`; nothing for an unknown value."""
    if value is None or not length > 0.0:
        return Markup("")
    width = f"{100.0 * float(np.clip(value / length, 0.0, 1.0)):.1f}"
    return Markup('<span class="bar {}" style="width: {}%"></span>').format(kind, width)


@cache
def _template() -> Template:
    environment = make_environment("slosh_discovery.discovery_report")
    environment.globals.update(
        parameter=parameter, fitted=fitted, probability=probability, bar=bar,
        named_set=named_set, fitted_by_group=fitted_by_group, effect_title=words.effect_title,
        effect_meaning=words.effect_meaning,
    )  # fmt: skip
    return environment.get_template("discovery.html.j2")


def heights_chart(
    finding: MotionFinding, moments: Mapping[str, float], size: Size, name: str
) -> str:
    """Draws measured heights and the base and discovered model's over time [mm] as SVG.

    Of wall heights by azimuth the highest are shown.

    Args:
        finding: the motion.
        moments: letters of the moments that are marked [s].
        size: of the figure [in].
        name: of the chart.
    """
    motion = finding.motion

    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        points = chart_points(size)
        for values, colour, width, dashes in (
            (motion.peak_heights, MEASURED, 2.0, "-"),
            (highest(finding.before_heights, motion.heights), LINEAR, 1.3, DASHES),
            (highest(finding.after_heights, motion.heights), NONLINEAR, 1.3, "-"),
        ):
            draw_line(axes, motion.t, values, colour, width, dashes, points)
        _letters(axes, moments.items())
        axes.set_ylabel("height [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def residual_chart(finding: MotionFinding, size: Size, name: str) -> str:
    """Draws the base and discovered model's residuals over time [mm], with noise band, as SVG."""
    motion = finding.motion
    measured = motion.peak_heights

    def draw(axes: Any) -> None:
        if np.isfinite(finding.noise):
            band = 1e3 * BAND * finding.noise
            axes.axhspan(-band, band, color=GAP, linewidth=0.0)
        axes.axhline(0.0, color=INK, linewidth=0.8)
        points = chart_points(size)
        before = measured - highest(finding.before_heights, motion.heights)
        after = measured - highest(finding.after_heights, motion.heights)
        draw_line(axes, motion.t, before, LINEAR, 1.2, DASHES, points)
        draw_line(axes, motion.t, after, NONLINEAR, 1.3, "-", points)
        axes.set_ylabel("measured − model [mm]")

    return time_chart(draw, time_ends(motion.t), size, name)


def acceleration_chart(motion: SeparatingMotion, size: Size, name: str) -> str:
    """Draws the container's acceleration over time [m/s²] as SVG."""
    inputs = motion.inputs
    return _vector_chart(inputs.t, inputs.acceleration, 1.0, "acceleration [m/s²]", size, name)


def turning_chart(motion: SeparatingMotion, size: Size, name: str) -> str | None:
    """Draws the container's tilt and yaw [°], or rates [°/s], as SVG, or None without rotation."""
    inputs = motion.inputs
    turning = turning_of(inputs)
    if turning is None:
        return None
    values, label = turning
    return _vector_chart(inputs.t, values, 180.0 / np.pi, label, size, name)


def turning_of(inputs: Inputs) -> tuple[Array, str] | None:
    """Returns labelled tilt and yaw (N, 2) or rates (N, 3) [rad/s], or None without rotation."""
    if inputs.attitude is not None:
        x, y, z, w = (inputs.attitude / np.linalg.norm(inputs.attitude, axis=1)[:, None]).T
        upright = np.clip(1.0 - 2.0 * (x**2 + y**2), -1.0, 1.0)
        angles = np.column_stack([np.arccos(upright), np.unwrap(2.0 * np.arctan2(z, w))])
        return (angles, "angle [°]") if np.ptp(angles, axis=0).max() > TURNING else None
    if inputs.angular_velocity is None or np.abs(inputs.angular_velocity).max() < TURNING:
        return None
    return inputs.angular_velocity, "rate [°/s]"


def _vector_chart(t: Array, values: Array, scale: float, label: str, size: Size, name: str) -> str:
    def draw(axes: Any) -> None:
        axes.axhline(0.0, color=INK, linewidth=0.8)
        for component, colour, dashes in zip(values.T, COLOURS, STYLES, strict=False):
            draw_line(axes, t, component, colour, 1.3, dashes, chart_points(size), scale=scale)
        axes.set_ylabel(label)

    return time_chart(draw, time_ends(t), size, name)


def _letters(axes: Any, moments: Iterable[tuple[str, float]]) -> None:
    for letter, moment in moments:
        badge(axes, moment, letter)
