"""What the nodes of a cell read and publish, under whatever names."""

from __future__ import annotations

from rclpy.node import Node

from slosh_msgs_py import topics

_RCL_ERRORS = (RuntimeError, ValueError)
"""Of a node that has just ended; rclpy's NodeNameNonExistentError is a RuntimeError."""


def used_topics(node: Node) -> set[str]:
    """Topics of the cell's nodes; they are those that publish their settings in its namespace.

    Args:
        node: one in the cell's namespace.
    """
    found: set[str] = set()
    for info in node.get_publishers_info_by_topic(topics.SETTINGS):
        for ask in (
            node.get_subscriber_names_and_types_by_node,
            node.get_publisher_names_and_types_by_node,
        ):
            try:
                known = ask(info.node_name, info.node_namespace)
            except _RCL_ERRORS:
                continue
            found.update(topic for topic, _ in known)
    return found
