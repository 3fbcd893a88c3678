"""Serves a cell's state over Modbus TCP, with the functions that every PLC supports.

Each value has four registers: two with a float32 or an unsigned integer, the high word first, one
with its quality (0 good, 1 uncertain, 2 bad), one spare. Functions 3 and 4 read the same
registers; each request is answered with the state of its own moment. Nothing can be written.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from slosh_plc.cell_state import REGISTERS, SIGNALS, CellState, Kind
from slosh_plc.errors import SloshPlcError
from slosh_plc.server import ServerHealth, State, check_port, missing, quiet

READING = (3, 4)
"""Modbus functions that are answered: read holding registers, read input registers."""


def registers(state: CellState) -> list[int]:
    """Returns the Modbus registers (REGISTERS,) of a cell's state, from address 0."""
    words: list[int] = []
    readings = state.readings()
    for signal in SIGNALS:
        value, quality = readings[signal.name]
        if signal.kind is Kind.NUMBER:
            packed = struct.pack(">f", value)
        else:
            packed = struct.pack(">I", 0 if value != value else int(value))
        words += [*struct.unpack(">HH", packed), int(quality), 0]
    return words


@dataclass(frozen=True, slots=True)
class ModbusSettings:
    """Address on which a Modbus TCP server listens."""

    host: str
    port: int


class ModbusServer:
    """Modbus TCP server of a cell's state; it answers to any unit identifier."""

    def __init__(self, settings: ModbusSettings) -> None:
        self._settings = settings
        self._server: Any = None

    async def start(self, state: State) -> None:
        """Starts to listen for Modbus clients.

        Raises:
            SloshPlcError: the port is taken, or pymodbus is not installed.
        """
        try:
            from pymodbus.constants import ExcCodes
            from pymodbus.server import ModbusTcpServer
            from pymodbus.simulator import DataType, SimData, SimDevice
        except ModuleNotFoundError:
            raise missing("pymodbus") from None

        async def answer(
            function: int, first: int, _address: int, _count: int, memory: list[int], news: Any
        ) -> Any:
            if function not in READING or news is not None:
                return ExcCodes.ILLEGAL_FUNCTION
            memory[-first : REGISTERS - first] = registers(state())
            return None

        quiet("pymodbus")
        check_port("modbus_port", self._settings.host, self._settings.port)
        block = SimData(0, count=REGISTERS, datatype=DataType.REGISTERS)
        device = SimDevice(0, [block], action=answer)
        address = (self._settings.host, self._settings.port)
        self._server = ModbusTcpServer(device, address=address)
        try:
            await self._server.serve_forever(background=True)
        except RuntimeError as error:
            raise SloshPlcError(f"modbus_port = {address[1]}: {error}") from None

    async def update(self, state: CellState) -> None:
        """Does nothing, because the server reads the present state at each request."""

    async def stop(self) -> None:
        """Closes the port and the connections of all clients."""
        await self._server.shutdown()

    def health(self) -> ServerHealth:
        """Returns the server's state and address."""
        address = f"{self._settings.host}:{self._settings.port}"
        return ServerHealth(True, f"Modbus TCP on {address}")
