"""Tables of replays for a terminal."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slosh_replay.replay.result import Judged, ModelAccuracy
from slosh_report.text_table import aligned


def accuracy_lines(results: Sequence[Judged]) -> list[str]:
    """MAE and ε by bag and model, and their means where there are several bags.

    Args:
        results: at least one; all with the same models.
    """
    names = [row.name for row in results[0].accuracy]
    clocks = any(row.clock is not None for result in results for row in result.accuracy)
    heads = ["", *(f"MAE {name}" for name in names), *(f"ε {name}" for name in names)]
    rows = [[*heads, "clock"] if clocks else heads]
    rows += [_cells(result.name, result.accuracy, clocks) for result in results]
    if len(results) > 1:
        by_model = list(zip(*(result.accuracy for result in results), strict=True))
        sigma = [_mean([row.sigma for row in model]) for model in by_model]
        size = [_mean([abs(row.epsilon) for row in model]) for model in by_model]
        mean = ["mean (of ε, its size)", *map(_mm, sigma), *(f"{100 * x:.1f}" for x in size)]
        rows.append([*mean, ""] if clocks else mean)
    units = "MAE in mm, ε in %" + (", offset of the measured clock in s" if clocks else "")
    return [*aligned(rows, "<>"), units]


def _cells(name: str, accuracy: Sequence[ModelAccuracy], clocks: bool) -> list[str]:
    sigma = [_mm(row.sigma) for row in accuracy]
    cells = [name, *sigma, *(f"{100 * row.epsilon:+.1f}" for row in accuracy)]
    if not clocks:
        return cells
    clock = accuracy[-1].clock
    if clock is None:
        return [*cells, ""]
    return [*cells, f"{clock.offset:.3f}" + ("" if clock.unambiguous else " (ambiguous)")]


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2f}"
