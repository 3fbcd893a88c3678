"""What became of the predictions that were made while a cell was recorded."""

from __future__ import annotations

from typing import Final, NamedTuple

from slosh_bag.reader import BagReader
from slosh_replay.recording.cells import CellTopics

TOPIC: Final = "prediction_outcome"
MESSAGE_TYPE: Final = "slosh_msgs/msg/PredictionOutcome"


class PredictedMotion(NamedTuple):
    """A planned motion: its number, and what was predicted, estimated and measured of it [m].

    Attributes:
        id: counts the planned trajectories.
        predicted, estimated, measured: highest heights [m].
        counted: whether what ran was what was planned.
    """

    id: int
    predicted: float
    estimated: float
    measured: float
    counted: bool

    @property
    def sentence(self) -> str:
        """The three heights, for people."""
        heights = (
            f"highest {1e3 * self.predicted:.1f} mm predicted, {1e3 * self.estimated:.1f} mm "
            f"estimated, {1e3 * self.measured:.1f} mm measured"
        )
        return heights if self.counted else f"{heights}; not the motion that was planned"


def predicted_motions(reader: BagReader) -> tuple[PredictedMotion, ...]:
    """The planned motions of a recording's first cell, in their order.

    Raises:
        SloshBagError: the bag cannot be read.
    """
    topic = CellTopics(reader.topics()).topic(TOPIC, MESSAGE_TYPE)
    if topic is None:
        return ()
    outcomes = [reader.decode(message) for message in reader.messages({topic})]
    return tuple(
        PredictedMotion(one.id, one.predicted, one.estimated, one.measured, bool(one.counted))
        for one in outcomes
    )
