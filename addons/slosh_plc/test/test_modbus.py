"""A real Modbus client reads the cell, and can change nothing."""

import asyncio
import socket

import pytest

from slosh_plc.cell_state import REGISTERS, SIGNALS, Quality
from slosh_plc.errors import SloshPlcError
from slosh_plc.modbus import ModbusServer, ModbusSettings
from slosh_testing.plc import ServedCell, free_port, good_state

library = pytest.importorskip(
    "pymodbus.client", reason="pymodbus is not installed (requirements/plc.txt)"
)
Client = library.AsyncModbusTcpClient
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS = 1, 2


def ask(port, *questions):
    """Answers of the server to questions, each a function of the client."""

    async def session():
        client = Client("127.0.0.1", port=port, timeout=20)
        assert await client.connect()
        try:
            return [await question(client) for question in questions]
        finally:
            client.close()

    return asyncio.run(session())


@pytest.fixture
def served():
    cell, port = ServedCell(), free_port()
    with cell.serve(ModbusServer(ModbusSettings("127.0.0.1", port))):
        yield cell, port


def read_all(client):
    return client.read_input_registers(0, count=REGISTERS)


def values(answer):
    """Value and quality by name."""
    found = {}
    for signal in SIGNALS:
        words = answer.registers[signal.address : signal.address + 2]
        code = Client.DATATYPE.FLOAT32 if signal.unit != "1" else Client.DATATYPE.UINT32
        quality = Quality(answer.registers[signal.address + 2])
        found[signal.name] = (Client.convert_from_registers(words, code), quality)
    return found


def test_a_client_reads_values_and_qualities(served):
    cell, port = served
    cell.state = good_state(estimated_height=0.0125, measured_events=70_000, state=2)
    held, put = ask(port, lambda c: c.read_holding_registers(0, count=REGISTERS), read_all)
    assert held.registers == put.registers
    found = values(put)
    assert found["estimated_height"] == (pytest.approx(0.0125), Quality.GOOD)
    assert found["measured_events"] == (70_000, Quality.GOOD)
    assert found["state"] == (2, Quality.GOOD)


def test_the_first_request_after_a_loss_is_bad(served):
    cell, port = served
    cell.lose()
    (answer,) = ask(port, read_all)
    found = values(answer)
    assert {quality for _, quality in found.values()} == {Quality.BAD}
    assert (found["state"][0], found["blind"][0], found["calm"][0]) == (3, 1, 0)


@pytest.mark.parametrize(
    ("question", "code"),
    [
        (lambda c: c.write_register(12, 7), ILLEGAL_FUNCTION),
        (lambda c: c.write_registers(0, [0] * 8), ILLEGAL_FUNCTION),
        (lambda c: c.write_coil(0, True), ILLEGAL_FUNCTION),
        (lambda c: c.mask_write_register(address=0, and_mask=0, or_mask=7), ILLEGAL_FUNCTION),
        (lambda c: c.readwrite_registers(read_count=1, values=[1]), ILLEGAL_FUNCTION),
        (lambda c: c.read_coils(0), ILLEGAL_FUNCTION),
        (lambda c: c.read_input_registers(REGISTERS), ILLEGAL_ADDRESS),
        (lambda c: c.read_input_registers(REGISTERS - 1, count=2), ILLEGAL_ADDRESS),
    ],
)
def test_a_client_can_change_nothing(served, question, code):
    _, port = served
    before, refused, after = ask(port, read_all, question, read_all)
    assert refused.isError()
    assert refused.exception_code == code
    assert before.registers == after.registers


def test_a_part_of_the_registers_is_that_part(served):
    _, port = served
    whole, part = ask(port, read_all, lambda c: c.read_input_registers(10, count=5))
    assert part.registers == whole.registers[10:15]


def test_a_port_that_is_taken_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        server = ModbusServer(ModbusSettings("127.0.0.1", port))
        with (
            pytest.raises(SloshPlcError, match=f"modbus_port = {port} on 127.0.0.1: .*in use"),
            ServedCell().serve(server),
        ):
            pass


GARBAGE = (b"", b"\0" * 12, b"GET / HTTP/1.1\r\n\r\n", b"HELF\x08\0\0\0", bytes(range(256)) * 40)


def test_strangers_bytes_cost_no_client_anything(served, capfd):
    _, port = served
    for data in GARBAGE:
        with socket.create_connection(("127.0.0.1", port), 5.0) as stranger:
            stranger.sendall(data)
    (answer,) = ask(port, read_all)
    assert not answer.isError()
    assert capfd.readouterr().err == ""
