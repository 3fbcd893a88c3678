"""The report of a run as a document."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

from slosh_report.document import (
    Block,
    Chart,
    Code,
    Column,
    Document,
    Facts,
    Figure,
    Group,
    Heading,
    KeyFigure,
    KeyFigures,
    Lines,
    Notice,
    Paragraph,
    Picture,
    Section,
    Table,
    explain,
    numbers,
    table,
)
from slosh_report.page.units import DASH, digits_that_differ, unit_style
from slosh_report.run_report.charts import (
    frame_letters,
    heights_chart,
    motion_figures,
    run_figures,
)
from slosh_report.run_report.data import RunReport
from slosh_report.run_report.figures import report_document
from slosh_report.run_report.polar import SIZE, draw_polar
from slosh_report.run_report.rows import RunVerdict
from slosh_report.texts import Mark, Place, Text

UNFOLDED = 4
"""Fields that differ and are shown at once."""
VERDICTS = {
    RunVerdict.PASSED: ("passed", "✓ Passed"),
    RunVerdict.FAILED: ("failed", "✗ Failed"),
    RunVerdict.NO_EXPECTATION: ("", "No expectation"),
}


def render_report(report: RunReport) -> str:
    """Renders the report as HTML; equal reports give equal pages.

    Args:
        report: what to show; every text in it is escaped.
    """
    from slosh_report.page.html import html_page  # with the templates

    return html_page(run_document(report))


def run_document(report: RunReport) -> Document:
    """Returns the report of a run as a document; its data are those of `report_document`."""
    data = Place(report_document(report))
    heights = run_figures(report, data) or (
        Lines((), "No height is known, measured or estimated."),
    )
    letters = zip(report.frames, frame_letters(report), strict=True)
    pictures = tuple(Picture(frame, letter) for frame, letter in letters)
    sections = (
        Section("Checks", tuple(_checks(data)), "checks"),
        Section("Heights", heights, "heights"),
        Section("Further containers", _further(report, data), "further"),
        Section("Agreement", _agreement(data), "agreement", kind="brief"),
        Section("Motions", _motions(report, data), "motions"),
        Section("Where the liquid is highest", _azimuth(report, data), "azimuth", "Azimuth"),
        Section("Limit events", _events(data), "events"),
        Section("Camera", (Group(pictures, "frames"),) if pictures else (), "camera"),
        Section("Record", _record(report, data), "record"),
        Section("Model", _model(report), "model"),
    )
    return Document(report.title, tuple(_head(report, data)), sections, data.data, contents=True)


def _head(report: RunReport, data: Place) -> Iterator[Block]:
    yield Paragraph(data.data["sentence"], "sentence")
    yield Paragraph(report.subtitle, "subtitle")
    kind, title = VERDICTS[report.status.verdict]
    if kind or report.status.reasons:
        yield Notice(kind, title, report.status.reasons, listed=True)
    if report.warnings:
        title = "⚠ Warning" + "s" * (len(report.warnings) > 1)
        yield Notice("warning", title, report.warnings, listed=True)
    if report.key_figures:
        yield KeyFigures(tuple(_key_figure(row) for row in data["key_figures"]))
    yield Lines(report.notes, kind="notes")


def _key_figure(row: Place) -> KeyFigure:
    given, unit = row.data["value"], row.data["unit"]
    value: Text = given if isinstance(given, str) else row.number("value", unit)
    return KeyFigure(row.data["label"], value, unit, row.data["note"])


def _checks(data: Place) -> Iterator[Block]:
    def name(check: Place) -> Text:
        unit = check.data["unit"]
        return f"{check.data['name']} [{unit}]" if unit else str(check.data["name"])

    def found(check: Place) -> Text:
        return check.number("value", check.data["unit"], close_digits(check.data))

    columns = (
        Column("what", name, "name"),
        Column("found", found, "n"),
        Column("expected", _expected, "n"),
        Column("verdict", _verdict, "verdict"),
    )
    if data.data["checks"]:
        yield table("Found and expected values", columns, data["checks"], seen=False)
    for entry in data["verifications"]:
        kind = "b passed" if entry.data["passed"] else "b failed"
        sign = "✓" if entry.data["passed"] else "✗"
        count = (entry.number("same"), " of ", entry.number("total"))
        yield Paragraph((Mark(sign, kind), f" {entry.data['name']}: ", Mark(count, kind)))
        yield from _differences(list(entry["differences"]))


def _verdict(check: Place) -> Text:
    return "✓ passed" if check.data["passed"] else "✗ failed"


def _expected(check: Place) -> Text:
    """Returns the expected value: a number with tolerance, a bound, or anything."""
    known, unit, digits = check.data, check.data["unit"], close_digits(check.data)
    if known["tolerance"] is not None:
        middle = check.number("expected", unit, digits)
        if not known["tolerance"]:
            return middle
        size = f"{unit_style(unit).scale * known['tolerance']:.2g}"
        return middle, " ± ", check.said("tolerance", size)
    for key, sign in (("lower", "≥ "), ("upper", "≤ ")):
        if known[key] is not None:
            return sign, check.number(key, unit, digits)
    return "any"


def close_digits(check: dict[str, Any]) -> int:
    """Returns the number of decimals that show by how much a value misses its bound."""
    value, unit, lower = check["value"], check["unit"], check["lower"]
    if check["passed"] or value is None:
        return digits_that_differ(None, None, unit)
    missed = lower if lower is not None and value < lower else check["upper"]
    return digits_that_differ(value, missed, unit)


def _differences(rows: Sequence[Place]) -> Iterator[Block]:
    """Yields the fields that a replay did not reproduce, all but some of them folded."""
    topics = list(dict.fromkeys(row.data["topic"] for row in rows))

    def name(row: Place) -> Text:
        own = row.data["field"]
        if len(topics) > 1:
            own = f"{row.data['topic']} {own}"
        return Mark(own, "code")

    columns = (
        Column("field" if len(topics) == 1 else "topic, field", name, "name"),
        numbers("messages", "count"),
        numbers("first at [s]", "first", "s", 3),
        Column("recorded", lambda row: row.exact("recorded"), "n"),
        Column("replayed", lambda row: row.exact("replayed"), "n"),
        Column("largest difference", lambda row: row.exact("largest", 3), "n"),
    )
    of: Text = (" of ", Mark(topics[0], "code")) if len(topics) == 1 else ""
    caption = ("Fields", of, " that differ")
    ordered = sorted(rows, key=lambda row: row.data["first"] is None)
    others = ordered[UNFOLDED:]
    if rows:
        yield table(caption, columns, ordered[:UNFOLDED])
    if others:
        yield Group((table(caption, columns, others),), summary=f"{len(others)} more fields")
    if rows:
        yield explain("In each field’s own unit: SI, as in the messages.")


def _further(report: RunReport, data: Place) -> tuple[Block, ...]:
    figures = []
    for run, row in zip(report.further, data["further"], strict=True):
        names: tuple[Text, ...] = (
            ("measured, highest ", row.number("measured", "mm", 1), " mm"),
            run.linear_name,
            (f"{run.nonlinear_name}, highest ", row.number("estimated", "mm", 1), " mm"),
        )
        limit = Mark(("limit ", row.number("limit", "mm", 1), " mm"), "key limit")
        chart = heights_chart(
            run, f"further-{row.index}", Mark(run.title, "b"), names=names,
            seen=row.data["sentence"], keys=(limit,) if run.limit is not None else (),
        )  # fmt: skip
        figures.append(Figure((chart,)))
    meaning = (
        "Of a tray: each container with a camera of its own, as its comparisons were recorded."
    )
    return (*figures, explain(meaning)) if figures else ()


def _agreement(data: Place) -> tuple[Block, ...]:
    rows = [*data.data["models"], *(row for m in data.data["motions"] for row in m["models"])]
    apart = any(row["offset"] is not None for row in rows)
    columns = (
        Column("model", lambda row: row.data["name"], "name"),
        numbers("MAE [mm]", "sigma", "mm"),
        numbers("ε [%]", "epsilon", "%"),
        numbers("RMS [mm]", "rms", "mm"),
        *([numbers("clock offset [s]", "offset", "s", 3)] if apart else []),
        numbers("images", "count"),
    )
    if not data.data["models"]:
        return ()
    caption = "Agreement of each model with the measurement"
    clocks = (
        " The clocks of camera and robot are not related: each model is shifted by the offset "
        "that fits the measurement best."
    )
    return (
        table(caption, columns, data["models"], kind="slim", seen=False),
        explain(
            "MAE is the mean absolute error; ε is the model’s highest height against the measured "
            "one, positive where the model is too high." + clocks * apart
        ),
    )


def _motions(report: RunReport, data: Place) -> tuple[Block, ...]:
    if not report.motions:
        return ()
    close = motion_figures(report)
    name = report.nonlinear_name
    heading = f"The {len(close)} motions with the largest errors of {name}"
    blocks: list[Block] = [_motion_table(data)]
    if close and len(close) < len(report.motions):
        blocks.append(Heading(heading))
    return (*blocks, *([Group(close, "small-charts")] if close else []))


def _motion_table(data: Place) -> Table:
    names = dict.fromkeys(row["name"] for m in data.data["motions"] for row in m["models"])

    def motion(row: Place) -> Text:
        number = str(row.index + 1)
        when = (row.number("start", "s"), " to ", row.number("end", "s"), " s")
        name = row.data["name"] if row.data["name"] != number else ""
        return Mark(number, "badge"), name, Mark(when, "when")

    columns = [Column("motion", motion, "name"), numbers("highest [mm]", "peak", "mm")]
    for group, key, unit in (("MAE [mm]", "sigma", "mm"), ("ε [%]", "epsilon", "%")):
        columns += [
            Column(name, partial(_of_model, name=name, key=key, unit=unit), "n", group)
            for name in names
        ]
    caption = "MAE and ε of each model over each motion"
    return table(caption, columns, data["motions"], kind="matrix", seen=False)


def _of_model(motion: Place, name: str, key: str, unit: str) -> Text:
    """Returns a model's number over a motion; that of the least MAE stands out."""
    models = motion.data["models"]
    index = next((i for i, row in enumerate(models) if row["name"] == name), None)
    if index is None:
        return DASH
    known = [(row["sigma"], i) for i, row in enumerate(models) if row["sigma"] is not None]
    number = motion["models"][index].number(key, unit)
    return Mark(number, "best") if known and min(known)[1] == index else number


