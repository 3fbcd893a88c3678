"""Scores the result that a discovery gives for a synthetic test case.

    row = score_case(case, discover(case.motions, case.base, case.holdout))
    row["right"]

A row is plain values, so that it can be kept as a line of JSON and judged again later.
"""

from __future__ import annotations

import math
import time
import traceback
from collections.abc import Callable
from typing import Any

from slosh_discovery.discover.finding import Finding
from validation.blind.cases import NAMED_AS, VISIBLE, Case, make_case
from validation.blind.dirt import Dirt
from validation.blind.hidden import NEAREST

Row = dict[str, Any]
BIAS = "static_tilt"
"""What the bias of an accelerometer is."""
Discover = Callable[..., Finding]

CERTAIN = 0.9
"""A wrong name with more confidence than this misleads."""
LARGEST_SET = 2
"""An ambiguous answer says something while its set is no larger."""


def run_case(
    discover: Discover,
    kind: str,
    index: int,
    seed: int,
    effect: str | None = None,
    dirt: Dirt | None = None,
) -> Row:
    """Makes a test case, runs the discovery and scores its result; an exception is wrong."""
    case = make_case(kind, index, seed, effect, dirt)
    start, busy = time.perf_counter(), time.process_time()
    try:
        finding = discover(case.motions, case.base, case.holdout, threads=1)
    except Exception as error:  # every failure of what is tested is a result
        row = failed(case, f"{type(error).__name__}: {error}")
        row["trace"] = traceback.format_exc(limit=-3)
    else:
        row = score_case(case, finding)
    row["seconds"] = round(time.perf_counter() - start, 2)
    row["cpu_seconds"] = round(time.process_time() - busy, 2)
    return row


def score_case(case: Case, finding: Finding) -> Row:
    """Returns case, result and score of a discovery as a dictionary of plain values."""
    found = [
        {
            "name": effect.name,
            "confidence": float(effect.confidence),
            "alternatives": list(effect.alternatives),
            "refitted": bool(effect.refitted),
            "parameters": {key: float(value) for key, value in effect.parameters.items()},
        }
        for effect in finding.effects
    ]
    gap = finding.gap
    values = {
        name: _finite(getattr(gap, name))
        for name in ("noise", "fit_before", "fit_after", "holdout_before", "holdout_after")
    }
    row = _question(case) | {
        "verdict": finding.verdict.value,
        "found": found,
        "confidence": _finite(finding.confidence),
        "closed": _finite(gap.closed),
        "gap": values,
        "error": "",
    }
    return judge(row)


def failed(case: Case, error: str) -> Row:
    """Returns the score of a discovery that raised an error."""
    answer: Row = {"verdict": "error", "found": [], "confidence": None, "closed": None, "gap": {}}
    return judge(_question(case) | answer | {"error": error})


def _question(case: Case) -> Row:
    return {
        "case": case.name,
        "kind": case.kind,
        "base": case.base_name,
        "noise": case.noise,
        "sensor": case.sensor,
        "motions": len(case.motions),
        "hidden": list(case.hidden),
        "parameters": {name: dict(values) for name, values in case.parameters.items()},
        "strength": dict(case.strength),
        "counts": case.counts,
        "equivalent": [sorted(group) for group in case.equivalent],
        "wrong": list(case.wrong) if case.wrong else None,
        "bias": case.bias,
    }


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def judge(row: Row) -> Row:
    """Adds to a scored result whether the found effects are right, and which.

    - right: what the issue of the case's kind asks for.
    - first: the first name is one of the hidden.
    - in_set: the answer is a right ambiguous set.
    - names: each name with its confidence and whether it is right.
    - misled: a wrong name with a confidence above 0.9.
    """
    said, row = row, without_bias(row)
    expected = wanted(row)
    names = [
        {
            "name": effect["name"],
            "confidence": effect["confidence"],
            "right": effect["name"] in expected,
        }
        for effect in row["found"]
    ]
    return said | {
        "right": RULES[row["kind"]](row),
        "first": bool(row["found"]) and row["found"][0]["name"] in row["hidden"],
        "in_set": _ambiguous_set(row, expected),
        "names": names,
        "misled": any(not name["right"] and name["confidence"] > CERTAIN for name in names),
    }


def without_bias(row: Row) -> Row:
    """Removes a found tilt that only reflects the accelerometer's bias, not a hidden effect."""
    if not row.get("bias") or BIAS in row["hidden"]:
        return row
    found = [effect for effect in row["found"] if BIAS not in options(effect)]
    verdict = row["verdict"]
    if row["found"] and not found:
        verdict = "none"
    return row | {"found": found, "verdict": verdict}


def wanted(row: Row) -> set[str]:
    """Returns the names of all effects that would be right answers."""
    also = [NAMED_AS[row["wrong"][0]]] if row["wrong"] else []
    return {*row["hidden"], *also} if row["kind"] != "outside" else set()


def options(effect: Row) -> set[str]:
    """Returns the name of a found effect, and of the alternatives that it lists."""
    return {effect["name"], *effect["alternatives"]}


def _ambiguous_set(row: Row, expected: set[str]) -> bool:
    """Whether the result is a small ambiguous set that contains a right effect."""
    if row["verdict"] != "ambiguous" or len(row["found"]) != 1:
        return False
    said = options(row["found"][0])
    return len(said) <= LARGEST_SET and bool(said & expected)


def _single(row: Row) -> bool:
    """Whether exactly the hidden effect was found, or a right ambiguous set of two."""
    expected = set(row["hidden"])
    if _ambiguous_set(row, expected):
        return True
    names = {effect["name"] for effect in row["found"]}
    if row["verdict"] != "named" or names != expected:
        return False
    effect = row["found"][0]
    return not row["equivalent"] or effect["confidence"] <= CERTAIN or bool(effect["alternatives"])


def _pairs(row: Row) -> bool:
    """Whether both hidden effects were found and nothing else, also as an ambiguous set."""
    return _covers(row, set(row["hidden"]))


def _covers(row: Row, expected: set[str]) -> bool:
    """Whether each expected effect was found once, and no other effect was found."""
    found = [options(effect) for effect in row["found"]]
    if row["verdict"] not in ("named", "ambiguous") or len(found) != len(expected):
        return False
    if any(len(said) > LARGEST_SET for said in found):
        return False
    return _matched(found, sorted(expected))


def _matched(found: list[set[str]], expected: list[str]) -> bool:
    if not expected:
        return True
    return any(
        expected[0] in said and _matched(found[:i] + found[i + 1 :], expected[1:])
        for i, said in enumerate(found)
    )


def _none(row: Row) -> bool:
    return bool(row["verdict"] == "none")


def _outside(row: Row) -> bool:
    """Whether the result is `unexplained`, or the physically nearest effect, uncertain."""
    if row["verdict"] == "unexplained":
        return True
    said = set[str]().union(*(options(effect) for effect in row["found"]))
    certain = any(effect["confidence"] >= CERTAIN for effect in row["found"])
    return not certain and bool(said & NEAREST[row["hidden"][0]])


def _wrong_parameter(row: Row) -> bool:
    """Whether the missing effect and a visibly wrong parameter were found, nothing else."""
    also = NAMED_AS[row["wrong"][0]]
    both = _covers(row, {*row["hidden"], also})
    if row["strength"][row["wrong"][0]] > VISIBLE:
        return both
    return both or _single(row)


RULES: dict[str, Callable[[Row], bool]] = {
    "single": _single,
    "pairs": _pairs,
    "none": _none,
    "outside": _outside,
    "wrong_parameter": _wrong_parameter,
}
