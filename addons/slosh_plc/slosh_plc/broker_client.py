"""Connection to an MQTT broker: settings, TLS, and a loop that reconnects."""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import re
import ssl
from abc import ABC, abstractmethod
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar, Final, NamedTuple

from slosh_plc.cell_state import SIGNALS, CellState, Quality, Reading
from slosh_plc.certificates import read_certificate
from slosh_plc.errors import SloshPlcError
from slosh_plc.server import ServerHealth, State, missing
from slosh_plc.tuning import TUNING

PREFIX: Final = "slosh"
PORT, TLS_PORT = 1883, 8883
LONGEST = 4096
"""Longest password file [bytes]."""
OF_SOURCES = re.compile(r" ?\(_ssl\.c:\d+\)|\[SSL: \w+\] ?", re.ASCII)
BROKER = re.compile(r"(?P<host>\[[0-9a-fA-F:]+\]|[\w.-]+)(:(?P<port>\d{1,5}))?", re.ASCII)


@dataclass(frozen=True, slots=True)
class MqttSettings:
    """Settings of the connection to an MQTT broker: address, user, TLS files.

    Attributes:
        cell: namespace of the cell without the first slash.
        host, port: address of the broker.
        user, password: of the publisher; empty: none.
        authority: PEM file of the authority that signed the broker's certificate; None: no TLS.
        identity: PEM files of the publisher's own certificate and key; None: the broker asks for
            none.
    """

    cell: str
    host: str
    port: int
    user: str = ""
    password: str = ""
    authority: Path | None = None
    identity: tuple[Path, Path] | None = None

    @property
    def address(self) -> str:
        """Address of the broker as text, host and port."""
        return f"{self.host}:{self.port}"


def read_settings(
    cell: str,
    broker: str,
    user: str = "",
    password_file: str = "",
    authority: str = "",
    certificate: str = "",
    private_key: str = "",
) -> MqttSettings:
    """Reads broker address, credentials and TLS files from a node's parameters.

    Args:
        cell: namespace of the cell without the first slash.
        broker: HOST or HOST:PORT.
        user: name of the publisher; empty: none.
        password_file: file whose first line is the password; empty: none.
        authority: PEM file of a certificate authority, for TLS; empty: no TLS.
        certificate, private_key: PEM files of the publisher's own certificate; empty: none.

    Raises:
        SloshPlcError: a value does not fit, or a file is missing or no such file.
    """
    found = BROKER.fullmatch(broker)
    port = int(found["port"] or (TLS_PORT if authority else PORT)) if found else 0
    if found is None or not 0 < port < 65536:
        raise SloshPlcError(f"mqtt_broker = {broker!r} must be HOST or HOST:PORT")
    if password_file and not user:
        raise SloshPlcError("mqtt_password_file: needs mqtt_user")
    password = ""
    if password_file:
        try:
            with Path(password_file).open(encoding="utf-8") as file:
                password = file.readline(LONGEST).rstrip("\r\n")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "is no text"
            raise SloshPlcError(f"mqtt_password_file: {password_file}: {reason}") from None
    if bool(certificate) != bool(private_key):
        raise SloshPlcError("mqtt_certificate and mqtt_private_key must be given together")
    if certificate and not authority:
        raise SloshPlcError("mqtt_certificate: needs mqtt_authority")
    identity = (Path(certificate), Path(private_key)) if certificate else None
    path = Path(authority) if authority else None
    if path is not None:
        _tls(path, identity)
    return MqttSettings(cell, found["host"].strip("[]"), port, user, password, path, identity)


class Message(NamedTuple):
    """A message for a broker: topic, payload, and whether the broker retains it."""

    topic: str
    data: bytes
    retain: bool


def lost_state() -> CellState:
    """Returns the state of a cell whose messages have stopped: all values have bad quality."""
    return CellState(
        True, **{signal.name: Reading(signal.lost, Quality.BAD) for signal in SIGNALS}
    )


