"""State of a cell for controllers outside ROS: values with units and data quality.

Everything that a server tells about a value is in one field of CellState: its type, unit,
meaning and Modbus address.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum, IntEnum
from typing import Final, NamedTuple, cast

from slosh_estimator.comparison import Condition

ADDRESSES: Final = 4
"""Modbus registers of each value: two for the value, one for its quality, one spare."""


class Quality(IntEnum):
    """Quality of a value; the numbers are those in the Modbus registers."""

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


class Kind(Enum):
    """Data type of a value: boolean, integer, choice or number."""

    FLAG = "bool"
    COUNT = "uint32"
    CHOICE = "enum"
    NUMBER = "float"


class Reading(NamedTuple):
    """A value with its quality; NaN with bad quality means that the value is unknown."""

    value: float
    quality: Quality


class Signal(NamedTuple):
    """Description of one value of the cell state: name, type, unit, meaning, Modbus address.

    Attributes:
        name: of the value.
        kind: data type.
        unit: "m" or "s"; "1": none.
        meaning: one sentence.
        address: of its first Modbus register.
        lost: the value that is served when the cell is lost; NaN: the last one, or NaN.
        choices: meaning of each number of a CHOICE, from 0.
    """

    name: str
    kind: Kind
    unit: str
    meaning: str
    address: int
    lost: float
    choices: tuple[str, ...] = ()


def _signal(
    place: int,
    kind: Kind,
    unit: str,
    meaning: str,
    lost: float = math.nan,
    choices: tuple[str, ...] = (),
) -> Reading:
    """Creates a field of CellState with its description; type checkers see a Reading."""
    about = (kind, unit, meaning, ADDRESSES * place, lost, choices)
    return cast("Reading", field(metadata={"signal": about}))


@dataclass(frozen=True, slots=True)
class CellState:
    """State of a cell at one moment; each field's metadata describes its value.

    Attributes:
        is_lost: whether no message came from the cell's monitor for a while, or ever.
        others: the values, by their meanings below.
    """

    is_lost: bool
    state: Reading = _signal(
        0, Kind.CHOICE, "1", "state of the monitor", Condition.STALE,
        tuple(one.name for one in Condition),
    )  # fmt: skip
    blind: Reading = _signal(
        1, Kind.FLAG, "1", "the liquid is not observed: an input or the cell is missing", True
    )
    measured_height: Reading = _signal(
        2, Kind.NUMBER, "m", "maximum sloshing height that the camera measures"
    )
    estimated_height: Reading = _signal(
        3, Kind.NUMBER, "m", "maximum sloshing height that the model estimates"
    )
    fused_height: Reading = _signal(
        4, Kind.NUMBER, "m", "maximum sloshing height by camera and model together"
    )
    measured_limit: Reading = _signal(5, Kind.NUMBER, "m", "limit of the measured height")
    estimated_limit: Reading = _signal(6, Kind.NUMBER, "m", "limit of the estimated height")
    calm: Reading = _signal(
        7, Kind.FLAG, "1", "the wave stays within its tolerance if nothing moves", False
    )
    time_until_calm: Reading = _signal(8, Kind.NUMBER, "s", "time until the liquid is calm")
    measured_events: Reading = _signal(
        9, Kind.COUNT, "1", "how often the measured height has exceeded its limit"
    )
    estimated_events: Reading = _signal(
        10, Kind.COUNT, "1", "how often the estimated height has exceeded its limit"
    )
    disagreement_events: Reading = _signal(
        11, Kind.COUNT, "1", "how often measured and estimated height were too far apart"
    )
    heartbeat: Reading = _signal(
        12, Kind.COUNT, "1", "advances ten times a second while this server works"
    )

    def readings(self) -> Mapping[str, Reading]:
        """Returns the values by name, in the order of SIGNALS."""
        return {signal.name: getattr(self, signal.name) for signal in SIGNALS}


SIGNALS: Final = tuple(
    Signal(one.name, *one.metadata["signal"]) for one in fields(CellState) if one.metadata
)
"""All values of a cell that are served."""
REGISTERS: Final = ADDRESSES * len(SIGNALS)
"""Number of Modbus registers of a cell."""
