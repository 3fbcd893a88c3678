"""PLC node: serves a cell's state to controllers over OPC UA, MQTT and Modbus TCP.

It takes messages in batches, ten times a second. The servers run in a thread of their own and
ask for the state themselves; the node never decides what is good.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from slosh_bag.errors import SloshBagError
from slosh_base.files.nanoseconds import SECOND
from slosh_estimator.comparison import Condition
from slosh_motion.recorded.settings import node_start
from slosh_msgs.msg import Calm, FusedEstimate, LimitEvent, NodeSettings, SloshComparison
from slosh_msgs_py import qos, topics
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN, DiagnosticsReporter, Health
from slosh_msgs_py.node.parameters import ParameterSpec, declare
from slosh_msgs_py.node.polled import PolledNode, take
from slosh_msgs_py.node.run import run_node
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_plc.broker_client import read_settings
from slosh_plc.cell_view import CellView, is_old
from slosh_plc.certificates import read_server_certificate, read_trusted
from slosh_plc.errors import SloshPlcError
from slosh_plc.modbus import ModbusServer, ModbusSettings
from slosh_plc.mqtt import MqttPublisher
from slosh_plc.opc_ua import OpcUaServer, OpcUaSettings
from slosh_plc.server import Server, ServerThread
from slosh_plc.sparkplug import SparkplugNode
from slosh_plc.tuning import TUNING

BATCH = 2000
"""Most messages of a topic that are taken at once."""
LASTING = (NodeSettings, LimitEvent)
"""Messages that hold until the next one, however late they are taken."""
PARAMETERS = (
    ParameterSpec(
        "host", "127.0.0.1", "address on which the servers listen; 0.0.0.0: all addresses"
    ),
    ParameterSpec("opc_ua_port", 4840, "port of OPC UA; 0: no OPC UA", (0, 65535)),
    ParameterSpec(
        "certificate", "", "certificate of the OPC UA server, PEM or DER; empty: no security"
    ),
    ParameterSpec("private_key", "", "private key of the certificate, PEM or DER"),
    ParameterSpec(
        "trusted_clients", "",
        "folder with the certificates of the OPC UA clients that may connect; empty: all",
    ),
    ParameterSpec("modbus_port", 0, "port of Modbus TCP, usually 502; 0: no Modbus", (0, 65535)),
    ParameterSpec("mqtt_broker", "", "MQTT broker, HOST or HOST:PORT; empty: no MQTT"),
    ParameterSpec("mqtt_user", "", "user name for the MQTT broker; empty: none"),
    ParameterSpec("mqtt_password_file", "", "file whose first line is that user's password"),
    ParameterSpec(
        "mqtt_authority", "",
        "PEM file of the authority that signed the broker's certificate; empty: no TLS",
    ),
    ParameterSpec(
        "mqtt_certificate", "", "PEM file of the node's certificate for the broker; empty: none"
    ),
    ParameterSpec("mqtt_private_key", "", "PEM file of the private key of mqtt_certificate"),
    ParameterSpec(
        "sparkplug_group", "",
        "group of a Sparkplug B edge node that is published in addition to the JSON document; "
        "empty: no Sparkplug",
    ),
)  # fmt: skip


class PlcNode(PolledNode):
    """ROS node that creates a cell's state from its messages and serves it to controllers.

    Attributes:
        failure: why the servers have ended; empty: they work.
    """

    def __init__(self) -> None:
        self.failure = ""
        super().__init__("plc")
        given = declare(self, PARAMETERS)
        servers = servers_of(given, self.get_namespace().strip("/") or "slosh")
        self._view = CellView(time.monotonic())
        self._looked = time.monotonic()
        self._aged = 0.0  # age of a stamp that is not of the present [s]
        self._taken: list[tuple[Subscription, Any, Callable[[Any], None]]] = []
        self._add(NodeSettings, topics.SETTINGS, qos.EVENT, self._on_settings)
        self._add(LimitEvent, topics.LIMIT_EVENT, qos.EVENT, self._view.take_event)
        self._add(SloshComparison, topics.COMPARISON, qos.STREAM_IN, self._on_comparison)
        self._add(FusedEstimate, topics.FUSED_ESTIMATE, qos.NEWEST_IN, self._on_fused)
        self._add(Calm, topics.CALM, qos.NEWEST_IN, self._on_calm)
        self._report = DiagnosticsReporter(self, self._health)
        self._servers = ServerThread(servers, lambda: self._view.state(time.monotonic()))
        self._servers.start()
        self.create_timer(TUNING.period, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        for health in self._servers.health():
            self.get_logger().info(health.sentence)

    def close(self) -> None:
        """Stops the servers; MQTT brokers keep a message that the cell's values are not valid."""
        self._servers.stop()

    def _add(self, kind: Any, topic: str, profile: QoSProfile, use: Callable[[Any], None]) -> None:
        self._taken.append((self.subscribe_polled(kind, topic, profile), kind, use))

    def _look(self) -> None:
        before, self._looked = self._looked, time.monotonic()
        # What waited while this process stood still tells nothing of the cell as it is now.
        is_late = self._looked - before > TUNING.silence
        for subscription, kind, use in self._taken:
            for message in take(subscription, kind, BATCH):
                if is_late and kind not in LASTING:
                    continue
                self._report.counts[subscription.topic.rpartition("/")[2]] += 1
                try:
                    use(message)
                except Exception as error:  # one bad message must not cost those after it
                    self.faults.add(subscription.topic, error)
        self.failure = self._servers.failure

    def _on_comparison(self, message: SloshComparison) -> None:
        self._view.take_comparison(message, time.monotonic(), self._age(message))

    def _on_fused(self, message: FusedEstimate) -> None:
        self._view.take_fused(message, time.monotonic(), self._age(message))

    def _on_calm(self, message: Calm) -> None:
        self._view.take_calm(message, time.monotonic(), self._age(message))

    def _age(self, message: SloshComparison | FusedEstimate | Calm) -> float:
        """Returns the age of a message by its stamp [s]."""
        found = float(self.get_clock().now().nanoseconds - to_nanoseconds(message.header.stamp))
        age = found / SECOND
        if not isinstance(message, SloshComparison) or message.state != Condition.STALE:
            self._aged = age if is_old(age) else 0.0
        return age

    def _on_settings(self, message: NodeSettings) -> None:
        with contextlib.suppress(SloshBagError):  # a stranger's; ours can be read
            start = node_start(message, time.time_ns(), topics.SETTINGS)
            self._view.take_parameters(start.node, start.parameters)

    def _health(self) -> Health:
        found = self._servers.health()
        sentence = "; ".join(health.sentence for health in found)
        silence = self._view.silence(time.monotonic())
        if self.failure:
            return ERROR, self.failure
        if self._aged and silence <= TUNING.silence:
            way = "behind" if self._aged > 0.0 else "ahead of"
            return WARN, (
                f"stamps are {abs(self._aged):.3g} s {way} this machine's clock: values have bad "
                f"quality; synchronise the clocks, or set use_sim_time; {sentence}"
            )
        if silence > TUNING.silence:
            since = f"for {silence:.0f} s" if silence < 1e9 else "yet"
            sentence = f"no comparison {since}: all values have bad quality; {sentence}"
            return WARN, sentence
        return (OK if all(health.is_good for health in found) else WARN), sentence


