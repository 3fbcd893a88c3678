"""Formats scored discoveries as Markdown tables with counts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise, starmap
from statistics import median

from validation.blind.hidden import LISTED, OUTSIDE
from validation.blind.score import CERTAIN, Row

Judge = Callable[[Row], bool]

NOISES = ((0.0, 0.2), (0.2, 0.4), (0.4, 0.7), (0.7, 1.01))  # mm
BASES = ("2D-L", "3D-L", "2D-NL", "3D-NL")
SENSORS = ("msh", "12 azimuths", "36 azimuths")
CONFIDENCES = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9)
GOALS = {
    "single": "≥ 95 %",
    "pairs": "≥ 85 %",
    "none": "≥ 98 %",
    "outside": "≥ 90 %",
    "wrong_parameter": "-",
    "closed": "≥ 90 %",
}
TITLES = {
    "single": "one missing effect: right name, or a right set of two",
    "pairs": "two missing effects: both right, nothing else",
    "none": "nothing missing: verdict `none`",
    "outside": "not in the list: `unexplained`, or the nearest name without certainty",
    "wrong_parameter": "a wrong parameter and a missing effect: both found",
}


def share(rows: Iterable[Row], judge: Judge) -> str:
    """Formats the share of rows that meet a condition, such as '95 % (38/40)'; '-' if empty."""
    values = [bool(judge(row)) for row in rows]
    if not values:
        return "-"
    return f"{100.0 * sum(values) / len(values):.0f} % ({sum(values)}/{len(values)})"


def tally(rows: Iterable[Row], judge: Judge) -> str:
    """Formats the number of rows that meet a condition, such as '38/40'; '-' if empty."""
    values = [bool(judge(row)) for row in rows]
    return f"{sum(values)}/{len(values)}" if values else "-"


def right(row: Row) -> bool:
    """Whether a discovery's result is right."""
    return bool(row["right"])


def counted(rows: Sequence[Row], kind: str) -> list[Row]:
    """Returns the rows of one kind of case whose effects exceed three noise deviations."""
    return [row for row in rows if row["kind"] == kind and row["counts"]]


def closed(rows: Iterable[Row]) -> float | None:
    """Returns the median share of the removable error that is removed on held-out motions."""
    values = [row["closed"] for row in rows if row["closed"] is not None]
    return median(values) if values else None


