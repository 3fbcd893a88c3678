"""Keys of a bag's metadata and what they mean."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from typing import Any, Final

from slosh_bag.black_box.black_box import EVENTS
from slosh_bag.black_box.event_bags import noted_events
from slosh_bag.recorder import LOST, LOST_BY_TOPIC, PUBLISHERS, SEVERAL
from slosh_model.shapes.cylinder import Cylinder

CLOCKS: Final = "clocks"
UNRELATED: Final = "unrelated"
TABLE_COLUMNS: Final = "table_columns"
"""Names of the columns of the motion table that a bag was made of."""
TABLE_ORIGIN: Final = "table_origin_ns"
"""The stamp at that table's t = 0 [ns]."""
CONTAINER_RADIUS: Final = "container_radius"
CONTAINER_FILL_HEIGHT: Final = "container_fill_height"


def clocks_unrelated(facts: Mapping[str, str]) -> bool:
    """Returns whether the stamps of inputs and heights come from unrelated clocks."""
    return facts.get(CLOCKS) == UNRELATED


def lost_messages(facts: Mapping[str, str]) -> dict[str, int]:
    """Returns the number of lost messages by topic, as far as the recorder knew.

    Those of which the topic is not known stand under an empty name.
    """
    counts = _json_object(facts.get(LOST_BY_TOPIC, ""))
    if counts and all(isinstance(count, int) for count in counts.values()):
        return counts
    total = facts.get(LOST, "0")
    return {"": int(total)} if total.isdecimal() and int(total) else {}


def event_lines(facts: Mapping[str, str], start_ns: int) -> tuple[str, ...]:
    """Returns one line for each event that caused the bag to be written.

    Args:
        facts: of the bag.
        start_ns: the zero of the times that are told [ns].
    """
    return tuple(
        f"event {event.cause} at {1e-9 * (event.stamp_ns - start_ns):.2f} s: {event.text}"
        for event in noted_events(facts.get(EVENTS, ""))
    )


def mixed_topics(facts: Mapping[str, str]) -> frozenset[str]:
    """Returns the topics on which several publishers sent although one is allowed."""
    return frozenset(filter(None, facts.get(SEVERAL, "").split(",")))


def shared_topics_line(facts: Mapping[str, str]) -> str:
    """Describes topics that wrongly have several publishers; empty if there are none."""
    topics = facts.get(SEVERAL, "")
    if not topics:
        return ""
    nodes = _json_object(facts.get(PUBLISHERS, ""))
    named = ", ".join(_with_nodes(topic, nodes.get(topic)) for topic in topics.split(","))
    return (
        f"several publishers were mixed on {named}, as when two cells share a namespace: their "
        "messages cannot be separated; stop one publisher, or give it another namespace or "
        "ROS_DOMAIN_ID"
    )


def _with_nodes(topic: str, nodes: Any) -> str:
    """Formats a topic with the names of its publishing nodes."""
    if not isinstance(nodes, list) or not nodes:
        return topic
    counts = Counter(str(node) for node in nodes)
    named = (f"{count} x {node}" if count > 1 else node for node, count in counts.items())
    return f"{topic} (of {', '.join(named)})"


def _json_object(text: str) -> dict[str, Any]:
    """Parses a JSON object; returns an empty one if the text is invalid."""
    try:
        document = json.loads(text)
    except ValueError:
        return {}
    return document if isinstance(document, dict) else {}


def noted_container(facts: Mapping[str, str]) -> Cylinder | None:
    """Returns the container in the bag's metadata, or None if it has none.

    Raises:
        SloshModelError: they tell of an impossible one.
    """
    try:
        radius, fill_height = float(facts[CONTAINER_RADIUS]), float(facts[CONTAINER_FILL_HEIGHT])
    except (KeyError, ValueError):
        return None
    return Cylinder(radius, fill_height)
