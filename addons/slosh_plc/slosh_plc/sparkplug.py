"""Publishes a cell's state as a Sparkplug B edge node, for SCADA programs that use MQTT.

NBIRTH tells all values with name, unit and alias, NDATA those that have changed, by alias; the
broker sends NDEATH, the last will, when this node has gone. All values of a lost cell are told as
STALE. The only command that is obeyed asks for another NBIRTH: nothing can be written.
"""

from __future__ import annotations

import asyncio
import re
from datetime import UTC, datetime
from typing import Any, Final

from slosh_plc.broker_client import BrokerClient, Message, MqttSettings, lost_state
from slosh_plc.cell_state import SIGNALS, CellState
from slosh_plc.errors import SloshPlcError
from slosh_plc.server import State
from slosh_plc.sparkplug_payload import (
    QUALITIES,
    STALE,
    Value,
    asks_for_birth,
    flag_metric,
    message,
    number_metric,
    payload,
    signal_metric,
)

NAMESPACE: Final = "spBv1.0"
REBIRTH: Final = "Node Control/Rebirth"
SESSION: Final = "bdSeq"
NAME = re.compile(r"[^+#/\x00-\x1f]{1,60}")
NUMBERS: Final = 256
"""Numbers of sessions and of messages begin at 0 again from here."""


class SparkplugNode(BrokerClient):
    """Sparkplug B edge node of a cell; reconnects when the connection to the broker is lost.

    Args:
        settings: of the broker.
        group: of the edge nodes; this one's name is the cell's, with dashes for slashes.
        session: number of its first session; another one in each start of the process.

    Raises:
        SloshPlcError: the group's name does not fit.
    """

    kind = "Sparkplug"

    def __init__(self, settings: MqttSettings, group: str, session: int) -> None:
        if not NAME.fullmatch(group):
            raise SloshPlcError(
                f"sparkplug_group = {group!r}: must be a name of at most 60 characters without "
                "+, # and /"
            )
        super().__init__(settings, f"{settings.cell}-sparkplug")
        self._group, self._node = group, settings.cell.replace("/", "-")
        self._session = session % NUMBERS
        self._seq = 0
        self._state = lost_state()
        self._told: dict[str, Value] = {}

    @property
    def where(self) -> str:
        """Group and name of the edge node, for log messages."""
        return f"edge node {self._group}/{self._node}"

    def topic(self, kind: str) -> str:
        """Returns the MQTT topic of a Sparkplug message type, such as NDATA."""
        return f"{NAMESPACE}/{self._group}/{kind}/{self._node}"

    async def start(self, state: State) -> None:
        """Starts to connect; an unreachable broker raises no error.

        Raises:
            SloshPlcError: aiomqtt or protobuf is not installed.
        """
        message("Payload")
        await super().start(state)

    def will(self) -> Message:
        """Returns the NDEATH message (not retained) as last will; begins a new session."""
        self._session = (self._session + 1) % NUMBERS
        self._told = {}
        return Message(self.topic("NDEATH"), self._death(), False)

    async def session(self, client: Any) -> None:
        """Publishes each new state; publishes NBIRTH again when a SCADA program requests it."""
        await client.subscribe(self.topic("NCMD"), qos=1)
        self._state = await self.newest()
        await self._bear(client)
        commands = asyncio.create_task(self._obey(client))
        try:
            while not commands.done():
                self._state = await self.newest()
                await self._publish_changes(client)
            commands.result()
        finally:
            commands.cancel()

    async def last_words(self, client: Any) -> None:
        """Publishes NDEATH before a disconnect, after which the broker sends no last will."""
        self._state = lost_state()
        if self._told:
            await self._publish_changes(client)
        await client.publish(self.topic("NDEATH"), self._death(), qos=1)

    def _death(self) -> bytes:
        return payload(_now(), [number_metric(SESSION, self._session)])

    async def _obey(self, client: Any) -> None:
        async for received in client.messages:
            if asks_for_birth(bytes(received.payload), REBIRTH):
                await self._bear(client)

    async def _bear(self, client: Any) -> None:
        """Publishes NBIRTH: all values with their names and aliases."""
        now = _now()
        self._seq, self._told = 0, values_of(self._state)
        metrics = [number_metric(SESSION, self._session), flag_metric(REBIRTH, False)]
        metrics += [
            signal_metric(signal, alias, self._told[signal.name], now, is_birth=True)
            for alias, signal in enumerate(SIGNALS, 1)
        ]
        await client.publish(self.topic("NBIRTH"), payload(now, metrics, self._seq))

    async def _publish_changes(self, client: Any) -> None:
        """Publishes NDATA: the values that have changed since they were last published."""
        now, values = _now(), values_of(self._state)
        metrics = [
            signal_metric(signal, alias, values[signal.name], now, is_birth=False)
            for alias, signal in enumerate(SIGNALS, 1)
            if not _same(values[signal.name], self._told[signal.name])
        ]
        if not metrics:
            return
        self._told, self._seq = values, (self._seq + 1) % NUMBERS
        await client.publish(self.topic("NDATA"), payload(now, metrics, self._seq))


def values_of(state: CellState) -> dict[str, Value]:
    """Returns a cell state's values by name; STALE if the cell's messages have stopped."""
    found = {}
    for name, (value, quality) in state.readings().items():
        known = QUALITIES[quality]
        is_stale = state.is_lost and known != max(QUALITIES.values())
        found[name] = Value(value, STALE if is_stale else known)
    return found


def _same(one: Value, other: Value) -> bool:
    both_unknown = one.value != one.value and other.value != other.value
    return one.quality == other.quality and (one.value == other.value or both_unknown)


def _now() -> int:
    return round(1000.0 * datetime.now(UTC).timestamp())
