"""Plan of the month's days: number of motions, kind of recording, and failures."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from slosh_motion.tables.motion_table import MotionTable, write_motion_table

LEAD = 2.0
"""Rest before a day's first motion [s]."""
ACTIVE, REST = 0.8, 1.5
"""Length of a motion and of the rest after it [s]."""
PERIOD = ACTIVE + REST
PLAIN_MOTIONS = 4
"""Of a day without trouble."""
RATE = 200.0  # Hz


class Trouble(Enum):
    """A failure on a day, such as a full disk, with the number of additional motions."""

    BROKER_LOST = ("the MQTT broker is killed", 2)
    BROKER_BACK = ("the MQTT broker starts again", 3)
    RESTART = ("the cell is stopped and started again", 9)
    FULL_DISK = ("the disk is full for 3 s", 4)
    KILL = ("cell and PLC node are killed in the middle of a motion", 9)
    FULL_TO_END = ("the disk is full to the end of the day", 4)

    def __init__(self, text: str, motions: int) -> None:
        self.text, self.motions = text, motions


PLACES = {
    Trouble.BROKER_LOST: 0.1, Trouble.BROKER_BACK: 0.2, Trouble.RESTART: 0.3,
    Trouble.FULL_DISK: 0.45, Trouble.KILL: 0.6, Trouble.FULL_TO_END: 0.75,
}  # fmt: skip
"""Part of the month after which each happens."""


@dataclass(frozen=True, slots=True)
class Day:
    """One day of the simulated month, on which the cell runs once.

    Attributes:
        number: from 1.
        ago: days between it and today, the month's last day.
        troubles: what goes wrong, in this order.
        events: whether only the time around limit events is recorded; else everything is.
    """

    number: int
    ago: int
    troubles: tuple[Trouble, ...] = ()
    events: bool = False

    @property
    def motions(self) -> int:
        """Number of motions that the robot makes on this day."""
        return PLAIN_MOTIONS + sum(trouble.motions for trouble in self.troubles)

    def moment(self, trouble: Trouble) -> float:
        """Returns the time of a failure since the middle of the day's first motion [s]."""
        before = self.troubles[: self.troubles.index(trouble)]
        return PERIOD * (1 + sum(one.motions for one in before))


def days_of(count: int) -> list[Day]:
    """Returns the plan of all days; every fifth day without a failure records only events."""
    found = []
    for number in range(1, count + 1):
        troubles = tuple(
            one for one, place in PLACES.items() if number == min(count, 1 + int(place * count))
        )
        events = number % 5 == 0 and not troubles
        found.append(Day(number, count - number, troubles, events))
    return found


def write_motions(path: Path, count: int) -> None:
    """Writes a day's motion table: strokes to and fro along x, each from rest to rest.

    Args:
        path: of the table.
        count: number of motions.
    """
    t = np.arange(round((LEAD + count * PERIOD) * RATE)) / RATE
    number, phase = np.divmod(t - LEAD, PERIOD)
    moves = (number >= 0) & (phase < ACTIVE)
    strength = np.where(number % 2, -1.0, 1.0) * (0.8 + 0.05 * number)
    push = np.where(moves, strength * np.sin(2.0 * np.pi * phase / ACTIVE), 0.0)
    write_motion_table(path, MotionTable(t, np.column_stack([push, 0.0 * t, 0.0 * t])))
