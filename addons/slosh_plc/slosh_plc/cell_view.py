"""Collects a cell's ROS messages and creates the cell state for controllers outside ROS.

Time is an argument: steady time [s], and the age of a message by its stamp and the cell's clock
[s], since a message that comes now may tell of another hour. Messages are those of slosh_msgs, or
objects with the same fields. One thread may add messages while another asks for the state.
"""

from __future__ import annotations

import math
import threading
from collections import Counter
from collections.abc import Mapping
from typing import Any

from slosh_estimator.comparison import Condition
from slosh_estimator.limits import Kind as EventKind
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.observer.calm import CalmReason
from slosh_plc.cell_state import SIGNALS, CellState, Quality, Reading
from slosh_plc.tuning import TUNING

_BLIND = (Condition.STALE, Condition.BLIND)
_LARGEST = 2**32
"""Counters begin at 0 again from here."""
_FARTHEST = 1e9
"""No height [m] and no time [s] is larger: a value beyond it is an error."""
UNKNOWN = Reading(math.nan, Quality.BAD)
COUNTERS: Mapping[int, str] = {
    Source.MEASURED: "measured_events",
    Source.ESTIMATED: "estimated_events",
    Source.DISAGREEMENT: "disagreement_events",
}
"""The counter of each quantity that a limit event is about."""


class CellView:
    """Collects the newest messages of one cell for its state.

    Args:
        now: steady time of the start [s]; the heartbeat counts from here.
    """

    def __init__(self, now: float) -> None:
        self._lock = threading.Lock()
        self._began = now
        self._heard_at = self._fused_at = self._calm_at = -math.inf
        self._compared: dict[str, Reading] = {}
        self._fused = UNKNOWN
        self._calm: dict[str, Reading] = {}
        self._limits: dict[str, Reading] = {}
        self._events: Counter[str] = Counter()

    def take_comparison(self, message: Any, now: float, age: float) -> None:
        """Stores a SloshComparison message.

        A monitor without inputs repeats their last stamp, with the state STALE: that is good.

        Args:
            message: the message.
            now: its arrival time [s] (monotonic clock).
            age: of its stamp [s].
        """
        known = message.state in tuple(Condition)
        condition = Condition(message.state) if known else Condition.BLIND
        doubtful, old = condition is Condition.BLIND, is_old(age)
        if old and condition not in _BLIND:
            condition, known = Condition.STALE, False
        quality = Quality.GOOD if known else Quality.BAD
        compared = {
            "state": Reading(condition, quality),
            "blind": Reading(condition in _BLIND, quality),
            "measured_height": _height(
                message.measured, doubtful or message.measured_flags, message.measured_stale or old
            ),
            "estimated_height": _height(
                message.estimated_nonlinear,
                doubtful or message.estimate_flags,
                message.estimate_stale or old,
            ),
        }
        with self._lock:
            self._compared, self._heard_at = compared, now

    def take_fused(self, message: Any, now: float, age: float) -> None:
        """Stores a FusedEstimate message with its arrival time and the age of its stamp [s]."""
        height = _height(message.msh, not message.trusted, is_old(age))
        with self._lock:
            self._fused, self._fused_at = height, now

    def take_calm(self, message: Any, now: float, age: float) -> None:
        """Stores a Calm message with its arrival time and the age of its stamp [s]."""
        stale = message.reason == CalmReason.STALE or is_old(age)
        unsure = message.reason == CalmReason.UNSURE
        time = _number(message.time_until_calm, unsure)
        if stale or time.value < 0.0:
            time = UNKNOWN
        flag = Quality.BAD if stale else Quality.UNCERTAIN if unsure else Quality.GOOD
        is_calm = Reading(bool(message.calm) and not stale, flag)
        with self._lock:
            self._calm, self._calm_at = {"calm": is_calm, "time_until_calm": time}, now

    def take_event(self, message: Any) -> None:
        """Counts a LimitEvent message that reports the start of a limit violation."""
        if message.kind == EventKind.START and message.source in COUNTERS:
            with self._lock:
                self._events[COUNTERS[message.source]] += 1

    def take_parameters(self, node: str, parameters: Mapping[str, Any]) -> None:
        """Stores the height limits if the parameters are those of the monitor node."""
        if node != "monitor":
            return
        limits = MonitorSettings.from_partial(parameters).limits
        with self._lock:
            self._limits = {
                "measured_limit": _number(limits[Source.MEASURED]),
                "estimated_limit": _number(limits[Source.ESTIMATED]),
            }

    def silence(self, now: float) -> float:
        """Returns the time since the last SloshComparison [s]; infinite before the first one."""
        with self._lock:
            return now - self._heard_at

    def state(self, now: float) -> CellState:
        """Returns the cell's state at a time of the monotonic clock [s].

        Without a comparison for TUNING.silence all values but the heartbeat have bad quality.
        """
        beat = int((now - self._began) / TUNING.period) % _LARGEST
        with self._lock:
            is_lost = now - self._heard_at > TUNING.silence
            known = {} if is_lost else self._compared | self._limits
            if not is_lost and now - self._fused_at <= TUNING.silence:
                known["fused_height"] = self._fused
            if not is_lost and now - self._calm_at <= TUNING.silence:
                known |= self._calm
            quality = Quality.BAD if is_lost else Quality.GOOD
            for name in COUNTERS.values():
                known[name] = Reading(self._events[name] % _LARGEST, quality)
        known["heartbeat"] = Reading(beat, Quality.GOOD)
        lost = {signal.name: Reading(signal.lost, Quality.BAD) for signal in SIGNALS}
        return CellState(is_lost, **{**lost, **known})


def is_old(age: float) -> bool:
    """Returns whether a stamp of such an age [s] is not of the present, or of the future."""
    return not abs(age) <= TUNING.oldest


def _number(value: float, doubtful: object = False) -> Reading:
    """Returns a number with its quality; NaN with bad quality if it is impossible."""
    if not abs(value) < _FARTHEST:  # nor is NaN
        return UNKNOWN
    return Reading(float(value), Quality.UNCERTAIN if doubtful else Quality.GOOD)


def _height(value: float, doubtful: object, is_stale: bool) -> Reading:
    return UNKNOWN if is_stale else _number(value, doubtful)
