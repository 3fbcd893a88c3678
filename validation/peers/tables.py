"""Formats the results of all methods as Markdown tables with counts."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from statistics import mean, median

from validation.blind.tables import share, table
from validation.peers.chosen import NOISES
from validation.peers.library import EXPRESSIBLE
from validation.peers.rows import Row
from validation.peers.run import Answers
from validation.peers.sindy import METHODS
from validation.peers.tune import label

OURS = "discovery"
CAMERA = "camera, 0.1 … 1 mm"
LABELS = tuple(label(noise) for noise in NOISES)
CONFIDENCES = (0.5, 0.8, 0.95, 1.0 + 1e-9)


def overview(answers: Answers) -> str:
    """Formats the results by method and noise as a table."""
    lines = []
    for title, noise, rows in _columns(answers):
        single = [row for row in rows if row["kind"] == "single"]
        none = [row for row in rows if row["kind"] == "none"]
        lines.append(
            (
                title,
                noise,
                share(single, _exact),
                share(none, _exact),
                share(rows, lambda row: bool(row["false"])),
                f"{mean(len(row['false']) for row in rows):.2f}" if rows else "-",
                _median(single),
            )
        )
    head = (
        "method",
        "noise",
        "exact",
        "nothing hidden, nothing said",
        "cases with a wrong name",
        "wrong names per case",
        "gap closed, median",
    )
    return table(head, lines)


def by_effect(answers: Answers) -> str:
    """Formats the number of exact results by hidden effect and method as a table."""
    columns = _columns(answers)
    lines = []
    for effect in EXPRESSIBLE:
        own = [[row for row in rows if row["hidden"] == [effect]] for *_, rows in columns]
        lines.append((f"`{effect}`", *(_count(rows) for rows in own)))
    head = ("hidden", *(f"{title}, {noise}" for title, noise, _ in columns))
    return table(head, lines)


def reliability(answers: Answers) -> str:
    """Formats stated confidences against the rate of right effects as a table."""
    lines = []
    for title, noise, rows in _columns(answers):
        if title not in ("ensemble", OURS):
            continue
        said = [
            {"confidence": confidence, "right": name in row["hidden"]}
            for row in rows
            for name, confidence in row["confidence"].items()
        ]
        for low, high in pairwise(CONFIDENCES):
            own = [each for each in said if low <= each["confidence"] < high]
            if not own:
                continue
            average = f"{mean(each['confidence'] for each in own):.2f}"
            limits = f"{low:g} … {min(high, 1.0):g}"
            right = share(own, lambda each: bool(each["right"]))
            lines.append((title, noise, limits, average, right))
    return table(("method", "noise", "confidence", "mean", "right"), lines)


def networks(answers: Answers) -> str:
    """Formats the error shares that networks remove on held-out motions as a table."""
    lines = []
    for case, row in answers.networks.items():
        regression = answers.regressions.get(case)
        shares = [
            _percent(regression[LABELS[0]][method]["closed"] if regression else None)
            for method in METHODS
        ]
        shares = list(dict.fromkeys(shares))
        ours = answers.discovery.get(case)
        lines.append(
            (
                f"`{row['hidden'][0]}`",
                f"{1e3 * row['noise']:.2f} mm",
                _percent(row["fit_closed"]),
                _percent(row["closed"]),
                _percent(ours["closed"] if ours else None),
                ", ".join(shares),
            )
        )
    head = ("hidden", "noise of the heights", "network, its own motions", "network", OURS)
    return table((*head, f"regressions, {LABELS[0]}"), lines)


TABLES: dict[str, Callable[[Answers], str]] = {
    "overview": overview,
    "effects": by_effect,
    "reliability": reliability,
    "networks": networks,
}


def _columns(answers: Answers) -> list[tuple[str, str, list[Row]]]:
    """Returns method, noise and results for each column of the tables."""
    found: list[tuple[str, str, list[Row]]] = [
        (
            method,
            noise,
            [
                {"kind": row["kind"], "hidden": row["hidden"], **row[noise][method]}
                for row in answers.regressions.values()
            ],
        )
        for noise in LABELS
        for method in METHODS
    ]
    return [*found, (OURS, CAMERA, [_ours(row) for row in answers.discovery.values()])]


def _ours(row: Row) -> Row:
    """Converts a result of the discovery to the form of the other methods' results."""
    confidence = {each["name"]: each["confidence"] for each in row["found"]}
    wrong = sorted(set(confidence) - set(row["hidden"]))
    return {**row, "exact": row["right"], "false": wrong, "confidence": confidence}


def _exact(row: Row) -> bool:
    return bool(row["exact"])


def _count(rows: Sequence[Row]) -> str:
    return f"{sum(map(_exact, rows))}/{len(rows)}"


def _median(rows: Iterable[Row]) -> str:
    shares = [row["closed"] for row in rows if row["closed"] is not None]
    return _percent(median(shares) if shares else None)


def _percent(value: float | None) -> str:
    """Formats a share in percent; negative shares become '< 0', unknown ones '-'."""
    if value is None:
        return "-"
    return f"{100.0 * value:.0f} %" if value >= 0.0 else "< 0"