def closed_text(rows: Iterable[Row]) -> str:
    """Formats the median share of the error that is removed; '-' if unknown."""
    value = closed(rows)
    return "-" if value is None else f"{100.0 * value:.0f} %"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Formats a Markdown table with one column of text and right-aligned numbers."""
    lines = ["| " + " | ".join(head) + " |", "|---|" + "--:|" * (len(head) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)]) + "\n"


def overview(rows: Sequence[Row]) -> str:
    """Formats the results for each claim about the discovery as a table."""
    lines = [
        (title, GOALS[kind], share(counted(rows, kind), right)) for kind, title in TITLES.items()
    ]
    single = counted(rows, "single")
    lines.append(
        (
            "one missing effect: median share of the removable gap closed on held-out motions",
            GOALS["closed"],
            closed_text(single),
        )
    )
    weak = [row for row in rows if row["kind"] == "single" and not row["counts"]]
    lines += [
        ("one missing effect: first name right", "-", share(single, lambda row: row["first"])),
        (
            "one missing effect: answered by a right set",
            "-",
            share(single, lambda row: row["in_set"]),
        ),
        ("weaker than 3 noises: right name or set", "-", share(weak, right)),
        (
            "weaker than 3 noises: verdict `none`",
            "-",
            share(weak, lambda row: row["verdict"] == "none"),
        ),
        (
            f"any case: a wrong name with confidence above {CERTAIN}",
            "-",
            share(rows, lambda row: row["misled"]),
        ),
        ("any case: no answer", "-", share(rows, lambda row: bool(row["error"]))),
    ]
    return table(("case", "goal", "score"), [line for line in lines if line[2] != "-"])


def by_effect(rows: Sequence[Row]) -> str:
    """Formats the results by hidden effect of the list as a table."""
    single = counted(rows, "single")
    lines = []
    for name in LISTED:
        own = [row for row in single if row["hidden"] == [name]]
        pairs = [row for row in counted(rows, "pairs") if name in row["hidden"]]
        if own or pairs:
            lines.append((f"`{name}`", tally(own, right), closed_text(own), tally(pairs, right)))
    return table(("effect", "right", "gap closed", "pairs with it"), lines)


def by_outside(rows: Sequence[Row]) -> str:
    """Formats the results by hidden effect outside the list as a table."""
    lines = []
    for name in OUTSIDE:
        own = [row for row in counted(rows, "outside") if row["hidden"] == [name]]
        verdicts = {
            verdict: sum(row["verdict"] == verdict for row in own)
            for verdict in sorted({row["verdict"] for row in own})
        }
        said = ", ".join(f"{verdict} {count}" for verdict, count in verdicts.items())
        names = sorted({effect["name"] for row in own for effect in row["found"]})
        lines.append(
            (
                f"`{name}`",
                tally(own, right),
                said or "-",
                ", ".join(names) or "-",
                tally(own, lambda row: row["misled"]),
            )
        )
    return table(("hidden", "right", "verdicts", "named effects", "misled"), lines)


def by_group(rows: Sequence[Row], title: str, groups: Sequence[tuple[str, Judge]]) -> str:
    """Formats the results by group of cases, with one column for each kind of case."""
    kinds = tuple(TITLES)
    lines = []
    for name, belongs in groups:
        own = [row for row in rows if belongs(row)]
        lines.append(
            (
                name,
                *(tally(counted(own, kind), right) for kind in kinds),
                closed_text(counted(own, "single")),
            )
        )
    return table((title, *(kind.replace("_", " ") for kind in kinds), "gap closed"), lines)


def by_noise(rows: Sequence[Row]) -> str:
    """Formats the results by range of the height noise as a table."""

    def within(low: float, high: float) -> Judge:
        return lambda row: low <= 1e3 * row["noise"] < high

    names = [f"{low:g} … {min(high, 1.0):g} mm" for low, high in NOISES]
    return by_group(rows, "noise", list(zip(names, starmap(within, NOISES), strict=True)))


def by_base(rows: Sequence[Row]) -> str:
    """Formats the results by base model as a table."""
    return by_group(rows, "base", [(name, has("base", name)) for name in BASES])


def by_sensor(rows: Sequence[Row]) -> str:
    """Formats the results by kind of height measurement as a table."""
    return by_group(rows, "measured", [(name, has("sensor", name)) for name in SENSORS])


def has(field: str, value: str) -> Judge:
    """Returns a function that tests whether a row's field has a value."""
    return lambda row: bool(row[field] == value)


def reliability(rows: Sequence[Row]) -> str:
    """Formats stated confidences against the rate of right effects as a table."""
    inside = [name for row in rows if row["kind"] != "outside" for name in row["names"]]
    outside = [name for row in rows if row["kind"] == "outside" for name in row["names"]]
    lines = []
    for low, high in pairwise(CONFIDENCES):
        own = [name for name in inside if low <= name["confidence"] < high]
        others = [name for name in outside if low <= name["confidence"] < high]
        mean = sum(name["confidence"] for name in own) / len(own) if own else None
        lines.append(
            (
                f"{low:g} … {min(high, 1.0):g}",
                "-" if mean is None else f"{mean:.2f}",
                tally(own, right),
                str(len(others)),
            )
        )
    head = ("confidence", "mean", "right", "names given outside the list")
    return table(head, lines)


TABLES: dict[str, Callable[[Sequence[Row]], str]] = {
    "overview": overview,
    "effects": by_effect,
    "outside": by_outside,
    "noise": by_noise,
    "base": by_base,
    "sensor": by_sensor,
    "reliability": reliability,
}
