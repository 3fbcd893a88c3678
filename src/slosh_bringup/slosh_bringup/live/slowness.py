"""Whether the machine was too slow for the simulated cell: what came late, and what was lost."""

from __future__ import annotations

from collections.abc import Mapping

from slosh_bringup.live.run_data import RunData, facts_of
from slosh_msgs_py import topics

SAMPLES = 0.01
"""Above this share of late or lost samples the estimate is not what it could be."""
IMAGES = 0.3
"""Above this share of unmeasured images the comparison has holes."""
LATE = 0.25
"""A robot is never that late with its own samples [s]."""


def slowness(data: RunData) -> str:
    """What tells of a machine that is too slow, with figures; empty: nothing does.

    On a robot nobody counts what was sent: the answer is empty.
    """
    cell, estimator, camera = (facts_of(data, node) for node in ("cell", "estimator", "camera"))
    sent, taken = _count(cell, topics.ACCEL), _count(cell, topics.IMAGE)
    if not sent:
        return ""
    used = _count(estimator, "output total")
    measured = _count(camera, "measurement total")
    left_out = _count(cell, "images left out")
    late = _count(cell, "late maximum [ms]") * 1e-3
    lost = sum(data.lost().values())
    found = []
    if sent - used > SAMPLES * sent:
        found.append(f"{sent - used} of {sent} samples were late or lost")
    if taken - measured > IMAGES * taken:
        found.append(f"{taken - measured} of {taken} images were not measured")
    if left_out:
        found.append(f"{left_out} images were not sent")
    if late > LATE:
        found.append(f"samples were sent up to {late:.1f} s late")
    if lost > 0:
        found.append(f"{lost} messages were not recorded")
    return f"this machine is too slow for the demonstration: {', '.join(found)}" if found else ""


def _count(facts: Mapping[str, str], key: str) -> int:
    return int(facts.get(key, 0))
