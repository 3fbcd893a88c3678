"""Publishes a node's settings, which are needed to replay a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rclpy.node import Node

from slosh_base.files.yaml_document import format_yaml
from slosh_msgs.msg import NodeSettings
from slosh_msgs_py import qos, topics
from slosh_msgs_py.stamps import to_time


class SettingsPublisher:
    """Publishes a node's settings on a latched topic.

    Args:
        node: the node.
        code: digest of its package's sources.
        arithmetic: how this machine rounds.
        parameters: values by name, as `declare` gives them; later changes are read from them.
        names: topics that the node reads and publishes, as its code has them.
    """

    def __init__(
        self,
        node: Node,
        code: str,
        arithmetic: str,
        parameters: Mapping[str, Any],
        names: Sequence[str] = (),
    ) -> None:
        self._name = node.get_name()
        self._code, self._arithmetic = code, arithmetic
        self._parameters = parameters
        self._files: Mapping[str, str] | None = None
        self._topics = {name: node.resolve_topic_name(name) for name in names}
        self._publisher = node.create_publisher(NodeSettings, topics.SETTINGS, qos.EVENT)

    def publish(self, files: Mapping[str, str], stamp_ns: int = 0) -> None:
        """Publishes all settings when a node starts or starts its computation again.

        Args:
            files: text of each file that the node has read, by the parameter that names it.
            stamp_ns: the last input that was used before [ns]; 0: none.
        """
        self._files = dict(files)
        self._send(stamp_ns)

    def publish_change(self, changed: Sequence[str], stamp_ns: int) -> None:
        """Publishes changed parameters of a running node.

        Before the node's start was announced nothing is published: the start tells the values.

        Args:
            changed: names of the parameters.
            stamp_ns: the last input to which the old values applied [ns]; 0: there was none.
        """
        if self._files is not None:
            self._send(stamp_ns, tuple(changed))

    def _send(self, stamp_ns: int, changed: Sequence[str] = ()) -> None:
        message = NodeSettings()
        message.header.stamp = to_time(stamp_ns)
        message.node, message.code, message.arithmetic = self._name, self._code, self._arithmetic
        document: dict[str, Any] = {
            "parameters": dict(self._parameters),
            "topics": self._topics,
            "files": self._files,
        }
        if changed:
            document["changed"] = list(changed)
        message.document = format_yaml(document, sort_keys=True, allow_unicode=True)
        self._publisher.publish(message)
