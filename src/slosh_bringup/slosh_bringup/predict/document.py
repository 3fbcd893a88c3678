"""Predicted motions as a document: table of the terminal, JSON and page."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

from slosh_base.files.plain_text import plain_line
from slosh_plan import Prediction, SafeScales
from slosh_plan.limits import rim_words
from slosh_plan.tray import TrayPrediction
from slosh_plan.validity import validity_words
from slosh_report.document import (
    Column,
    Document,
    Lines,
    Paragraph,
    Section,
    explain,
    numbers,
    table,
)
from slosh_report.json_values import plain
from slosh_report.page.units import DASH
from slosh_report.texts import Mark, Place, Text


class PredictedMotion(NamedTuple):
    """A motion's prediction.

    Attributes:
        one: the prediction; of a tray, of the container nearest to its limit.
        scale: time scales that are safe; None: not asked for.
        of_tray: of all containers; None: there is one alone.
    """

    one: Prediction
    scale: SafeScales | None = None
    of_tray: TrayPrediction | None = None

    @property
    def facts(self) -> dict[str, Any]:
        """The results in SI units, under the keys of `slosh predict --json`."""
        one, scale, linear, nonlinear = self.one, self.scale, self.one.linear, self.one.nonlinear
        return {
            "trajectory": plain_line(one.name),
            "models": [linear.model, nonlinear.model],
            "duration": one.duration,
            "peak_linear": linear.peak,
            "peak_nonlinear": nonlinear.peak,
            "peak_lower": one.lower,
            "peak_upper": one.upper,
            "peak_time": nonlinear.peak_time,
            "azimuth": nonlinear.azimuth,
            "residual_linear": linear.residual,
            "residual_nonlinear": nonlinear.residual,
            "settling_time": nonlinear.settling_time,
            "excess": one.excess,
            "height_limit": one.limits.height,
            "limited_by": one.limits.height_name,
            "distance_to_rim": one.distance_to_rim,
            "residual_excess": one.residual_excess,
            "kept": one.kept,
            "flags": int(one.flags),
            "time_scale": math.nan if scale is None else scale.safe_from,
            "safe_scales": [] if scale is None else [list(pair) for pair in scale.intervals],
            "scaled": scale is not None,
            "proven": scale is not None and scale.proven,
            "remarks": self.remarks,
            **self._containers(),
        }

    def _containers(self) -> dict[str, Any]:
        tray = self.of_tray
        if tray is None:
            return {}
        peaks = {name: one.nonlinear.peak for name, one in tray.containers.items()}
        loose = {name: use._asdict() for name, use in tray.standing.items()}
        return {"container": tray.worst, "containers": peaks, "standing": loose}

    @property
    def remarks(self) -> list[str]:
        """What is to be known of the motion, a few words each."""
        return list(_remarks(self.one, self.scale, self.of_tray))


def _remarks(
    one: Prediction, scale: SafeScales | None, of_tray: TrayPrediction | None
) -> Iterator[str]:
    if of_tray is not None:
        yield from _of_tray(of_tray)
    if math.isfinite(one.distance_to_rim):
        yield rim_words(one.distance_to_rim).removeprefix(", ")
    if one.unresolved == math.inf:
        yield "the rows do not tell the motion: no height is certain"
    elif one.excess > 0.0:
        yield f"{1e3 * one.excess:.1f} mm above the {one.limits.height_name}"
    if 0.0 < one.residual_excess < math.inf:
        yield f"{1e3 * one.residual_excess:.1f} mm above the residual limit"
    if scale is not None and scale.islands:
        yield "also safe: " + ", ".join(f"{low:.3f} … {high:.3f}" for low, high in scale.islands)
    if scale is not None and math.isnan(scale.safe_from) and not one.kept:
        yield "no safe time scale"
    yield from validity_words(one.flags, one.growth)


def _of_tray(each: TrayPrediction) -> Iterator[str]:
    """Yields lines on a tray's container nearest to its limit and on its other containers."""
    others = ", ".join(
        f"{name} {1e3 * one.nonlinear.peak:.1f} mm"
        for name, one in each.containers.items()
        if name != each.worst
    )
    yield f"worst container {each.worst}" + (f" ({others})" if others else "")
    yield from each.loose_words
    for name, one in each.containers.items():
        if name != each.worst:
            yield from (f"{name}: {words}" for words in validity_words(one.flags, one.growth))


