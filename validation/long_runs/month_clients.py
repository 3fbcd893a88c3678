"""Clients of a cell's PLC node that record continuously whether its values are good."""

from __future__ import annotations

import asyncio
import contextlib
import json
import logging
import math
import threading
import time
from collections.abc import Callable, Coroutine, Iterator
from typing import Any, NamedTuple

from slosh_estimator.comparison import Condition
from slosh_plc.cell_state import SIGNALS, Quality
from slosh_plc.opc_ua import NAMESPACE, node_name
from slosh_plc.server import quiet
from slosh_plc.sparkplug import REBIRTH
from slosh_plc.sparkplug_payload import QUALITIES, flag_metric, message, payload

GOOD, BLIND, BAD, GONE = "good", "blind", "bad", "gone"
"""What a client sees: a good value, a good one that says that the liquid is not observed, a value
of bad quality, or no server."""
SERVED = (GOOD, BLIND)
"""What must not be seen of a cell that is lost."""
POLLING = ("OPC UA", "Modbus")
HEARING = ("MQTT", "Sparkplug")
"""Protocols of clients that look, and of those that a broker tells."""
GROUP = "plant"
"""Of the Sparkplug edge node."""
POLLED = 0.1  # s
AGAIN = 0.2  # s


class Seen(NamedTuple):
    """What a client observed, good or bad values or no server, at a time [s since 1970]."""

    at: float
    what: str


class Clients:
    """Clients of four protocols that run in a thread; use it as a context manager.

    Args:
        cell: name of the cell.
        opc_ua, modbus, mqtt: ports on this machine.

    Attributes:
        seen: by protocol; a broker tells of changes, the others look every 0.1 s.
        height: the newest estimated height [m]; NaN: unknown.
    """

    def __init__(self, cell: str, opc_ua: int, modbus: int, mqtt: int) -> None:
        self.seen: dict[str, list[Seen]] = {name: [] for name in (*POLLING, *HEARING)}
        self.height = math.nan
        self._cell = cell
        self._ports = opc_ua, modbus, mqtt
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, name="plc clients", daemon=True)
        self._ending = threading.Event()

    def __enter__(self) -> Clients:
        for library in ("asyncua", "pymodbus", "mqtt"):
            quiet(library)
        logging.getLogger("asyncio").setLevel(logging.CRITICAL)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ending.set()
        self._thread.join(20.0)

    def between(self, protocol: str, begin: float, end: float) -> Iterator[Seen]:
        """Yields the observations of a client between two times [s since 1970]."""
        return (one for one in list(self.seen[protocol]) if begin <= one.at <= end)

    def _note(self, protocol: str, what: str) -> None:
        self.seen[protocol].append(Seen(time.time(), what))

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._all())

    async def _all(self) -> None:
        follow = self._opc_ua, self._modbus, self._mqtt, self._sparkplug
        kinds = dict(zip(self.seen, follow, strict=True))
        tasks = [asyncio.create_task(self._repeat(*one)) for one in kinds.items()]
        while not self._ending.is_set():
            await asyncio.sleep(AGAIN)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _repeat(
        self, protocol: str, follow: Callable[[], Coroutine[Any, Any, None]]
    ) -> None:
        """Runs a client again and again; any exception counts as a lost server."""
        while True:
            with contextlib.suppress(Exception):
                await follow()
            self._note(protocol, GONE)
            await asyncio.sleep(AGAIN)

    async def _opc_ua(self) -> None:
        from asyncua import Client, ua

        url = f"opc.tcp://127.0.0.1:{self._ports[0]}/slosh"
        async with Client(url, timeout=2.0) as client:
            index = await client.get_namespace_index(NAMESPACE)
            state, height = (
                client.get_node(ua.NodeId(node_name(self._cell, name), index))
                for name in ("state", "estimated_height")
            )
            while True:
                value = await state.read_data_value(raise_on_bad_status=False)
                told = await height.read_data_value(raise_on_bad_status=False)
                known = isinstance(told.Value.Value, float) and told.StatusCode.is_good()
                self.height = told.Value.Value if known else math.nan
                is_seen = value.Value.Value not in (Condition.STALE, Condition.BLIND)
                good = GOOD if is_seen else BLIND
                self._note("OPC UA", good if value.StatusCode.is_good() else BAD)
                await asyncio.sleep(POLLED)

    async def _modbus(self) -> None:
        from pymodbus.client import AsyncModbusTcpClient

        address = next(signal.address for signal in SIGNALS if signal.name == "state") + 2
        client = AsyncModbusTcpClient("127.0.0.1", port=self._ports[1], timeout=1.0, retries=0)
        try:
            if not await client.connect():
                return
            while True:
                answer = await client.read_holding_registers(address, count=1)
                if answer.isError():
                    return
                self._note("Modbus", GOOD if answer.registers[0] == 0 else BAD)
                await asyncio.sleep(POLLED)
        finally:
            client.close()

    async def _mqtt(self) -> None:
        from aiomqtt import Client

        async with Client("127.0.0.1", self._ports[2], keepalive=2) as client:
            await client.subscribe(f"slosh/{self._cell}/state")
            async for message in client.messages:
                told = json.loads(message.payload)
                is_good = told["values"]["state"]["quality"] == "good"
                self._note("MQTT", GOOD if is_good else BAD)

    async def _sparkplug(self) -> None:
        from aiomqtt import Client

        kinds = ("NBIRTH", "NDATA", "NDEATH")
        own = next(alias for alias, one in enumerate(SIGNALS, 1) if one.name == "state")
        async with Client("127.0.0.1", self._ports[2], keepalive=2) as client:
            await client.subscribe([(f"spBv1.0/{GROUP}/{kind}/{self._cell}", 1) for kind in kinds])
            command = payload(0, [flag_metric(REBIRTH, True)])
            await client.publish(f"spBv1.0/{GROUP}/NCMD/{self._cell}", command)
            async for received in client.messages:
                if "/NDEATH/" in str(received.topic):
                    self._note("Sparkplug", GONE)
                    continue
                for metric in message("Payload").FromString(received.payload).metrics:
                    if metric.alias == own:
                        quality = metric.properties.values[0].int_value
                        is_good = quality == QUALITIES[Quality.GOOD]
                        self._note("Sparkplug", GOOD if is_good else BAD)
