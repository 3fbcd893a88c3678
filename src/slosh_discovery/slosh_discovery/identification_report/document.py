"""The result of an identification as a document."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from slosh_discovery.discover.finding import Role
from slosh_discovery.discovery_report.motions import DRAWN, compared
from slosh_discovery.discovery_report.words import (
    NAN,
    minus,
    shown_value,
)
from slosh_discovery.identification_report.charts import geometry_blocks, speed_figure
from slosh_discovery.identification_report.data import IdentificationReport, identification_data
from slosh_discovery.identify.information import Unidentified
from slosh_discovery.identify.result import FittedMotion
from slosh_report.document import (
    Block,
    Column,
    Document,
    Figure,
    KeyFigure,
    KeyFigures,
    Lines,
    Notice,
    Paragraph,
    Section,
    changed_lines,
    explain,
    numbers,
    table,
)
from slosh_report.page.svg import SPAN
from slosh_report.page.units import DASH, shown
from slosh_report.texts import Mark, Number, Place, Text


def identification_document(report: IdentificationReport) -> Document:
    """Returns an identification as a document; its data are `identification.json`."""
    found, data = report.found, Place(identification_data(report))
    overall = data["overall"]
    held = tuple(map(held_sentence, found.overall.held))
    model = changed_lines(data["base"].data["text"], overall["model"].data["text"])
    line = "Distance of the surface from a straight line"
    dwell = "Residual vibration in the dwell"
    sections = (
        Section("Parameters", _parameters(overall), "parameters"),
        Section("Operating points", _points(report, data), "speeds"),
        Section("Geometry", geometry_blocks(report), "geometry"),
        Section(line, _line(data), "line", "Straight line"),
        Section(dwell, _dwell(data), "dwell", "Dwell"),
        Section("Motions", _motions(report, data), "motions"),
        Section("Model", (Paragraph("Bold lines are new."), model), "model"),
    )
    head: tuple[Block, ...] = (
        Paragraph(report.subtitle, "subtitle"),
        *([Notice("open", "? Not identified", held)] if held else []),
        _figures(overall),
        Lines(report.remarks, kind="notes"),
    )
    title = headline(report)
    brief: tuple[Block, ...] = (
        Lines((title,)), *_parameters(overall)[:1], Lines(held), _single(data),
        _agreement(report, data), Lines(report.remarks),
    )  # fmt: skip
    return Document(title, head, sections, data.data, brief, contents=True)


def headline(report: IdentificationReport) -> str:
    """Summarises the identified parameters and the data in one sentence."""
    found = report.found
    motions = sum(point.repetitions for point in found.points)
    names = ", ".join(entry.name for entry in found.overall.parameters)
    points = len(found.points)
    where = f", {points} operating points" if points > 1 else ""
    return f"{names} from {motions} motion{'s' if motions != 1 else ''}{where}."


def held_sentence(held: Unidentified) -> str:
    """Returns a sentence on a parameter that the motions do not determine, and on a remedy."""
    if held.with_others:
        others = " and ".join(held.with_others)
        text = f"These motions cannot distinguish {held.name} from {others}"
    else:
        text = f"These motions do not determine {held.name}"
    text += ": it keeps its value. "
    if held.help:
        return f"{text}Needed: {held.help}."
    return f"{text}No motion of the list determines it: measure it by other means."


def _said(entry: Place, key: str = "value") -> Number:
    """Returns a number of a parameter, rounded by its standard error."""
    known, error = (NAN if entry.data[k] is None else entry.data[k] for k in (key, "error"))
    said = shown_value("", entry.data["unit"], 0.0 if key == "error" else known, error)
    return entry.said(key, said.error if key == "error" else said.value)


def _unit(entry: Place) -> str:
    return shown_value("", entry.data["unit"], 0.0).unit


def _correlation(place: Place, key: str | int) -> Number:
    value = place.data[key]
    return place.said(key, DASH if value is None else minus(f"{value:.2f}"))


def _figures(overall: Place) -> KeyFigures:
    noise = overall["noise"]
    note = (
        "noise ", noise.number("stddev", "mm"), " mm, neighbours correlate by ",
        _correlation(noise, "correlation"),
    )  # fmt: skip
    figures = [
        KeyFigure(entry.data["name"], _said(entry), _unit(entry), ("± ", _said(entry, "error")))
        for entry in overall["parameters"]
    ]
    rms = KeyFigure("rms residual", overall.number("seoe", "mm"), "mm", note)
    return KeyFigures((*figures, rms))


def _parameters(overall: Place) -> tuple[Block, ...]:
    entries = list(overall["parameters"])
    derived = list(overall["derived"])
    columns = (
        Column("parameter", lambda one: Mark(one.data["name"], "code"), "name"),
        Column("before", lambda one: _said(one, "before"), "n"),
        Column("found", lambda one: (_said(one), " ± ", _said(one, "error")), "n"),
        Column("95 %", lambda one: (_said(one, "lower"), " … ", _said(one, "upper")), "n"),
        Column("unit", _unit, only="page"),
        Column("", _unit, only="text"),
    )
    marks = ("",) * len(entries) + ("derived",) * len(derived)
    caption = "One model for all motions" + ("; derived values below" if derived else "")
    blocks: list[Block] = [table(caption, columns, [*entries, *derived], marks=marks)]
    if len(entries) > 1:
        names = [entry.data["name"] for entry in entries]
        others = (
            Column(name, partial(_correlation, key=index), "n") for index, name in enumerate(names)
        )
        own = Column("parameter", lambda row: Mark(names[row.index], "code"), "name")
        rows = overall["correlations"]
        blocks.append(table("Correlations of their errors", (own, *others), rows, kind="slim"))
    scatter: Text = ""
    if overall.data["scatter"] > 1.0:
        scatter = (
            ", and are ", overall.number("scatter", "×"), " times as large as the noise alone "
            "would give, because the motions differ by more",
        )  # fmt: skip
    blocks.append(
        explain(
            "Outliers are weighted by their size, not by its square; ",
            overall.number("outliers", "% of", 1), " % of the heights are outliers. The errors "
            "account for the noise’s correlation", scatter, ".",
        )
    )  # fmt: skip
    return tuple(blocks)


def _points(report: IdentificationReport, data: Place) -> tuple[Block, ...]:
    single = data.data["single"]
    meaning = "Root mean square of measured minus simulated height over all repetitions (SEOE)."
    return (
        *speed_figure(report.found.points, bool(single)),
        _agreement(report, data),
        explain(meaning),
        *([_single(data)] if single else []),
    )


def _agreement(report: IdentificationReport, data: Place) -> Block:
    own = [numbers("own model [mm]", "sosm", "mm")] if report.found.single else []
    columns = (
        Column("operating point", lambda row: row.data["label"], "name"),
        numbers("motions", "repetitions"),
        numbers("before [mm]", "before", "mm"),
        *own,
        numbers("model of all [mm]", "mosm", "mm"),
    )
    return table("Agreement by operating point", columns, data["points"], seen=False)


def _single(data: Place) -> Block:
    """Returns the models of single operating points; a page names their files."""
    rows = data["single"]
    names = dict.fromkeys(entry["name"] for one in rows.data for entry in one["parameters"])

    def value(one: Place, name: str) -> Text:
        for entry in one["parameters"]:
            if entry.data["name"] == name:
                return _said(entry), " ± ", _said(entry, "error"), f" {_unit(entry)}".rstrip()
        return "held"

    def file(one: Place) -> Text:
        return Mark(one.data["file"], "code") if one.data["file"] else DASH

    columns = (
        Column("operating point", lambda one: one.data["label"], "name"),
        *(Column(name, partial(value, name=name), "n") for name in names),
        Column("file", file, only="page"),
    )
    return table("A model for each operating point", columns, rows)


def _line(data: Place) -> tuple[Block, ...]:
    line = data["line"]
    if not line.data:
        return ()
    columns = (
        Column("speed [1/min]", lambda row: row.exact("speed", 4), "n"),
        numbers("motions", "repetitions"),
        numbers("mean [mm]", "mean", "mm", 3),
        numbers("standard deviation [mm]", "stddev", "mm", 3),
        Column("greatest acceleration [m/s²]", lambda row: row.exact("acceleration", 3), "n"),
        Column("jerk [m/s³]", lambda row: row.exact("jerk", 3), "n"),
    )
    marks = tuple("won" * (row["speed"] == line.data["speed"]) for row in line.data["errors"])
    caption = (
        "Root mean square distance from the nearest line while the container moves, tolerable ",
        line.number("tolerance", "mm"), " mm",
    )  # fmt: skip
    return (table(caption, columns, line["errors"], marks=marks),)


def _dwell(data: Place) -> tuple[Block, ...]:
    if not data.data["dwell"]:
        return ()
    columns = (
        Column("operating point", lambda row: row.data["point"], "name"),
        numbers("motions", "repetitions"),
        numbers("greatest η_eff [mm]", "measured", "mm"),
        numbers("Δη_appr [mm]", "line", "mm"),
        numbers("Δη_simul [mm]", "simulated", "mm"),
    )
    return (
        table("Residual vibration by operating point", columns, data["dwell"], seen=False),
        explain(
            "Effective height of the surface over the dwell, its effective distance from the "
            "nearest lines, and that from the simulated ones."
        ),
    )


def drawn_motions(motions: Sequence[FittedMotion]) -> list[int]:
    """Returns the indices of the motions to draw: held-out ones, then one per operating point."""
    held = [index for index, motion in enumerate(motions) if motion.role is Role.HOLDOUT]
    firsts = {motion.point: index for index, motion in reversed(list(enumerate(motions)))}
    spread = sorted(set(firsts.values()) - set(held))
    # A fitted motion is always among them: the reader sees what the parameters come from.
    held = held[: DRAWN // 2]
    room = max(DRAWN - len(held), 1)
    step = max(len(spread) / room, 1.0)
    chosen = [spread[int(number * step)] for number in range(min(room, len(spread)))]
    return sorted({*chosen, *held})


def _motions(report: IdentificationReport, data: Place) -> tuple[Block, ...]:
    def name(row: Place) -> Text:
        one = row.data
        kinds = ("held out" * (one["role"] == "holdout"), "free decay" * one["free_decay"])
        point = one["point"] if one["point"] != one["name"] else ""
        when = " ".join(filter(None, (point, *kinds)))
        return Mark(str(row.index + 1), "badge"), one["name"], Mark(when, "when")

    columns = (
        Column("motion", name, "name"),
        numbers("highest [mm]", "peak", "mm"),
        numbers("rms before [mm]", "seoe_before", "mm"),
        numbers("after [mm]", "seoe", "mm"),
        numbers("MAE [mm]", "sigma", "mm"),
        numbers("ε [%]", "epsilon", "%"),
        numbers("clock [ms]", "clock_offset", "ms", 1),
    )
    motions = report.found.motions
    meaning = (
        "MAE is the mean absolute error of the highest height, ε the relative error of its "
        "maximum, both after."
    )
    return (
        table("Agreement with each motion", columns, data["motions"], kind="matrix", seen=False),
        explain(meaning),
        *(_motion(report, motions[at], data["motions"][at]) for at in drawn_motions(motions)),
    )


def _motion(report: IdentificationReport, motion: FittedMotion, row: Place) -> Figure:
    """Returns a motion's heights and residuals over time, at the azimuth that moves most."""
    found = report.found
    own = [one for one in found.single if one.label == motion.point] or [found.overall]
    spans = np.nanmax(motion.measured, axis=0) - np.nanmin(motion.measured, axis=0)
    column = int(np.nanargmax(spans))
    measured, before, after, band = (
        values[:, column] for values in (motion.measured, motion.before, motion.after, motion.band)
    )

    def draw(axes: Any) -> None:
        low, high = 1e3 * (after - band), 1e3 * (after + band)
        axes.fill_between(motion.t, low, high, color=SPAN, linewidth=0.0)

    seen = (
        f"measured up to {shown(row.data['peak'], 'mm')} mm; rms residual "
        f"{shown(row.data['seoe_before'], 'mm')} mm before, {shown(row.data['seoe'], 'mm')} mm "
        "after."
    )
    noise = Mark("noise, ± 2 standard deviations", "key gap")
    return compared(
        row, seen, (motion.t, measured, before, after), own[0].noise.stddev, (noise,),
        keys=(Mark("its 95 % band", "key span"),), draw=draw,
    )  # fmt: skip
