"""An open recording with cached contents, shared by all readers."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path

from slosh_bag.mcap_files.remote_path import bag_path
from slosh_bag.reader import BagReader, TopicInfo
from slosh_motion.recorded.settings import NodeStart
from slosh_motion.recorded.sources import CellTopics


class RecordedRun:
    """A finished recording of a robot cell, opened once, with cached contents.

    Args:
        path: the bag's folder or MCAP file.

    Attributes:
        path: as given.
        reader: the one reader of it.

    Raises:
        SloshBagError: there is no readable bag.

    >>> run = RecordedRun("bags/c3")
    >>> run.topics["/slosh/estimate"].message_type
    'slosh_msgs/msg/SloshEstimate'
    """

    def __init__(self, path: str | Path) -> None:
        self.path = bag_path(path)
        self.reader = BagReader(self.path)

    @cached_property
    def topics(self) -> Mapping[str, TopicInfo]:
        """Type and number of messages of each topic."""
        return self.reader.topics()

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """Metadata of the whole recording that the recorder stored."""
        return self.reader.metadata()

    @cached_property
    def cell(self) -> CellTopics:
        """The topics of the recording's first cell."""
        return CellTopics(self.reader)

    @property
    def starts(self) -> tuple[NodeStart, ...]:
        """The settings messages of the nodes in the recording's first cell."""
        return self.cell.starts
