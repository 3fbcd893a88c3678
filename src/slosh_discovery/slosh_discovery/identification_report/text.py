"""Formats an identification as a short text for the terminal."""

from __future__ import annotations

import math

from slosh_base.files.plain_text import plain_line
from slosh_discovery.discovery_report.words import ShownParameter
from slosh_discovery.identification_report.data import IdentificationReport
from slosh_discovery.identify.information import Unidentified
from slosh_discovery.identify.result import IdentifiedModel
from slosh_report.page.units import DASH, shown
from slosh_report.text_table import aligned

Row = tuple[str, ...]

UNITS = {"m": (1e3, "mm"), "rad": (180.0 / math.pi, "°"), "m/s": (1e3, "mm/s"), "1": (1.0, "")}
MOST_DIGITS = 9


def identification_text(report: IdentificationReport) -> str:
    """Formats the parameters and the agreement at each operating point for the terminal."""
    found = report.found
    blocks = [
        [headline(report)],
        _parameters(found.overall),
        [held_sentence(held) for held in found.overall.held],
        _single(found.single),
        _points(report),
        [plain_line(remark) for remark in report.remarks],
    ]
    return "\n\n".join("\n".join(block) for block in blocks if block)


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
        text = (
            f"These motions cannot distinguish {held.name} from {' and '.join(held.with_others)}"
        )
    else:
        text = f"These motions do not determine {held.name}"
    text += ": it keeps its value. "
    if held.help:
        return f"{text}Needed: {held.help}."
    return f"{text}No motion of the list determines it: measure it by other means."


def _parameters(result: IdentifiedModel) -> list[str]:
    rows: list[Row] = [("parameter", "before", "found", "95 %", "")]
    for entry in (*result.parameters, *result.derived):
        text = shown_value(entry.name, entry.unit, entry.value, entry.error)
        before = rounded(entry.unit, entry.before, entry.error)
        low, high = (rounded(entry.unit, end, entry.error) for end in (entry.lower, entry.upper))
        rows.append((entry.name, before, f"{text.value} ± {text.error}", f"{low} … {high}",
                     text.unit))  # fmt: skip
    return aligned(rows, "<>>><")


def _single(results: tuple[IdentifiedModel, ...]) -> list[str]:
    if not results:
        return []
    names = list(dict.fromkeys(entry.name for one in results for entry in one.parameters))
    rows: list[Row] = [("operating point", *names)]
    for one in results:
        known = {entry.name: entry for entry in one.parameters}
        cells = [
            shown_value(name, known[name].unit, known[name].value, known[name].error).text
            if name in known
            else f"{name} held"
            for name in names
        ]
        rows.append((one.label, *(cell.partition(" = ")[2] or DASH for cell in cells)))
    return aligned(rows, "<>")


def _points(report: IdentificationReport) -> list[str]:
    points = report.found.points
    single = bool(report.found.single)
    head = ("rms residual", "motions", "before", *(("own",) if single else ()), "all")
    rows: list[Row] = [head]
    for point in points:
        own = (_millimetres(point.sosm),) if single else ()
        rows.append(
            (point.point.label, str(point.repetitions), _millimetres(point.before), *own,
             _millimetres(point.mosm))
        )  # fmt: skip
    return aligned(rows, "<>")


def _millimetres(value: float) -> str:
    return f"{shown(value, 'mm')} mm" if math.isfinite(value) else DASH


def shown_value(name: str, unit: str, value: float, error: float) -> ShownParameter:
    """Formats a value with its standard error, both with two digits of the error.

    Args:
        name: of the parameter.
        unit: SI unit, "1" for none.
        value, error: in it.
    """
    scale, shown = UNITS.get(unit, (1.0, unit))
    value, error = scale * value, scale * error
    if not (math.isfinite(error) and error > 0.0):
        return ShownParameter(name, minus(f"{value:.4g}"), DASH, shown)
    digits = min(max(0, 1 - math.floor(math.log10(error))), MOST_DIGITS)
    return ShownParameter(name, minus(f"{value:.{digits}f}"), f"{error:.{digits}f}", shown)


def rounded(unit: str, value: float, error: float) -> str:
    """Formats a number in the displayed unit, rounded according to its standard error."""
    return shown_value("", unit, value, error).value


def minus(text: str) -> str:
    """Returns the text with a typographic minus sign."""
    return text.replace("-", "−")
