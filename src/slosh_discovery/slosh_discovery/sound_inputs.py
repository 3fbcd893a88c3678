"""Excludes motions with faulty inputs before a discovery or identification."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.errors import SloshDiscoveryError
from slosh_motion.checks.input_faults import find_input_faults

Motions = tuple[MeasuredMotion, ...]


def sound(motions: Sequence[MeasuredMotion]) -> tuple[Motions, tuple[str, ...]]:
    """Returns the motions with valid inputs, and one sentence for each excluded motion."""
    kept, told = [], []
    for motion in motions:
        faults = find_input_faults(motion.inputs.t, motion.inputs.acceleration)
        if not faults:
            kept.append(motion)
        told += [f"{motion.name} is left out: {fault.text()}." for fault in faults[:1]]
    return tuple(kept), tuple(told)


def sound_fit(motions: Sequence[MeasuredMotion]) -> tuple[Motions, tuple[str, ...]]:
    """Returns the valid motions of a fit, and one sentence for each excluded motion.

    Raises:
        SloshDiscoveryError: all of them have faulty inputs; the text tells the first one's.
    """
    kept, told = sound(motions)
    if motions and not kept:
        count = f" (and {len(told) - 1} more like this)" if len(told) > 1 else ""
        raise SloshDiscoveryError(f"no motion with a sound input: {told[0]}{count}")
    return kept, told