def _azimuth(report: RunReport, data: Place) -> tuple[Block, ...]:
    measured, estimated = report.measured_azimuth, report.estimated_azimuth
    if measured is None and estimated is None:
        return ()
    pairs = ((measured, "key dot"), (estimated, "key nonlinear"))
    keys = tuple(Mark(series.name, kind) for series, kind in pairs if series is not None)
    seen = "Polar chart of the place of the highest liquid on the wall, seen from above."
    chart = Chart(
        "azimuth", "", seen, keys=keys, draw=partial(draw_polar, report=report), sizes=(SIZE,),
        projection="polar",
    )  # fmt: skip
    azimuth = data["azimuth"]
    median: Text = ""
    if azimuth.data["count"]:
        half = Mark((azimuth.number("median", "°", 1), "°"), "b")
        count = azimuth.number("count")
        median = ("Half of the azimuths differ by at most ", half, " (", count, " images).")
    texts = (
        Paragraph(
            "The container from above: the direction is the place on the wall, the distance from "
            "the centre is the height there. Early moments are pale, late ones dark."
        ),
        explain(
            "Shown above ", azimuth.number("threshold", "mm", 1), " mm; on a flatter surface the "
            "highest place is random. 0° is the container’s +x, counter-clockwise.",
        ),
        Paragraph(median),
    )  # fmt: skip
    return (Group((Figure((chart,)), Group(texts)), "beside"),)


