"""Serves a cell's state over OPC UA: one object per cell, with units and status codes.

Nothing can be written, by nobody: variables are read-only, and no user is an administrator.
Without a certificate the server has no security and listens on this machine only. With one it
takes encrypted connections alone, and only those of the trusted clients where any are named.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

from slosh_base.files.plain_text import plain_line
from slosh_plc.cell_state import SIGNALS, CellState, Kind, Quality, Reading, Signal
from slosh_plc.certificates import Certificate, ServerCertificate, fingerprint
from slosh_plc.errors import SloshPlcError
from slosh_plc.server import LOOPBACK, ServerHealth, State, check_port, missing, quiet

NAMESPACE: Final = "urn:slosh:cell"
"""Namespace of the information model."""
TYPE: Final = "SloshCellType"
UNECE: Final = "http://www.opcfoundation.org/UA/units/un/cefact"
UNITS: Final = {"m": ("MTR", "metre", (0.0, 0.1)), "s": ("SEC", "second", (0.0, 60.0))}
"""Common code of the UN/CEFACT recommendation 20, name, and usual range for a display, by unit."""
PATH: Final = "slosh"
"""Path of the endpoint."""
LONGEST_NAME: Final = 80
"""Of a stranger in a sentence."""


def node_name(cell: str, signal: str) -> str:
    """Returns the OPC UA node's string identifier of a value, the same after each restart."""
    return f"{cell}.{signal}"


def unit_number(code: str) -> int:
    """Returns the OPC UA unit number of a UNECE common code (OPC 10000-8, 5.6.3)."""
    return int.from_bytes(code.encode("ascii"), "big")


@dataclass(frozen=True, slots=True)
class OpcUaSettings:
    """Settings of an OPC UA server: address, certificate and trusted clients.

    Attributes:
        cell: name of the cell's object, its namespace without the first slash.
        host, port: address on which the server listens.
        certificate: the server's; None: no security.
        trusted: certificates of the clients that are let in; empty: all clients.

    Raises:
        SloshPlcError: without a certificate it would be open to other machines, or the
            certificate is for another host.
    """

    cell: str
    host: str
    port: int
    certificate: ServerCertificate | None = None
    trusted: tuple[Certificate, ...] = ()

    def __post_init__(self) -> None:
        if self.certificate is None and self.host not in LOOPBACK:
            raise SloshPlcError(
                f"host = {self.host}: OPC UA for other machines needs certificate and private_key"
            )
        if self.certificate is None and self.trusted:
            raise SloshPlcError("trusted_clients: needs certificate and private_key")
        if self.certificate is not None:
            self.certificate.check_host(self.host)

    @property
    def url(self) -> str:
        """URL that OPC UA clients connect to."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"opc.tcp://{host}:{self.port}/{PATH}"


class OpcUaServer:
    """OPC UA server of a cell's state."""

    def __init__(self, settings: OpcUaSettings) -> None:
        self._settings = settings
        self._server: Any = None
        self._nodes: dict[str, Any] = {}
        self._clients = 0
        self._refused = Refused()

    async def start(self, state: State) -> None:
        """Creates the address space and starts to listen.

        Raises:
            SloshPlcError: the port is taken, or asyncua is not installed.
        """
        try:
            from asyncua import Server
        except ModuleNotFoundError:
            raise missing("asyncua") from None
        quiet("asyncua")
        check_port("opc_ua_port", self._settings.host, self._settings.port)
        server = Server(user_manager=_Readers())
        server.name = server.manufacturer_name = "slosh"
        server.set_endpoint(self._settings.url)
        await server.init()
        await _secure(server, self._settings, self._refused)
        self._nodes = await _make_model(server, self._settings.cell)
        self._server = server
        await self.update(state())
        try:
            await server.start()
        except OSError as error:
            raise SloshPlcError(f"opc_ua_port = {self._settings.port}: {error}") from None

    async def update(self, state: CellState) -> None:
        """Writes all values of the cell's state with their status codes."""
        now = datetime.now(UTC)
        readings = state.readings()
        for signal in SIGNALS:
            value = _data_value(signal, readings[signal.name], state.is_lost, now)
            await self._server.write_attribute_value(self._nodes[signal.name].nodeid, value)
        self._clients = len(self._server.bserver.clients) if self._server.bserver else 0

    async def stop(self) -> None:
        """Closes the port and the connections of all clients."""
        await self._server.stop()

    def health(self) -> ServerHealth:
        """Returns the server's address, number of clients, and warnings about certificates."""
        own = self._settings.certificate
        known = [*([own] if own else []), *self._settings.trusted]
        now = datetime.now(UTC)
        complaints = [text for text in (one.complaint(now) for one in known) if text]
        sentence = f"OPC UA on {self._settings.url}, {self._clients} clients"
        told = [sentence, *filter(None, [self._refused.sentence]), *complaints]
        return ServerHealth(not complaints, "; ".join(told))


class Refused:
    """Counts the clients that are refused because of their certificates, by reason.

    Attributes:
        sentence: how many, and why the last one; empty: none was.
    """

    def __init__(self) -> None:
        self._count = 0
        self.sentence = ""

    def add(self, certificate: Any, reason: str) -> None:
        """Counts one client that was refused for the given reason."""
        self._count += 1
        who = plain_line(certificate.subject.rfc4514_string())[:LONGEST_NAME]
        self.sentence = f"{self._count} clients refused, the last one, {who}: {reason}"


class _Readers:
    """Gives each client that the security policy accepts the right to read, never to write."""

    def get_user(self, *_: Any, **__: Any) -> Any:
        from asyncua.crypto.permission_rules import User, UserRole

        return User(role=UserRole.User)


