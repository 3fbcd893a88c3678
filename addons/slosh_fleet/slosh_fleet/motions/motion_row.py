"""One motion of a recording as a row of the fleet store: columns, units and meanings."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple, TypeVar

from slosh_base.files.nanoseconds import SECOND

Value = TypeVar("Value")


class Column(NamedTuple):
    """A column of the store: name, Python type, unit (1 if dimensionless) and meaning."""

    name: str
    type: str
    unit: str
    meaning: str


def _column(_kind: type[Value], unit: str, meaning: str) -> Value:
    """Creates a field of MotionRow with unit and meaning; type checkers see a plain value."""
    made: Any = field(metadata={"unit": unit, "meaning": meaning})
    return made  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class MotionRow:
    """Key figures of one motion and of the standstill after it; one row of the fleet store.

    NaN in a number: unknown.
    """

    cell: str = _column(str, "1", "namespace of the cell, with dots for slashes")
    digest: str = _column(str, "1", "SHA-256 of the motion: the same in each bag that has it")
    opening: str = _column(
        str, "1", "SHA-256 of the motion's first samples: the same in a bag that is cut off later"
    )
    bag: str = _column(str, "1", "bag from which the row was read")
    container: str = _column(str, "1", "shape of the container")
    model_digest: str = _column(
        str, "1", "SHA-256 of the estimator's model file without its version"
    )
    begin_ns: int = _column(int, "ns", "begin of the motion, since 1970")
    duration: float = _column(float, "s", "duration of the motion")
    acceleration: float = _column(float, "m/s^2", "largest acceleration of the container")
    measured_peak: float = _column(float, "m", "largest measured height")
    linear_peak: float = _column(float, "m", "largest height of the linear model")
    nonlinear_peak: float = _column(float, "m", "largest height of the nonlinear model")
    measured_limit: float = _column(float, "m", "limit of the measured height")
    estimated_limit: float = _column(float, "m", "limit of the estimated height")
    sigma_linear: float = _column(float, "m", "mean absolute error of the linear model")
    sigma_nonlinear: float = _column(float, "m", "mean absolute error of the nonlinear model")
    epsilon_linear: float = _column(float, "1", "relative error of the linear model's peak")
    epsilon_nonlinear: float = _column(float, "1", "relative error of the nonlinear model's peak")
    images: int = _column(int, "1", "number of images with a usable measurement")
    calm_time: float = _column(float, "s", "time from the motion's end until the liquid was calm")
    natural_frequency: float = _column(float, "rad/s", "first mode, as the observer found it")
    natural_frequency_stddev: float = _column(float, "rad/s", "its standard deviation")
    damping_ratio: float = _column(float, "1", "of that mode, as the observer found it")
    damping_ratio_stddev: float = _column(float, "1", "its standard deviation")
    level: float = _column(float, "m", "still level above the measurement's zero")
    events: int = _column(int, "1", "number of exceeded limits")
    measured_flags: int = _column(int, "1", "flags of all measurements (slosh explain 0x3)")
    estimate_flags: int = _column(int, "1", "flags of all estimates (slosh explain 0x3)")

    @property
    def begin(self) -> datetime:
        """Start time of the motion (UTC)."""
        return datetime.fromtimestamp(self.begin_ns / SECOND, UTC)

    @property
    def month(self) -> str:
        """Month in which the motion starts, such as 2026-11."""
        return f"{self.begin:%Y-%m}"


COLUMNS: Final = tuple(
    Column(one.name, str(one.type), one.metadata["unit"], one.metadata["meaning"])
    for one in fields(MotionRow)
)
"""All columns, in order."""
