"""Which topics of a bag a replay, a discovery or an export reads, and what is known about them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from slosh_estimator.inputs import MESSAGE_TYPES
from slosh_replay.recording import settings, states
from slosh_replay.recording.cells import COMPARISON, ESTIMATE, SURFACE, CellTopics
from slosh_replay.recording.settings import NodeStart


class Sources(NamedTuple):
    """Topics of a bag that a replay reads, and what they say about it.

    Attributes:
        kind: of the input: 'accel', 'imu' or 'pose'.
        input, surface: topics.
        estimate, comparison: topics of what was recorded live; None: there is none.
        starts: of the recorded nodes.
        facts: about the whole bag.
        state: topic of the estimator's states; None: none were recorded.
        cells: namespaces of all cells that were recorded, the one that is read first.
    """

    kind: str
    input: str
    surface: str | None
    estimate: str | None
    comparison: str | None
    starts: tuple[NodeStart, ...]
    facts: Mapping[str, str]
    cells: tuple[str, ...] = ()
    state: str | None = None


def recorded_starts(reader: BagReader, found: CellTopics | None = None) -> list[NodeStart]:
    """The starts of a cell's nodes, in the order of the recording; empty: the bag does not tell.

    Args:
        reader: of the bag.
        found: the cell's topics; None: those of the bag's first cell.

    Raises:
        SloshBagError: the bag or what a node says in it cannot be read.
    """
    cell = found or CellTopics(reader.topics())
    topic = cell.topic(settings.TOPIC, settings.MESSAGE_TYPE)
    return settings.read_starts(reader, topic) if topic else []


def find_sources(
    path: Path, reader: BagReader, kind: str | None = None, cell: str | None = None
) -> Sources:
    """What a replay reads in a bag.

    Args:
        path: of the bag, for errors.
        reader: of the bag.
        kind: of the input; None: what the recorded estimator read, or the first that there is.
        cell: namespace of the topics; None: the bag's only or first cell.

    Raises:
        SloshBagError: there is no input, or no such cell.
    """
    found = CellTopics(reader.topics(), cell)
    if cell is not None and not found.is_there:
        raise SloshBagError(f"{path}: holds no topic of a cell {cell}")
    starts = recorded_starts(reader, found)
    started = settings.first(starts, "estimator")
    if kind is None and started is not None:
        kind = started.parameters.get("input")
    wanted = list(MESSAGE_TYPES) if kind is None else [kind]
    for name in wanted:
        topic = found.topic(name, MESSAGE_TYPES.get(name, ""))
        if topic is not None:
            found.settle(topic)
            return Sources(
                name,
                topic,
                found.topic("free_surface", SURFACE),
                found.topic("estimate", ESTIMATE),
                found.topic("comparison", COMPARISON),
                tuple(starts),
                reader.metadata(),
                found.cells,
                found.topic(states.TOPIC, states.MESSAGE_TYPE),
            )
    where = f" for the cell {found.cells[0] or '/'}" if len(found.cells) > 1 else ""
    raise SloshBagError(
        f"{path}: holds no message of {', '.join(wanted)}{where}; the model has no input"
    )
