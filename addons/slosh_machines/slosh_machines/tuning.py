"""Tuning numbers of motion maps."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class MapTuning:
    """Tuning constants of the search for strokes; `validation/studies/motion_map_gain.py`."""

    segments: int = number(8, "1", "segments of a stroke's law")
    rows: int = number(400, "1", "samples of a stroke")
    constants: float = number(3.0, "1", "time constants of the damping that are simulated")
    fewest: float = number(3.0, "1", "fewest cycles that are simulated")
    most: float = number(60.0, "1", "most cycles that are simulated")
    rounds: int = number(4, "1", "linear programs of one speed")
    change: float = number(1e-3, "1", "weight of the change from the next lower speed")
    slack: float = number(0.01, "1", "part of acceleration and jerk that a design leaves")
    halvings: int = number(3, "1", "how often an interval of two speeds is divided")


TUNING = MapTuning()
