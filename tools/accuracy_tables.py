"""Measures the accuracy tables of the documentation again and writes them to its pages.

    tools/run python tools/accuracy_tables.py [cell] [measured]

`cell` runs the simulated cell with every motion, live over DDS (some minutes), and fills
docs/results/accuracy.md. `measured` replays the public measurements and the CFD motions from
SLOSH_SHARED_DATA or ../shared/data, and fills docs/results/measurements.md.
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from result_tables import fill

from slosh_bringup.cell.motions import MOTIONS
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.tables.motion_table import read_motion_table
from slosh_replay.replay import replay_bag, replay_table
from slosh_replay.replay.result import Judged, ModelAccuracy
from slosh_replay.tables.antisloshing import import_antisloshing

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "results" / "accuracy.md"
HEAD = (
    "| motion | camera / truth MAE | ε | 3D-NL / truth MAE | ε | 3D-NL / camera MAE | ε | "
    "3D-L / camera MAE | ε | images | lost |\n|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|--:|\n"
)
PAIRS = ("camera / truth", "3D-NL / truth", "3D-NL / camera", "3D-L / camera")


def main() -> int:
    """Measures and writes the tables named on the command line, by default all."""
    wanted = sys.argv[1:] or ["cell", "measured"]
    if "cell" in wanted:
        cell_table()
    if "measured" in wanted:
        measured_tables()
    return 0


def cell_table() -> None:
    """Runs every motion of the simulated cell and writes the table of accuracies."""
    names = [name for name in MOTIONS if "-" in name]
    rows = [cell_row(name, run_cell(name)) for name in names]
    fill(PAGE, "cell", HEAD + "".join(rows))


def run_cell(name: str) -> dict[str, Any]:
    """Runs one motion of the simulated cell live and returns the results as a dictionary."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "slosh_bringup.cli", "demo", "--motion", name]
        done = subprocess.run(
            [*command, "--json", "-o", folder], capture_output=True, text=True, check=True
        )
    figures: dict[str, Any] = json.loads(done.stdout)
    print(name, flush=True)
    return figures


def cell_row(name: str, figures: dict[str, Any]) -> str:
    """Formats one motion's results as a Markdown table row, with MAE in mm and ε in %."""
    by_name = {row["name"]: row for row in figures["agreements"]}
    cells = []
    for pair in PAIRS:
        row = by_name[pair]
        cells += [f"{1e3 * row['sigma']:.2f}", f"{1e2 * row['epsilon']:+.1f}"]
    lost = sum(figures["lost"].values())
    count = by_name["camera / truth"]["count"]
    return f"| {name} | " + " | ".join(cells) + f" | {count} | {lost} |\n"


def measured_tables() -> None:
    """Replays public measurements and CFD results and writes the accuracy tables."""
    data = Path(os.environ.get("SLOSH_SHARED_DATA", ROOT.parent / "shared" / "data"))
    page = ROOT / "docs" / "results" / "measurements.md"
    with tempfile.TemporaryDirectory() as folder:
        bags = import_antisloshing(data / "antisloshing", Path(folder))
        results = [replay_bag(bag) for bag in bags]
    upright = [result for result in results if not result.name.startswith("Tilt")]
    fill(page, "antisloshing", accuracy_table(upright))
    fill(page, "tilted", accuracy_table([one for one in results if one not in upright]))
    cup = Model(Cylinder(0.05, 0.07))
    tables = [(name, read_motion_table(data / "cfd" / f"{name}.csv.gz")) for name in ("l1", "e1")]
    fill(page, "cfd", accuracy_table([replay_table(*table, cup) for table in tables]))


def accuracy_table(results: Sequence[Judged]) -> str:
    """Formats accuracy and clock offset by run and model as a Markdown table.

    Args:
        results: runs with the same models.
    """
    if not results:
        return ""
    names = [row.name for row in results[0].accuracy]
    heads = ["run", *(f"MAE {name}" for name in names), *(f"ε {name}" for name in names)]
    lines = [
        "| " + " | ".join([*heads, "clock offset"]) + " |",
        "|---" + "|--:" * (2 * len(names) + 1) + "|",
    ]
    lines += [_line(result.name, result.accuracy) for result in results]
    rows = list(zip(*(result.accuracy for result in results), strict=True))
    sigma = [_mm(_mean([entry.sigma for entry in row])) for row in rows]
    epsilon = [_percent(_mean([entry.epsilon for entry in row])) for row in rows]
    size = [f"{100 * _mean([abs(entry.epsilon) for entry in row]):.1f}" for row in rows]
    blank = [""] * len(names)
    lines.append("| " + " | ".join(["**mean**", *sigma, *epsilon, ""]) + " |")
    lines.append("| " + " | ".join(["**mean size**", *blank, *size, ""]) + " |")
    return "\n".join([*lines, "", "MAE in mm, ε in %, clock offset in s.", ""])


def _line(name: str, rows: Sequence[ModelAccuracy]) -> str:
    last = rows[-1].clock
    offset = "–"
    if last is not None:
        offset = f"{last.offset:.3f}" + ("" if last.unambiguous else " (ambiguous)")
    cells = [name, *(_mm(row.sigma) for row in rows), *(_percent(row.epsilon) for row in rows)]
    return "| " + " | ".join([*cells, offset]) + " |"


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if math.isfinite(value)]
    return sum(known) / len(known) if known else math.nan


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.2f}"


def _percent(fraction: float) -> str:
    return f"{100.0 * fraction:+.1f}"


if __name__ == "__main__":
    sys.exit(main())
