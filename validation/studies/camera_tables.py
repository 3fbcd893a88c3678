"""Formats the camera's accuracy as Markdown tables, and lists unmet requirements."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from camera_figures import HeightFigures, SequenceFigures
from camera_robustness import DisturbedFigures, Spread
from result_tables import fill

from slosh_camera.errors import SloshCameraError

_HEIGHTS = "| {} | n | NaN | RMS | max | bias | azimuth | wall | 1σ | 2σ | σ | silent |"
_FLAGS = (
    "| edges and flags | left | right | SATURATED where cut | where the peak is outside | "
    "cut, no flag | bound broken | false SATURATED | other flags |"
)
_DISTURBED = "| {} | still too | warned | flags | RMS | max | × | worst × | fitted RMS | max |"


def accuracy_tables(rows: Sequence[SequenceFigures]) -> str:
    """Formats three tables: highest point, fitted line, edges and flags [mm, deg]."""
    raw = [_height_row(row.name, row.raw) for row in rows]
    fitted = [_height_row(row.name, row.fitted) for row in rows]
    parts = [
        _table(_HEIGHTS.format("highest point"), raw),
        _table(_HEIGHTS.format("fitted line"), fitted),
        _table(_FLAGS, [_flag_row(row) for row in rows]),
    ]
    return "\n".join(parts)


def disturbance_table(
    name: str, rows: Sequence[tuple[DisturbedFigures, Sequence[DisturbedFigures]]]
) -> str:
    """Formats the accuracy under each disturbance as a table.

    Args:
        name: of the sequence or of all.
        rows: figures of one sequence or of all together, and those of the single sequences.
    """
    return _table(_DISTURBED.format(name), [_disturbed_row(row, parts) for row, parts in rows])


def shortfalls(row: SequenceFigures) -> list[str]:
    """Lists the requirements on the camera that a sequence does not meet, one line each."""
    found = [
        *_height_shortfalls(row.raw, "highest point"),
        *_height_shortfalls(row.fitted, "fitted line"),
    ]
    if row.cut and row.cut_flagged < 0.98 * row.cut:
        found.append(f"SATURATED in {row.cut_flagged} of {row.cut} cut frames, asked is 98 %")
    if row.false_saturated:
        found.append(f"{row.false_saturated} false SATURATED")
    return [f"not met: {row.name}: {line}" for line in found]


def replace_table(page: Path, name: str, table: str) -> None:
    """Replaces the text between `<!-- table NAME -->` and `<!-- end NAME -->` in a page.

    Raises:
        SloshCameraError: the page cannot be read or has no such place.
    """
    try:
        fill(page, name, table)
    except OSError as error:
        raise SloshCameraError(f"{page}: {error.strerror}") from None
    except ValueError as error:
        raise SloshCameraError(str(error)) from None


def _height_shortfalls(row: HeightFigures, kind: str) -> list[str]:
    if row.count == 0:
        return [f"{kind}: no height in any frame"]
    azimuth = math.degrees(row.azimuth_rms)
    within = _percent(row.within_1)
    # A figure that is not known (no high peak, no wall to name) is no shortfall.
    checks = {
        f"{row.missing} frames without a height": row.missing > 0,
        f"RMS {_mm(row.rms)} mm, asked is 0.5": row.rms >= 0.5e-3,
        f"largest error {_mm(row.largest)} mm, asked is 1.5": row.largest >= 1.5e-3,
        f"bias {_mm(row.bias)} mm, asked is 0.2": abs(row.bias) >= 0.2e-3,
        f"azimuth {azimuth:.1f}°, asked is 8": azimuth >= 8.0,
        f"right wall in {_percent(row.side_share)}, asked is 98 %": row.side_share < 0.98,
        f"{within} within 1σ, asked is 58 to 78 %": not 0.58 <= row.within_1 <= 0.78,
    }
    return [f"{kind}: {text}" for text, bad in checks.items() if bad]


def _height_row(name: str, row: HeightFigures) -> str:
    cells = [
        name,
        str(row.count),
        str(row.missing),
        _mm(row.rms),
        _mm(row.largest),
        _number(1e3 * row.bias, "+.2f"),
        _number(math.degrees(row.azimuth_rms), ".1f"),
        f"{row.side_right}/{row.side_count}",
        _percent(row.within_1),
        _percent(row.within_2),
        _mm(row.sigma),
        str(row.silent),
    ]
    return _line(cells)


def _flag_row(row: SequenceFigures) -> str:
    cells = [
        row.name,
        _mm(row.left_rms),
        _mm(row.right_rms),
        f"{row.cut_flagged}/{row.cut}",
        f"{row.outside_flagged}/{row.outside}",
        str(row.cut_silent),
        str(row.bound_broken),
        f"{row.false_saturated}/{row.uncut}",
        _counts(row.other_flags),
    ]
    return _line(cells)


def _disturbed_row(row: DisturbedFigures, parts: Sequence[DisturbedFigures]) -> str:
    warned = f"{row.warned}/{row.frames}" + (" refused" if row.refusals else "")
    raw = _spread_cells(row.raw, [part.raw for part in parts])
    fitted = _spread_cells(row.fitted, [part.fitted for part in parts])
    name = row.name + "".join(f", **{shortfall}**" for shortfall in row.shortfalls)
    still = "yes" if row.on_still else "no"
    return _line([name, still, warned, _counts(row.flags), *raw, *fitted[:2]])


def _spread_cells(row: Spread, parts: Sequence[Spread]) -> list[str]:
    worst = max((part.ratio for part in parts if math.isfinite(part.ratio)), default=math.nan)
    return [
        _mm(row.rms),
        _mm(row.largest),
        _number(row.ratio, ".2f"),
        _number(worst, ".2f"),
    ]


def _table(head: str, lines: Sequence[str]) -> str:
    columns = head.count("|") - 2
    return "\n".join([head, "|---" + "|--:" * columns + "|", *lines, ""])


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _counts(flags: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in flags.items()) or "none"


def _mm(metres: float) -> str:
    return _number(1e3 * metres, ".2f")


def _percent(share: float) -> str:
    text = _number(100.0 * share, ".0f")
    return text if text == "–" else f"{text} %"


def _number(value: float, form: str) -> str:
    return f"{value:{form}}" if math.isfinite(value) else "–"
