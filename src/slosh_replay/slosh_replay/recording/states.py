"""Reads the estimator's states from the `estimator_state` topic of a recording."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagReader, messages_of, stamp_ns
from slosh_estimator.state import EstimatorState

TOPIC: Final = "estimator_state"
MESSAGE_TYPE: Final = "slosh_msgs/msg/EstimatorState"


class RecordedState(NamedTuple):
    """Recorded state of the estimator; see EstimatorState.msg.

    Attributes:
        stamp_ns: of the last input that was used [ns].
        used: inputs that were used since the start.
        estimator: the core's state.
        memory: what the reader of the input remembers.
    """

    stamp_ns: int
    used: int
    estimator: EstimatorState
    memory: tuple[float, ...]


def states_of(reader: BagReader, block: MessageBlock) -> tuple[RecordedState, ...]:
    """Returns the estimator states in a message block; invalid ones are ignored."""
    return tuple(_readable(reader, block))


def _readable(reader: BagReader, block: MessageBlock) -> Iterator[RecordedState]:
    for message in messages_of(block):
        try:
            yield _state(reader.decode(message))
        except (SloshBagError, ValueError):
            continue


def _state(message: Any) -> RecordedState:
    return RecordedState(
        stamp_ns(message),
        int(message.samples_used),
        EstimatorState.of_message(message),
        tuple(message.input.tolist()),
    )