def _red(number: Text, is_red: bool) -> Text:
    return Mark(number, "failed") if is_red else number


def _peak(row: Place) -> Text:
    """Returns the peak height with its interval [mm], if the model's error is known."""
    peak, upper = row.number("peak_nonlinear", "mm", 1), row.number("peak_upper", "mm", 1)
    interval = (" (", row.number("peak_lower", "mm", 1), " … ", upper, ")")
    return _red((peak, interval if upper.value != peak.value else ""), bool(row.data["excess"]))


def _residual(row: Place) -> Text:
    return _red(row.number("residual_nonlinear", "mm", 1), bool(row.data["residual_excess"]))


def _limit(row: Place) -> Text:
    return row.number("height_limit", "mm", 1), " (rim)" * (row.data["limited_by"] == "rim")


def _safe_from(row: Place) -> Text:
    """Tells from which time scale on a motion keeps the limits, and that it does as given."""
    scale = row.number("time_scale", "×", 3)
    if not row.data["kept"] or not row.data["scaled"]:
        return scale
    if scale.value is None:
        return row.said("time_scale", "as given")
    return scale if scale.value <= 1.0 else ("as given, slower ", scale)


COLUMNS = (
    Column("motion", lambda row: row.data["trajectory"], "name"),
    numbers("duration [s]", "duration", "s", 3),
    Column("peak [mm]", _peak, "n"),
    numbers("linear peak [mm]", "peak_linear", "mm", 1),
    replace(numbers("peak time [s]", "peak_time", "s", 3), only="text"),
    numbers("azimuth [deg]", "azimuth", "°"),
    Column("residual [mm]", _residual, "n"),
    replace(numbers("settling time [s]", "settling_time", "s", 1), only="text"),
    Column("limit [mm]", _limit, "n", only="page"),
    Column("safe from", _safe_from, "n"),
    Column("kept", lambda row: "✓ yes" if row.data["kept"] else "✗ no", "verdict", only="page"),
    Column("remarks", lambda row: "; ".join(row.data["remarks"]) or DASH, only="text"),
)


def predicted_document(
    rows: Sequence[PredictedMotion], problems: Sequence[Sequence[str]] = ()
) -> Document:
    """Returns predicted motions as a document, whose data are what `--json` prints.

    Args:
        rows: the motions, at least one.
        problems: of each motion's input.
    """
    data = Place(plain([row.facts for row in rows]))
    title = f"{len(rows)} predicted motions"
    if any(row.one.limits.given for row in rows):
        title = f"{sum(row.one.kept for row in rows)} of {len(rows)} motions within their limits"
    linear, nonlinear = data.data[0]["models"]
    noted = tuple(
        f"{row.facts['trajectory']}: {'; '.join([*row.remarks, *own])}"
        for row, own in zip(rows, problems or [()] * len(rows), strict=True)
        if row.remarks or own
    )
    results = table("Results of each motion", COLUMNS, data, seen=False)
    blocks = (
        results,
        Lines(noted, kind="notes"),
        explain(
            "Red: a limit is exceeded. All motions start with the liquid at rest; the residual is "
            "the greatest height after the motion’s end. safe from: every run slower than this "
            "multiple of the duration keeps the limits."
        ),
    )
    return Document(
        title,
        (Paragraph(f"by {nonlinear}, the linear peak by {linear}", "subtitle"),),
        (Section("Motions", blocks, "motions"),),
        data.data,
        (results,),
    )
