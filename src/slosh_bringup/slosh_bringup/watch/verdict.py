"""Summarises in one word and one sentence whether a cell is safe."""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

SILENCE = 1.0
"""After so long without a comparison nobody sees the liquid [s]."""
OK, WARN, ERROR, STALE, BLIND = range(5)
"""States of slosh_msgs/SloshComparison."""


class CellVerdict(Enum):
    """Safety state of a cell, one word shown in large letters."""

    SAFE = "safe"
    NEAR = "near limit"
    DISAGREE = "sides disagree"
    EXCEEDED = "limit exceeded"
    BLIND = "blind"


class CellJudgement(NamedTuple):
    """Safety state of a cell, with the reason for it."""

    verdict: CellVerdict
    reason: str


def judge(
    state: int | None,
    age: float,
    stale: tuple[str, ...] = (),
    exceeded: str = "",
    *,
    alone: bool = False,
    disagree: bool = False,
) -> CellJudgement:
    """Determines from its newest messages whether a cell is safe.

    Silence is never safe: what is not compared is not known.

    Args:
        state: of the newest comparison; None: there was none yet.
        age: how long ago it came [s].
        stale: which sides are silent.
        exceeded: what exceeds its limit; empty: nothing does.
        alone: there is no camera by choice.
        disagree: camera and model disagree.
    """
    if state is None:
        return CellJudgement(
            CellVerdict.BLIND, "no comparison received yet: is the monitor running?"
        )
    if age > SILENCE:
        return CellJudgement(CellVerdict.BLIND, f"no message from the monitor for {age:.0f} s")
    if state == ERROR or exceeded:
        return CellJudgement(CellVerdict.EXCEEDED, exceeded or "a limit is exceeded")
    if state == STALE:
        return CellJudgement(
            CellVerdict.BLIND, f"no messages from {' and '.join(stale) or 'one side'}"
        )
    if state == BLIND:
        what = "the estimate" if alone else "measurement and estimate"
        return CellJudgement(
            CellVerdict.BLIND, f"{what} cannot be {'trusted' if alone else 'compared'}"
        )
    if state == WARN and disagree:
        return CellJudgement(
            CellVerdict.DISAGREE, "camera and model disagree: see the monitor's message"
        )
    if state == WARN:
        return CellJudgement(CellVerdict.NEAR, "a limit is near, or was exceeded a moment ago")
    if state == OK and alone:
        return CellJudgement(CellVerdict.SAFE, "estimated below its limit; no camera configured")
    if state == OK:
        return CellJudgement(CellVerdict.SAFE, "measured and estimated below their limits")
    return CellJudgement(CellVerdict.BLIND, f"unknown state {state} of the monitor")
