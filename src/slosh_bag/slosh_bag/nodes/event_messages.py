"""Detects events in a cell's messages for the event recorder."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final

from rclpy.node import Node
from rclpy.qos import QoSDurabilityPolicy as Durability
from rclpy.serialization import deserialize_message

from slosh_bag.black_box.black_box import Happening, Windows
from slosh_bag.black_box.causes import CalmWatch, ComparisonWatch, limit_happening
from slosh_bag.black_box.event_bags import EventRecorder
from slosh_bag.black_box.ring import Place
from slosh_bag.nodes.topic_input import Received, TopicInput
from slosh_bag.recorder import Recorder
from slosh_base.files.errors import YamlError
from slosh_base.files.nanoseconds import SECOND
from slosh_base.files.yaml_document import parse_yaml
from slosh_msgs.msg import Calm, FusedEstimate, LimitEvent, NodeSettings, SloshComparison
from slosh_msgs_py import topics
from slosh_msgs_py.node.parameters import ParameterSpec
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_msgs_py.topics import TopicRole

_START, _CHANGE = 0, 1
_TYPES = {row.name: row.type for row in topics.TOPICS}
_SETTINGS, _TRANSFORMS = _TYPES[topics.SETTINGS], _TYPES[topics.TF_STATIC]
_CAMERA_INFO = _TYPES[topics.CAMERA_INFO]
STANDS_ALONE: Final = Place(())
BEFORE, AFTER, MEMORY = "event_before", "event_after", "event_memory"
PER_CAUSE, QUOTA = "bags_per_cause", "event_quota"
EVENT_PARAMETERS = (
    ParameterSpec(
        BEFORE, 10.0, "in mode events: recorded time before an event [s]", bounds=(0.5, 600.0)
    ),
    ParameterSpec(
        AFTER, 10.0, "in mode events: recorded time after an event [s]", bounds=(0.0, 600.0)
    ),
    ParameterSpec(
        MEMORY,
        256_000_000,
        "in mode events: memory for recent messages [bytes]; at most a quarter of the quota",
        bounds=(1_000_000, 10**11),
    ),
    ParameterSpec(
        PER_CAUSE,
        20,
        "in mode events: number of bags kept for each cause; older ones are deleted",
        bounds=(1, 10**6),
    ),
    ParameterSpec(
        QUOTA,
        4_000_000_000,
        "in mode events: total size of the bags kept [bytes]; older ones are deleted",
        bounds=(10_000_000, 10**15),
    ),
)
"""Of the mode in which the recorder records events."""


def event_recorder(
    folder: Path, values: Mapping[str, Any], place: Callable[[str, bytes], Place | None]
) -> EventRecorder:
    """Creates an event recorder from the node's parameters.

    Args:
        folder: of the bags.
        values: of EVENT_PARAMETERS.
        place: of a message; see `Ring`.

    Raises:
        SloshBagError: the folder holds a recording, or cannot be made.
    """
    quota = values[QUOTA]
    before_ns, after_ns = (round(values[name] * SECOND) for name in (BEFORE, AFTER))
    windows = Windows(before_ns, after_ns, values[MEMORY], quota)
    return EventRecorder(folder, windows, values[PER_CAUSE], quota, place)


def event_facts(core: Recorder | EventRecorder) -> dict[str, Any]:
    """Returns diagnostics values of an event recorder; empty for any other recorder."""
    if not isinstance(core, EventRecorder):
        return {}
    box = core.box
    return {
        "events": box.events,
        "events without a bag": box.missed,
        "event bag": "being written" if box.is_writing else "none",
        "time in memory [s]": f"{box.span_ns / SECOND:.1f}",
        "memory [MB]": f"{1e-6 * box.ring.size:.1f}",
    }


class EventMessages:
    """Detects events, such as limit violations, in a cell's messages.

    Args:
        node: the recorder; its remapping tells the names of the cell's topics.
        values: of EVENT_PARAMETERS. A message that was sent before the time that is in memory is a
            latched one of earlier, and no event.
    """

    def __init__(self, node: Node, values: Mapping[str, Any]) -> None:
        self._late_ns = round(values[BEFORE] * SECOND)
        self._calm, self._comparisons = CalmWatch(), ComparisonWatch()
        reads: Mapping[str, tuple[Any, Callable[[Any, int], list[Happening]]]] = {
            topics.LIMIT_EVENT: (LimitEvent, _limit),
            topics.COMPARISON: (SloshComparison, self._comparison),
            topics.CALM: (Calm, self._calm.answer),
            topics.FUSED_ESTIMATE: (FusedEstimate, self._fused),
        }
        self._reads = {node.resolve_topic_name(name): read for name, read in reads.items()}

    def happenings(self, received: Received, message_type: Any) -> list[Happening]:
        """Returns the events that a message reports; empty if it cannot be decoded."""
        wanted, read = self._reads.get(received.topic, (None, None))
        late = received.sent_ns and received.arrived_ns - received.sent_ns > self._late_ns
        if read is None or wanted is not message_type or late:
            return []
        try:
            message = deserialize_message(received.data, wanted)
            return read(message, to_nanoseconds(message.header.stamp))
        except Exception:  # rclpy raises RCLError, UnicodeDecodeError and others of damaged bytes
            return []

    def _comparison(self, message: SloshComparison, stamp_ns: int) -> list[Happening]:
        found = self._comparisons.take(message, stamp_ns)
        if message.measured_stale or message.measured_flags:
            return found
        return found + self._calm.height(
            "measured", stamp_ns, message.measured, message.measured_stddev
        )

    def _fused(self, message: FusedEstimate, stamp_ns: int) -> list[Happening]:
        if not message.trusted:
            return []
        return self._calm.height("fused", stamp_ns, message.msh, message.msh_stddev)


def _limit(message: LimitEvent, stamp_ns: int) -> list[Happening]:
    happening = limit_happening(message, stamp_ns)
    return [] if happening is None else [happening]


def place_of(entry: TopicInput, data: bytes) -> Place | None:
    """Returns the key by which a latched message replaces earlier ones; None if it replaces none.

    Args:
        entry: its topic.
        data: CDR bytes.
    """
    cell = topics.cell_name(entry.topic)
    answer = cell is not None and cell.topic is not None and cell.topic.role is TopicRole.ANSWER
    latched = entry.profile.durability == Durability.TRANSIENT_LOCAL
    if answer or not (latched or entry.type_name == _CAMERA_INFO):
        return None  # an answer of earlier is no answer of now
    try:
        if entry.type_name == _SETTINGS:
            return _place_of_settings(deserialize_message(data, entry.message_type))
        if entry.type_name == _TRANSFORMS:
            transforms = deserialize_message(data, entry.message_type).transforms
            return Place(tuple(sorted(one.child_frame_id for one in transforms)))
    except Exception:  # damaged bytes, as above: they stand for themselves
        return Place(data)
    return STANDS_ALONE


def _place_of_settings(settings: NodeSettings) -> Place:
    """Returns the key by which a settings message replaces earlier ones of the same node."""
    try:
        document = parse_yaml(settings.document, "settings").value
        level = _CHANGE if document.get("changed") else _START
    except (YamlError, AttributeError):
        level = _START
    return Place(settings.node, level)