def servers_of(given: Mapping[str, Any], cell: str) -> list[Server]:
    """Creates the servers that a node's parameters enable.

    Args:
        given: the parameters by name.
        cell: namespace of the cell without the first slash.

    Raises:
        SloshPlcError: a value or a file does not fit, or no server is asked for.
    """
    servers: list[Server] = []
    if given["opc_ua_port"]:
        own = None
        if bool(given["certificate"]) != bool(given["private_key"]):
            raise SloshPlcError("certificate and private_key must be given together")
        if given["certificate"]:
            paths = Path(given["certificate"]), Path(given["private_key"])
            own = read_server_certificate(*paths, datetime.now(UTC))
        folder = given["trusted_clients"]
        trusted = read_trusted(Path(folder)) if folder else ()
        servers.append(
            OpcUaServer(OpcUaSettings(cell, given["host"], given["opc_ua_port"], own, trusted))
        )
    if given["modbus_port"]:
        servers.append(ModbusServer(ModbusSettings(given["host"], given["modbus_port"])))
    if given["mqtt_broker"]:
        names = (
            "mqtt_broker", "mqtt_user", "mqtt_password_file", "mqtt_authority",
            "mqtt_certificate", "mqtt_private_key",
        )  # fmt: skip
        settings = read_settings(cell, *(given[name] for name in names))
        servers.append(MqttPublisher(settings))
        if given["sparkplug_group"]:
            session = int(time.time())
            servers.append(SparkplugNode(settings, given["sparkplug_group"], session))
    if not servers:
        raise SloshPlcError("opc_ua_port, modbus_port, mqtt_broker: set at least one of them")
    return servers


def main() -> int:
    """Runs the PLC node."""
    return run_node(PlcNode, finished=lambda node: bool(node.failure))


if __name__ == "__main__":
    sys.exit(main())
