"""Converts messages to table rows, one block of messages at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from slosh_bag.columns.cdr_columns import ColumnReader, Group
from slosh_bag.interchange.export_fields import STAMP, ColumnField, leaves, row_getter
from slosh_bag.mcap_files.chunks import MessageBlock
from slosh_bag.reader import BagMessage, BagReader, messages_of
from slosh_base.files.nanoseconds import SECOND

FEWEST_ALIKE: Final = 16
"""Messages per length for which reading them together pays, rather than one by one."""
Times = list[NDArray[np.int64]]
Values = list[Any]


class RowReader:
    """Reads one topic's messages as columns of times and field values.

    Args:
        reader: of the bag.
        message_type: of the topic's messages.

    Attributes:
        fields: the leaves.
        time_names: of the columns of whole nanoseconds.

    Raises:
        SloshBagError: the bag does not define the type.
    """

    def __init__(self, reader: BagReader, message_type: str) -> None:
        self._reader = reader
        self.fields = leaves(reader.typestore_of(message_type), message_type)
        names = {leaf.name for leaf in self.fields}
        self._stamped = names.issuperset(STAMP)
        times = ["log_ns", "publish_ns", *(["stamp_ns"] if self._stamped else [])]
        # A message's own field of that name keeps it.
        self.time_names = [name if name not in names else f"{name}_" for name in times]
        self._get = row_getter(self.fields)
        self._columns = ColumnReader(reader.typestore_of)
        self._flat = all(leaf.is_flat for leaf in self.fields)

    def block(self, block: MessageBlock) -> tuple[Times, Values]:
        """Returns the times and field values of a block of messages.

        Raises:
            SloshBagError: a message is not of its type.
        """
        lengths = len(np.unique(block.length))
        if not self._flat or lengths * FEWEST_ALIKE > max(len(block), FEWEST_ALIKE):
            return self.messages(list(messages_of(block)))
        names = [leaf.name for leaf in self.fields]
        groups = list(self._columns.groups(block, names))
        values = [_gathered(leaf, groups, len(block)) for leaf in self.fields]
        times_ns = [block.log_ns, block.publish_ns]
        if self._stamped:
            sec, nanosec = (np.asarray(values[names.index(name)], np.int64) for name in STAMP)
            times_ns.append(sec * SECOND + nanosec)
        return times_ns, values

    def messages(self, messages: Sequence[BagMessage]) -> tuple[Times, Values]:
        """Returns the times and field values of messages that are decoded one by one.

        Raises:
            SloshBagError: a message is not of its type.
        """
        decoded = [self._reader.decode(message) for message in messages]
        times = [[m.log_ns for m in messages], [m.publish_ns for m in messages]]
        if self._stamped:
            stamps = [message.header.stamp for message in decoded]
            times.append([stamp.sec * SECOND + stamp.nanosec for stamp in stamps])
        values = list(zip(*map(self._get, decoded), strict=True))
        return [np.array(column, dtype=np.int64) for column in times], values


def _gathered(leaf: ColumnField, groups: Sequence[Group], rows: int) -> Any:
    """Returns a field's values in the block's order: (N,), (N, n) or a list of arrays."""
    # A sequence without elements has no place in its message, and no column.
    parts = [
        (group.rows, group.columns.get(leaf.name, np.empty((len(group.rows), 0))))
        for group in groups
    ]
    if len(parts) == 1:
        return parts[0][1]
    if leaf.shape == "list":
        lists: list[Any] = [None] * rows
        for places, part in parts:
            for place, value in zip(places.tolist(), part, strict=True):
                lists[place] = value
        return lists
    first = parts[0][1]
    whole = np.empty((rows, *first.shape[1:]), first.dtype)
    for places, part in parts:
        whole[places] = part
    return whole