async def _secure(server: Any, settings: OpcUaSettings, refused: Refused) -> None:
    """Sets the security policies of a server that is not started yet."""
    from asyncua import ua

    own = settings.certificate
    server.allow_remote_admin(False)
    server.set_identity_tokens([ua.AnonymousIdentityToken])
    if own is None:
        server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
        await server.set_application_uri(NAMESPACE)
        return
    server.set_security_policy(
        [
            ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
            ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
        ]
    )
    await server.load_certificate(own.der, "der")
    await server.load_private_key(own.key_der, format="der")
    await server.set_application_uri(own.uri)
    server.set_certificate_validator(_validator(settings.trusted, refused))


def _validator(trusted: Sequence[Certificate], refused: Refused) -> Any:
    """Returns asyncua's certificate check, which refuses clients that are not trusted."""
    from asyncua import ua
    from asyncua.common.utils import ServiceError
    from asyncua.crypto.validator import CertificateValidator

    basic = CertificateValidator()
    prints = {one.fingerprint for one in trusted}
    reasons = {
        ua.StatusCodes.BadCertificateTimeInvalid: "its certificate is not valid now",
        ua.StatusCodes.BadCertificateUriInvalid: "its certificate is of another application URI",
    }

    async def validate(certificate: Any, application: Any) -> None:
        if prints and fingerprint(certificate) not in prints:
            refused.add(certificate, "it is not among trusted_clients")
            raise ServiceError(ua.StatusCodes.BadCertificateUntrusted)
        try:
            await basic.validate(certificate, application)
        except ServiceError as error:
            refused.add(certificate, reasons.get(error.code, "its certificate is incomplete"))
            raise

    return validate


async def _make_model(server: Any, cell: str) -> dict[str, Any]:
    """Creates the object type and the cell's object; returns its variables by value name."""
    index = await server.register_namespace(NAMESPACE)
    kind = await server.nodes.base_object_type.add_object_type(_identifier(index, TYPE), TYPE)
    for signal in SIGNALS:
        variable = await _add_variable(kind, index, node_name(TYPE, signal.name), signal)
        await variable.set_modelling_rule(True)
    made = await _add_object(server, index, cell, kind)
    return {
        signal.name: await _add_variable(made, index, node_name(cell, signal.name), signal)
        for signal in SIGNALS
    }


async def _add_object(server: Any, index: int, name: str, kind: Any) -> Any:
    """Adds an object of a type, without the variables that the type defines.

    `add_object` would give those numbers as identifiers, other ones after each change of the
    model.
    """
    from asyncua import ua

    item = ua.AddNodesItem(
        ParentNodeId=server.nodes.objects.nodeid,
        ReferenceTypeId=ua.NodeId(ua.ObjectIds.Organizes),
        RequestedNewNodeId=_identifier(index, name),
        BrowseName=ua.QualifiedName(name, index),
        NodeClass=ua.NodeClass.Object,
        TypeDefinition=kind.nodeid,
        NodeAttributes=ua.ObjectAttributes(DisplayName=ua.LocalizedText(name)),
    )
    (added,) = await server.iserver.isession.add_nodes([item])
    added.StatusCode.check()
    return server.get_node(added.AddedNodeId)


def _identifier(index: int, name: str) -> Any:
    from asyncua import ua

    return ua.NodeId(name, index)


async def _add_variable(parent: Any, index: int, name: str, signal: Signal) -> Any:
    """Adds a read-only variable with its description, and its unit or choices."""
    from asyncua import ua

    lost = _data_value(signal, Reading(signal.lost, Quality.BAD), True, datetime.now(UTC)).Value
    variable = await parent.add_variable(
        _identifier(index, name),
        f"{index}:{signal.name}",
        lost.Value,
        lost.VariantType,
    )
    about = ua.DataValue(ua.Variant(ua.LocalizedText(signal.meaning)))
    await variable.write_attribute(ua.AttributeIds.Description, about)
    if signal.unit in UNITS:
        code, title, (low, high) = UNITS[signal.unit]
        unit = ua.EUInformation(
            UNECE, unit_number(code), ua.LocalizedText(signal.unit), ua.LocalizedText(title)
        )
        await variable.add_property(
            _identifier(index, f"{name}.EngineeringUnits"), "0:EngineeringUnits", unit
        )
        await variable.add_property(
            _identifier(index, f"{name}.EURange"), "0:EURange", ua.Range(low, high)
        )
    if signal.choices:
        texts = [ua.LocalizedText(text) for text in signal.choices]
        await variable.add_property(
            _identifier(index, f"{name}.EnumStrings"), "0:EnumStrings", texts
        )
    return variable


def _data_value(signal: Signal, reading: Reading, is_lost: bool, now: datetime) -> Any:
    """Returns a value as an OPC UA DataValue: typed value, status code and time."""
    from asyncua import ua

    types = {
        Kind.FLAG: (ua.VariantType.Boolean, bool),
        Kind.COUNT: (ua.VariantType.UInt32, int),
        Kind.CHOICE: (ua.VariantType.UInt32, int),
        Kind.NUMBER: (ua.VariantType.Double, float),
    }
    bad = ua.StatusCodes.BadNoCommunication if is_lost else ua.StatusCodes.Bad
    status = {
        Quality.GOOD: ua.StatusCodes.Good,
        Quality.UNCERTAIN: ua.StatusCodes.Uncertain,
        Quality.BAD: bad,
    }[reading.quality]
    variant, convert = types[signal.kind]
    value = reading.value if signal.kind is Kind.NUMBER or reading.value == reading.value else 0
    return ua.DataValue(
        ua.Variant(convert(value), variant), ua.StatusCode(status), SourceTimestamp=now
    )
