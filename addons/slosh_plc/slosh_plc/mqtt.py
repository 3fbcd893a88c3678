"""Publishes a cell's state over MQTT, as one retained JSON document per cell.

The broker's last will is the same document with every value lost: whoever reads the topic later
never finds the last good state of a cell whose server has gone.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from slosh_plc.broker_client import PREFIX, BrokerClient, Message, MqttSettings, lost_state
from slosh_plc.cell_state import SIGNALS, CellState, Kind


def document(cell: str, state: CellState, now: datetime) -> str:
    """Returns a cell's state as JSON, with null for unknown values.

    Args:
        cell: namespace of the cell without the first slash.
        state: the state.
        now: time of the state.
    """
    readings = state.readings()
    values: dict[str, Mapping[str, Any]] = {}
    for signal in SIGNALS:
        value, quality = readings[signal.name]
        values[signal.name] = {
            "value": _plain(signal.kind, value), "quality": quality.name.lower(),
        } | ({"unit": signal.unit} if signal.unit != "1" else {}) | (
            {"name": signal.choices[int(value)]} if signal.choices else {}
        )  # fmt: skip
    told = {"cell": cell, "stamp": now.isoformat(timespec="milliseconds"), "values": values}
    return json.dumps(told, allow_nan=False)


class MqttPublisher(BrokerClient):
    """Publishes a cell's state to an MQTT broker as a retained JSON document."""

    kind = "MQTT"

    def __init__(self, settings: MqttSettings) -> None:
        super().__init__(settings, settings.cell)

    @property
    def topic(self) -> str:
        """MQTT topic of the cell's JSON document."""
        return f"{PREFIX}/{self.settings.cell}/state"

    @property
    def where(self) -> str:
        """MQTT topic of the cell's JSON document, for log messages."""
        return f"topic {self.topic}"

    def will(self) -> Message:
        """Returns the JSON document of a cell without valid values, as retained MQTT last will."""
        return Message(self.topic, self._document(lost_state()), True)

    async def session(self, client: Any) -> None:
        """Publishes each new state, without waiting for the broker's acknowledgement."""
        while True:
            data = self._document(await self.newest())
            await client.publish(self.topic, data, retain=True)

    async def last_words(self, client: Any) -> None:
        """Publishes the JSON document of a cell without valid values before a disconnect."""
        await client.publish(self.topic, self._document(lost_state()), qos=1, retain=True)

    def _document(self, state: CellState) -> bytes:
        return document(self.settings.cell, state, datetime.now(UTC)).encode()


def _plain(kind: Kind, value: float) -> bool | int | float | None:
    if not math.isfinite(value):
        return None
    return bool(value) if kind is Kind.FLAG else value if kind is Kind.NUMBER else int(value)
