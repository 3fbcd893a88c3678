"""Joins each estimate with the model's prediction of what the sensor will measure.

A model with effects on the measurement answers twice: with the liquid's heights, by which limits
are watched, and with what the camera should read of them, by which the two are compared. They come
on two topics, in no order that can be relied upon.
"""

from __future__ import annotations

from collections import deque
from functools import lru_cache
from typing import NamedTuple

from slosh_estimator.comparison import EstimatePoint
from slosh_model.effects.registry import EFFECTS

NAN = float("nan")
PATIENCE = 100
"""So many estimates wait for their readings; a reading that is missing then was lost."""


class Reading(NamedTuple):
    """Predicted sensor measurement: stamp [ns], linear and nonlinear height [m], delay [ns]."""

    stamp_ns: int
    linear: float
    nonlinear: float
    delay_ns: int = 0


@lru_cache(maxsize=64)
def has_readings(model_name: str) -> bool:
    """Returns whether a model with this name predicts what the sensor measures."""
    named = [EFFECTS[name] for name in model_name.split("+")[1:] if name in EFFECTS]
    return any(effect.reading is not None or effect.delay is not None for effect in named)


class ReadingJoiner:
    """Joins estimates with predicted sensor measurements; returns complete pairs in order.

    Attributes:
        lost: estimates whose readings did not come: nothing can be compared with them.
    """

    def __init__(self) -> None:
        self.lost = 0
        self._waiting: deque[tuple[EstimatePoint, bool]] = deque()
        self._readings: deque[Reading] = deque(maxlen=PATIENCE)

    def add_estimate(self, point: EstimatePoint, model_name: str) -> list[EstimatePoint]:
        """Adds an estimate; returns estimates whose predicted measurement has come, in order."""
        awaits = has_readings(model_name)
        if not awaits and not self._waiting:
            return [point]
        self._waiting.append((point, awaits))
        return self._complete()

    def add_reading(self, reading: Reading) -> list[EstimatePoint]:
        """Adds a predicted measurement; returns the estimates whose prediction has arrived."""
        self._readings.append(reading)
        return self._complete()

    def _complete(self) -> list[EstimatePoint]:
        found = []
        while self._waiting:
            point, awaits = self._waiting[0]
            if awaits:
                read = self._read(point)
                if read is None:
                    break
                point = read
            found.append(point)
            self._waiting.popleft()
        return found

    def _read(self, point: EstimatePoint) -> EstimatePoint | None:
        """Joins an estimate with its predicted measurement; None if that may still arrive."""
        readings = self._readings
        for reading in readings:
            if reading.stamp_ns == point.stamp_ns:
                while readings.popleft() is not reading:
                    pass
                both = (reading.linear, reading.nonlinear)
                return point._replace(reading=both, delay_ns=reading.delay_ns)
        overtaken = bool(readings) and readings[-1].stamp_ns > point.stamp_ns
        if not overtaken and len(self._waiting) <= PATIENCE:
            return None
        self.lost += 1
        return point._replace(reading=(NAN, NAN))
