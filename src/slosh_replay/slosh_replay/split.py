"""Splits a bag at the places where the input's stamps decrease."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.bag_writer import BagWriter
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.bag_contents import bag_contents
from slosh_bag.reader import BagMessage, BagReader, messages_of, stamp_ns
from slosh_bag.recover import NotedDefinitions
from slosh_base.files import check_outside, new_folder
from slosh_motion.inputs.inputs import TRANSFORMS
from slosh_motion.recorded.inputs import STAMP, recorded_inputs, stamps_of
from slosh_motion.recorded.motion import set_backs, strays_ahead
from slosh_motion.recorded.sources import Sources, find_sources
from slosh_msgs_py import topics

PART = "part_{}"
_TOLD_ONCE = {name.rpartition("/")[2] for name in (topics.TF_STATIC, topics.ROBOT_DESCRIPTION)}
"""Topics that count for all parts, also where a recorder noted no quality of service."""


def split_bag(path: Path, folder: Path, progress: Callable[[int], None]) -> list[Path]:
    """Writes a bag for each part of a recording in which time increases.

    What is told once, such as the nodes' settings, stands at the begin of each of them.

    Args:
        path: the bag's folder, or one MCAP file.
        folder: of the new bags; it must be new or empty.
        progress: is told how many messages were copied since it was told last.

    Returns:
        the new bags.

    Raises:
        SloshBagError: no readable bag, no input in it, or its stamps never go back.
        SloshFileError: the folder holds something, or lies in the bag.
        OSError: a new bag cannot be written.
    """
    reader = BagReader(path)
    sources = find_sources(path, reader)
    cuts = _cuts(reader, sources)
    if not len(cuts):
        raise SloshBagError(
            f"{path}: the stamps of {sources.input} never go back: nothing to split"
        )
    check_outside(folder, [path])
    with new_folder(folder) as room:
        names = [PART.format(number + 1) for number in range(len(cuts) + 1)]
        copy = _Copy(reader, [room / name for name in names], cuts, progress)
        copy.run()
    return [folder / name for name in names]


def _cuts(reader: BagReader, sources: Sources) -> NDArray[np.int64]:
    """Returns the log times [ns] at which the input's clock was set back."""
    if sources.kind == TRANSFORMS:
        stamps, logs = _transform_stamps(reader, sources.input)
    else:
        each, log_ns = [np.empty(0, dtype=np.int64)], [np.empty(0, dtype=np.int64)]
        for block in reader.blocks([sources.input]):
            each.append(stamps_of(reader.columns(block, STAMP)))
            log_ns.append(block.log_ns)
        stamps, logs = np.concatenate(each), np.concatenate(log_ns)
    gap = recorded_inputs(sources.starts, sources.facts).gate.max_gap
    kept = ~strays_ahead(stamps, round(gap * 1e9))
    found: NDArray[np.int64] = logs[kept][set_backs(stamps[kept].tolist())]
    return found


def _transform_stamps(
    reader: BagReader, topic: str
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Returns stamps and log times [ns] of the transform that is sent most often.

    Others may be stamped ahead, as a localisation's are.
    """
    known: dict[str, list[tuple[int, int]]] = {}
    for block in reader.blocks([topic]):
        for message in messages_of(block):
            for one in reader.decode(message).transforms:
                known.setdefault(one.child_frame_id, []).append((stamp_ns(one), message.log_ns))
    most = max(known.values(), key=len, default=[])
    stamps, logs = np.array(most, dtype=np.int64).reshape(-1, 2).T
    return stamps, logs


class _Copy:
    def __init__(
        self,
        reader: BagReader,
        folders: list[Path],
        cuts: NDArray[np.int64],
        progress: Callable[[int], None],
    ) -> None:
        self._reader, self._folders, self._cuts = reader, folders, cuts.tolist()
        self._progress = progress
        self._topics = bag_contents(reader.path).topics
        self._latched: list[BagMessage] = []

    def run(self) -> None:
        """Writes the new bags, one for each part of the recording."""
        messages = iter(self._reader.messages())
        waiting = next(messages, None)
        for folder, end in zip(self._folders, [*self._cuts, None], strict=True):
            # The messages stay what they are: so do their definitions.
            own = NotedDefinitions(self._reader.types)
            with BagWriter(folder, own, self._reader.metadata()) as writer:
                for name, topic in self._topics.items():
                    writer.add_topic(name, topic.message_type, *topic.offered[:1])
                for message in self._latched:
                    start = waiting.log_ns if waiting else message.log_ns
                    writer.write(message.topic, message.data, start, message.publish_ns)
                while waiting is not None and (end is None or waiting.log_ns < end):
                    self._take(waiting, writer)
                    waiting = next(messages, None)

    def _take(self, message: BagMessage, writer: BagWriter) -> None:
        writer.write(message.topic, message.data, message.log_ns, message.publish_ns)
        self._progress(1)
        if self._topics[message.topic].latched or message.topic.rpartition("/")[2] in _TOLD_ONCE:
            self._latched.append(message)