def _events(data: Place) -> tuple[Block, ...]:
    columns = (
        Column("what", _event, "name"),
        numbers("start [s]", "start", "s"),
        numbers("duration [s]", "duration", "s"),
        numbers("limit [mm]", "limit", "mm"),
        numbers("peak [mm]", "peak", "mm"),
        numbers("peak at [s]", "peak_time", "s"),
    )
    if not data.data["events"]:
        return (Lines((), "No limit was exceeded."),)
    return (table("Limit events", columns, data["events"], seen=False),)


def _event(row: Place) -> Text:
    why = row.data["description"]
    return row.data["source"], Mark(why, "small") if why else ""


def _record(report: RunReport, data: Place) -> tuple[Block, ...]:
    def rate(row: Place) -> Text:
        fast = row.data["rate"] is not None and row.data["rate"] >= 100.0
        return row.number("rate", "1/s", 0 if fast else 1)

    counted = any(topic.lost is not None for topic in report.topics)
    columns = (
        Column("topic", lambda row: Mark(row.data["name"], "code"), "name"),
        Column("type", lambda row: Mark(row.data["type"], "code"), "name"),
        numbers("messages", "count"),
        Column("per second", rate, "n"),
        *([numbers("lost", "lost")] if counted else []),
    )
    facts = tuple((fact.label, fact.text) for fact in report.facts)
    blocks: list[Block] = [Facts(facts)] if facts else []
    if report.topics:
        blocks.append(table("Recorded topics", columns, data["topics"], seen=False))
    return tuple(blocks)


def _model(report: RunReport) -> tuple[Block, ...]:
    if not report.model_text:
        return ()
    effects = tuple((Mark(name, "code"), text) for name, text in report.effects.items())
    return (Code(report.model_text), *([Facts(effects)] if effects else []))