class BrokerClient(ABC):
    """Publishes a cell's state to an MQTT broker, and reconnects when the connection is lost.

    Args:
        settings: of the broker.
        name: of this client at the broker, another one for each.
    """

    kind: ClassVar[str]
    """What is published, for a sentence."""

    def __init__(self, settings: MqttSettings, name: str) -> None:
        self.settings = settings
        self._name = f"{PREFIX}-{name.replace('/', '-')}"
        self._task: asyncio.Task[None] | None = None
        self._newest: asyncio.Queue[CellState] = asyncio.Queue(maxsize=1)
        self._connected = False
        self._problem = "not connected yet"

    @property
    @abstractmethod
    def where(self) -> str:
        """Name of the place to which the state is published, for log messages."""

    @abstractmethod
    def will(self) -> Message:
        """Returns the MQTT last will; called before each connection."""

    @abstractmethod
    async def session(self, client: Any) -> None:
        """Publishes each new state over a connection, until the connection is lost."""

    @abstractmethod
    async def last_words(self, client: Any) -> None:
        """Publishes values of bad quality before a disconnect, since no last will is sent then."""

    async def start(self, state: State) -> None:
        """Starts to connect; an unreachable broker raises no error.

        Raises:
            SloshPlcError: aiomqtt is not installed.
        """
        try:
            importlib.import_module("aiomqtt")
        except ModuleNotFoundError:
            raise missing("aiomqtt") from None
        self._task = asyncio.get_running_loop().create_task(self._run())

    async def update(self, state: CellState) -> None:
        """Stores the newest state for publication; replaces one that is not published yet."""
        if self._task is not None and self._task.done():
            self._task.result()  # an error that nobody foresaw ends the servers
        with contextlib.suppress(asyncio.QueueEmpty):
            self._newest.get_nowait()
        self._newest.put_nowait(state)

    async def newest(self) -> CellState:
        """Waits for a state that is not published yet, and returns it."""
        return await self._newest.get()

    async def stop(self) -> None:
        """Publishes that the cell's values are no longer valid, and disconnects."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task

    def health(self) -> ServerHealth:
        """Returns whether the broker is connected, or why it is not."""
        address = self.settings.address
        if self._connected:
            return ServerHealth(True, f"{self.kind} to {address}, {self.where}")
        return ServerHealth(
            False,
            f"MQTT broker {address} is not connected: {self._problem}; "
            f"trying every {TUNING.retry:g} s",
        )

    async def _run(self) -> None:
        from aiomqtt import MqttError

        own = self.settings
        while True:
            try:
                await self._connect()
            except (MqttError, OSError) as error:
                task = asyncio.current_task()
                if task is not None and task.cancelling():
                    # The broker went, or was too slow, while the last words were sent.
                    raise asyncio.CancelledError from error
                self._problem = reason_of(error)
                if "timed out" in self._problem and own.authority and own.identity is None:
                    # With TLS 1.3 a broker refuses a client only after the client's handshake.
                    self._problem += "; the broker may ask for mqtt_certificate"
            finally:
                self._connected = False
            await asyncio.sleep(TUNING.retry)

    async def _connect(self) -> None:
        """Connects to the broker, and publishes until the connection is lost."""
        from aiomqtt import Client, Will

        own, will = self.settings, self.will()
        client = Client(
            own.host, own.port, username=own.user or None, password=own.password or None,
            identifier=self._name,
            will=Will(will.topic, will.data, qos=1, retain=will.retain),
            keepalive=TUNING.keep_alive, timeout=TUNING.retry,
            tls_context=_tls(own.authority, own.identity) if own.authority else None,
        )  # fmt: skip
        async with client:
            self._connected = True
            try:
                await self.session(client)
            except asyncio.CancelledError:
                await self.last_words(client)
                raise


def reason_of(error: Exception) -> str:
    """Returns in one line why a broker cannot be reached, without OpenSSL's source references."""
    text = " ".join(str(error).split()) or type(error).__name__
    if "CERTIFICATE_VERIFY_FAILED" in text:
        text = "mqtt_authority: the broker's " + text[text.index("certificate verify failed") :]
    return OF_SOURCES.sub("", text)


def _tls(authority: Path, identity: tuple[Path, Path] | None) -> ssl.SSLContext:
    try:
        context = ssl.create_default_context(cafile=authority)
    except (OSError, ssl.SSLError) as error:
        reason = error.strerror if type(error) is FileNotFoundError else "is no certificate in PEM"
        raise SloshPlcError(f"mqtt_authority: {authority}: {reason}") from None
    if identity is None:
        return context
    own = read_certificate("mqtt_certificate", identity[0])
    if own.days_left(datetime.now(UTC)) <= 0.0:
        raise SloshPlcError(f"mqtt_certificate: {own.complaint(datetime.now(UTC))}")
    try:
        context.load_cert_chain(*identity, password=_no_password)
    except (OSError, ssl.SSLError, ValueError) as error:
        is_absent = type(error) is FileNotFoundError
        reason = "no such file" if is_absent else f"is not the key of {identity[0]} in PEM"
        raise SloshPlcError(f"mqtt_private_key: {identity[1]}: {reason}") from None
    return context


def _no_password() -> str:
    """Refuses a password-protected key, for which OpenSSL would prompt on the terminal."""
    raise ValueError("has a password")
