"""Judges recordings by acceptance criteria, with regard to the measurement's uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from slosh_fleet.validation.content import Criterion, Recording, Repeatability, Verdict
from slosh_fleet.validation.document import HEIGHT

NAN: Final = math.nan
COVERAGE: Final = 2.0
"""Coverage factor k of expanded uncertainties: about 95 % for normally distributed errors."""


@dataclass(frozen=True, slots=True)
class Acceptance:
    """Greatest accepted values of a validation report; a quantity with None is not judged.

    Attributes:
        height: of the measured height [m]; None: the limit in force while recording.
        error: of the nonlinear model's mean absolute error [m].
        epsilon: of its |ε|, the relative error of the greatest height [1].
        spread: of the greatest height of a motion over several recordings [m].
    """

    height: float | None = None
    error: float | None = None
    epsilon: float | None = None
    spread: float | None = None


@dataclass(frozen=True, slots=True)
class Evidence:
    """Results of a recording, and why they may not be conclusive, such as lost messages.

    Attributes:
        recording: its data and results.
        limit: of the measured height that was in force [m]; NaN: none.
        noise: mean standard deviation of the measured heights [m]; NaN: unknown.
        doubt: why the recording cannot show that a height was kept; empty: it can.
    """

    recording: Recording
    limit: float
    noise: float
    doubt: str


def judge(value: float, uncertainty: float, limit: float) -> Verdict:
    """Judges whether a value, with its uncertainty, is at most the greatest accepted value.

    It passes if the whole interval value ± uncertainty is accepted, fails if nothing of it is,
    and is undecided otherwise, and wherever one of the numbers is unknown (NaN).
    """
    if value + uncertainty <= limit:
        return Verdict.PASS
    if value - uncertainty > limit:
        return Verdict.FAIL
    return Verdict.UNDECIDED


def criteria_of(
    evidence: Sequence[Evidence], repeats: Sequence[Repeatability], acceptance: Acceptance
) -> tuple[Criterion, ...]:
    """Judges recordings by all criteria that apply; returns them in the report's order.

    Args:
        evidence: the recordings.
        repeats: spread of each motion over them.
        acceptance: greatest accepted values.
    """
    found = [_height(one, acceptance) for one in evidence]
    if acceptance.error is not None:
        found += [_error(one, acceptance.error) for one in evidence]
    if acceptance.epsilon is not None:
        found += [_epsilon(one, acceptance.epsilon) for one in evidence]
    found += [criterion for one in evidence for criterion in _data(one.recording)]
    if acceptance.spread is not None:
        found += _spread(repeats, acceptance.spread)
    return tuple(found)


def _height(one: Evidence, acceptance: Acceptance) -> Criterion:
    peak = one.recording.peak
    limit = one.limit if acceptance.height is None else acceptance.height
    verdict = judge(peak.height, peak.uncertainty, limit)
    reason = ""
    if math.isnan(limit):
        reason = "no limit was in force, and --limit gives none"
    elif math.isnan(peak.height):
        reason = one.doubt or "nothing was measured"
    elif math.isnan(peak.uncertainty):
        reason = "the uncertainty is unknown; --uncertainty gives it"
    elif verdict is not Verdict.FAIL and (peak.is_bound or one.doubt):
        verdict = Verdict.UNDECIDED
        reason = one.doubt or "the liquid left the view: the height is a lower bound"
    elif verdict is Verdict.UNDECIDED:
        reason = "the uncertainty spans the limit"
    name = one.recording.name
    return Criterion(HEIGHT, name, peak.height, peak.uncertainty, limit, "mm", verdict, reason)


def _error(one: Evidence, limit: float) -> Criterion:
    """Judges the mean absolute error of the nonlinear model.

    Errors of neighbouring images are alike, so the mean is no more certain than one image.
    """
    recording = one.recording
    row = recording.models[-1] if recording.models else None
    value = NAN if row is None else row.sigma
    uncertainty = COVERAGE * one.noise
    verdict = judge(value, uncertainty, limit)
    name = "mean absolute error" if row is None else f"mean absolute error of {row.name}"
    reason = _unknown(value, uncertainty, verdict)
    return Criterion(name, recording.name, value, uncertainty, limit, "mm", verdict, reason)


def _epsilon(one: Evidence, limit: float) -> Criterion:
    """Judges the relative error |ε| = |estimated − measured| / measured of the greatest height."""
    recording, peak = one.recording, one.recording.peak
    row = recording.models[-1] if recording.models else None
    value = NAN if row is None else abs(row.epsilon)
    estimated = NAN if row is None else 1.0 + row.epsilon
    uncertainty = estimated * peak.uncertainty / peak.height if peak.height > 0.0 else NAN
    verdict = judge(value, uncertainty, limit)
    name = "|ε|" if row is None else f"|ε| of {row.name}"
    reason = _unknown(value, uncertainty, verdict)
    return Criterion(name, recording.name, value, uncertainty, limit, "%", verdict, reason)


def _unknown(value: float, uncertainty: float, verdict: Verdict) -> str:
    if math.isnan(value):
        return "nothing could be compared"
    if math.isnan(uncertainty):
        return "the uncertainty is unknown; --uncertainty gives it"
    return "the uncertainty spans the limit" if verdict is Verdict.UNDECIDED else ""


def _data(one: Recording) -> tuple[Criterion, Criterion]:
    """Judges whether no message was lost and whether the replay reproduced the estimates."""
    missing = float(one.lost + one.dropped)
    complete = Criterion(
        "messages lost or dropped", one.name, missing, 0.0, 0.0, "", judge(missing, 0.0, 0.0)
    )
    different = float(one.estimates - one.reproduced) if one.estimates else NAN
    reason = "" if one.estimates else "no estimates of this model were recorded"
    again = Criterion(
        "recorded estimates not reproduced", one.name, different, 0.0, 0.0, "",
        judge(different, 0.0, 0.0), reason,
    )  # fmt: skip
    return complete, again


def _spread(repeats: Sequence[Repeatability], limit: float) -> list[Criterion]:
    name = "spread of the highest height"
    if not repeats:
        reason = "needs two recordings or more with the same measured motions"
        return [Criterion(name, "", NAN, NAN, limit, "mm", Verdict.UNDECIDED, reason)]
    found = []
    for one in repeats:
        verdict = judge(one.spread, one.uncertainty, limit)
        reason = _unknown(one.spread, one.uncertainty, verdict)
        title = f"{name}, motion {one.motion}"
        numbers = (one.spread, one.uncertainty, limit)
        found.append(Criterion(title, "", *numbers, "mm", verdict, reason))
    return found
