"""Real OPC UA clients read the cell, with and without certificates, and can change nothing."""

import asyncio
import dataclasses
import socket
from datetime import UTC, datetime, timedelta

import pytest

from slosh_plc.cell_state import SIGNALS
from slosh_plc.certificate_folder import create, trust
from slosh_plc.certificates import read_server_certificate, read_trusted
from slosh_plc.errors import SloshPlcError
from slosh_plc.opc_ua import NAMESPACE, OpcUaServer, OpcUaSettings, node_name
from slosh_testing.plc import ServedCell, free_port, good_state

pytest.importorskip("asyncua", reason="asyncua is not installed (requirements/plc.txt)")

from asyncua import Client, ua
from asyncua.crypto import cert_gen
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256 as Policy
from cryptography import x509
from cryptography.hazmat.primitives.serialization import Encoding
from cryptography.x509.oid import ExtendedKeyUsageOID

CELL = "line_1"
NOW = datetime.now(UTC) + timedelta(hours=2)  # the run may be long


def settings(**given):
    return OpcUaSettings(CELL, "127.0.0.1", free_port(), **given)


@pytest.fixture(scope="module")
def served():
    cell, own = ServedCell(), settings()
    with cell.serve(OpcUaServer(own)):
        yield cell, own.url


def ask(url, *questions, login=None, timeout=20):
    """Answers to questions, each a coroutine function of a connected client."""

    async def session():
        client = Client(url, timeout=timeout)
        if login is not None:
            await login(client)
        async with client:
            return [await question(client) for question in questions]

    return asyncio.run(session())


async def index_of(client):
    return await client.get_namespace_index(NAMESPACE)


async def node_of(client, signal):
    return client.get_node(ua.NodeId(node_name(CELL, signal), await index_of(client)))


def told(signal):
    """A question for a value with its status."""

    async def question(client):
        node = await node_of(client, signal)
        return await node.read_data_value(raise_on_bad_status=False)

    return question


def until_told(signal, value):
    """A question that waits until a value is served."""

    async def question(client):
        while (await told(signal)(client)).Value.Value != value:
            await asyncio.sleep(0.01)

    return question


def test_a_client_finds_the_cell_its_units_and_its_choices(served):
    _, url = served

    async def look(client):
        index = await index_of(client)
        made = await client.nodes.objects.get_child(f"{index}:{CELL}")
        kind = client.get_node(await made.read_type_definition())
        children = await made.get_children(nodeclassmask=ua.NodeClass.Variable)
        names = [(await child.read_browse_name()).Name for child in children]
        height = await made.get_child(f"{index}:estimated_height")
        unit = await (await height.get_child("0:EngineeringUnits")).read_value()
        state = await made.get_child(f"{index}:state")
        choices = await (await state.get_child("0:EnumStrings")).read_value()
        about = (await height.read_description()).Text
        return (await kind.read_browse_name()).Name, names, unit, choices, about

    ((kind, names, unit, choices, about),) = ask(url, look)
    assert kind == "SloshCellType"
    assert names == [signal.name for signal in SIGNALS]
    assert (unit.DisplayName.Text, unit.UnitId) == ("m", 5067858)  # MTR of UN/CEFACT
    assert [text.Text for text in choices] == ["OK", "WARN", "ERROR", "STALE", "BLIND"]
    assert "model estimates" in about


async def browse(client):
    """All properties of each value of the cell, its data type, access and status."""
    made = await client.nodes.objects.get_child(f"{await index_of(client)}:{CELL}")
    found = {}
    for node in await made.get_children(nodeclassmask=ua.NodeClass.Variable):
        names = {
            (await part.read_browse_name()).Name: await part.read_value()
            for part in await node.get_properties()
        }
        access = [
            (await node.read_attribute(kind)).Value.Value
            for kind in (ua.AttributeIds.AccessLevel, ua.AttributeIds.UserAccessLevel)
        ]
        status = (await node.read_data_value(raise_on_bad_status=False)).StatusCode
        about = (await node.read_description()).Text
        kind = await node.read_data_type_as_variant_type()
        found[(await node.read_browse_name()).Name] = (names, access, status, about, kind)
    return found


def test_a_browser_finds_unit_range_quality_and_read_access_of_every_value(served):
    cell, url = served
    cell.state = good_state(state=2)
    _, found = ask(url, until_told("state", 2), browse)
    codes = {"m": b"MTR", "s": b"SEC"}  # UN/CEFACT recommendation 20
    assert list(found) == [signal.name for signal in SIGNALS]
    for signal in SIGNALS:
        names, access, status, about, kind = found[signal.name]
        assert access == [1, 1], signal.name  # CurrentRead alone
        assert (status.is_good(), about) == (True, signal.meaning)
        if signal.unit == "1":
            assert not {"EngineeringUnits", "EURange"} & names.keys()
            continue
        assert kind is ua.VariantType.Double
        unit, span = names["EngineeringUnits"], names["EURange"]
        assert unit.NamespaceUri == "http://www.opcfoundation.org/UA/units/un/cefact"
        assert unit.UnitId == int.from_bytes(codes[signal.unit], "big")
        assert 0.0 <= span.Low < span.High < 1e3
    cell.lose()
    _, found = ask(url, until_told("state", None), browse)
    assert {status.is_good() for _, _, status, _, _ in found.values()} == {False}


def test_a_subscription_is_told_of_values_and_of_the_loss(served):
    cell, url = served
    cell.state = good_state(estimated_height=0.0123, state=1)
    ask(url, until_told("estimated_height", 0.0123))

    async def follow(client):
        heard = asyncio.Queue()

        class Handler:
            def datachange_notification(self, node, value, data):
                heard.put_nowait(data.monitored_item.Value)

        subscription = await client.create_subscription(50, Handler())
        await subscription.subscribe_data_change(await node_of(client, "estimated_height"))
        found = []
        for _ in range(600):
            value = await asyncio.wait_for(heard.get(), 30)
            found.append((value.Value.Value, value.StatusCode.value))
            if found[-1][1] != ua.StatusCodes.Good:
                return found
            cell.lose()
        return found

    (found,) = ask(url, follow)
    assert (0.0123, ua.StatusCodes.Good) in found
    assert found[-1][1] == ua.StatusCodes.BadNoCommunication
    state, blind = ask(url, told("state"), told("blind"))
    assert state.StatusCode.value == blind.StatusCode.value == ua.StatusCodes.BadNoCommunication
    assert (state.Value.Value, blind.Value.Value) == (None, None)  # with a bad status none is sent


def write(client_value, signal="calm"):
    async def question(client):
        node = await node_of(client, signal)
        await node.write_value(client_value, ua.VariantType.Boolean)

    return question


async def add_node(client):
    await client.nodes.objects.add_variable(ua.NodeId("mine", 2), "2:mine", 1.0)


async def delete_node(client):
    await client.delete_nodes([await node_of(client, "calm")])


@pytest.mark.parametrize("question", [write(True), add_node, delete_node])
@pytest.mark.parametrize("user", ["", "admin"])
def test_nobody_can_change_anything(served, question, user):
    cell, url = served
    cell.state = good_state(calm=False)
    ask(url, until_told("calm", False))

    async def login(client):
        if user:
            client.set_user(user)

    with pytest.raises(ua.UaError):
        ask(url, question, login=login)
    (value,) = ask(url, told("calm"))
    assert value.Value.Value is False


def certificate(folder, name, days=10, uri=True):
    """Files of a certificate and its key, made by asyncua's own generator."""
    folder.mkdir(exist_ok=True)
    path, key_path = folder / f"{name}.der", folder / f"{name}.key.pem"
    key = cert_gen.generate_private_key()
    names = [x509.DNSName("localhost")]
    if uri:
        names.append(x509.UniformResourceIdentifier(f"urn:{name}"))
    usage = [ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH]
    made = cert_gen.generate_self_signed_app_certificate(key, name, {}, names, usage, days=days)
    path.write_bytes(made.public_bytes(Encoding.DER))
    key_path.write_bytes(cert_gen.dump_private_key_as_pem(key))
    return path, key_path


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Certificates of the server, of a client that it trusts, and of a stranger."""
    folder = tmp_path_factory.mktemp("certificates")
    (folder / "trusted").mkdir()
    return {
        "folder": folder, "server": certificate(folder, "server"),
        "friend": certificate(folder / "trusted", "friend"),
        "stranger": certificate(folder, "stranger"),
    }  # fmt: skip


@pytest.fixture(scope="module")
def secured(files):
    (files["folder"] / "trusted" / "friend.key.pem").rename(files["folder"] / "friend.key.pem")
    files["friend"] = (files["friend"][0], files["folder"] / "friend.key.pem")
    own = settings(
        certificate=read_server_certificate(*files["server"], NOW),
        trusted=read_trusted(files["folder"] / "trusted"),
    )
    cell = ServedCell()
    server = OpcUaServer(own)
    with cell.serve(server):
        yield own.url, server


def as_client(files, name, mode=ua.MessageSecurityMode.SignAndEncrypt, uri=None):
    async def login(client):
        client.application_uri = uri or f"urn:{name}"
        path, key = files[name]
        server = files["server"][0]
        await client.set_security(Policy, path, key, server_certificate=server, mode=mode)

    return login


def test_a_trusted_client_reads_and_still_cannot_write(secured, files):
    url, _ = secured
    login = as_client(files, "friend")
    (value,) = ask(url, told("calm"), login=login)
    assert value.Value.Value is True
    for question in (write(False), add_node, delete_node):
        with pytest.raises(ua.UaError):
            ask(url, question, login=login)


def test_clients_without_trust_are_refused_and_counted(secured, files):
    url, server = secured
    was_good = server.health().is_good
    with pytest.raises(ua.UaError):
        ask(url, told("calm"), login=as_client(files, "stranger"))
    assert "CN=stranger: it is not among trusted_clients" in server.health().sentence
    with pytest.raises(ua.UaError):
        ask(url, told("calm"), login=as_client(files, "friend", uri="urn:another"))
    assert "of another application URI" in server.health().sentence
    assert server.health().is_good == was_good  # whoever knocks does not make the cell unhealthy
    with pytest.raises((ua.UaError, OSError)):
        ask(url, told("calm"))  # no certificate at all
    signed = as_client(files, "friend", ua.MessageSecurityMode.Sign)
    with pytest.raises((ua.UaError, OSError)):  # signed only, and readable by all
        ask(url, told("calm"), login=signed, timeout=4)  # it waits for an answer


def test_an_expired_client_is_refused_although_it_is_trusted(files, tmp_path):
    late = create(tmp_path / "late", ["late"], 1e-6, datetime.now(UTC) - timedelta(minutes=1))
    trust(tmp_path, late.path)
    own = settings(
        certificate=read_server_certificate(*files["server"], NOW),
        trusted=read_trusted(tmp_path / "trusted"),
    )
    server = OpcUaServer(own)
    key = late.path.with_name("server.key.pem")
    login = as_client({**files, "late": (late.path, key)}, "late", uri=late.uri)
    with ServedCell().serve(server):
        with pytest.raises(ua.UaError):
            ask(own.url, told("calm"), login=login)
        assert "CN=slosh late: its certificate is not valid now" in server.health().sentence
        assert f"{own.trusted[0].path} expired on" in server.health().sentence
        assert not server.health().is_good


def test_certificates_of_the_command_serve_a_client_that_it_trusts(files, tmp_path):
    made = create(tmp_path, ["localhost", "127.0.0.1"], 30.0, datetime.now(UTC))
    trust(tmp_path, files["friend"][0])
    trust(tmp_path, files["friend"][0])  # a second time is no other one
    trusted = read_trusted(tmp_path / "trusted")
    assert [one.uri for one in trusted] == ["urn:friend"]
    key = tmp_path / "server.key.pem"
    assert key.stat().st_mode & 0o077 == 0
    own = settings(certificate=read_server_certificate(made.path, key, NOW), trusted=trusted)
    with ServedCell().serve(OpcUaServer(own)):
        known = {**files, "server": (made.path, key)}
        (value,) = ask(own.url, told("calm"), login=as_client(known, "friend"))
        assert value.Value.Value is True
        with pytest.raises(ua.UaError):
            ask(own.url, told("calm"), login=as_client(known, "stranger"))


@pytest.mark.parametrize(
    ("host", "fits"),
    [("cell-1.local", True), ("CELL-1.local", True), ("10.0.0.5", True), ("::7", True),
     ("0.0.0.0", True), ("localhost", True), ("10.0.0.6", False), ("cell-1", False)],
)  # fmt: skip
def test_a_certificate_for_another_host_is_named(named, host, fits):
    if fits:
        OpcUaSettings(CELL, host, 4840, named)
        return
    with pytest.raises(SloshPlcError, match=f"is for cell-1.local, 10.0.0.5, ::7, not .*{host}"):
        OpcUaSettings(CELL, host, 4840, named)


@pytest.fixture(scope="module")
def named(tmp_path_factory):
    """A server's certificate for three hosts."""
    folder = tmp_path_factory.mktemp("named")
    made = create(folder, ["Cell-1.local", "10.0.0.5", "::7"], 30.0, datetime.now(UTC))
    return read_server_certificate(made.path, folder / "server.key.pem", NOW)


def test_a_certificate_that_ends_is_told(files):
    own = read_server_certificate(*files["server"], NOW)
    assert "expires on" in own.complaint(NOW)
    assert "expired on" in own.complaint(NOW + timedelta(days=11))
    assert "is valid from" in own.complaint(NOW - timedelta(days=300))
    assert dataclasses.replace(own, until=NOW + timedelta(days=100)).complaint(NOW) == ""


def test_certificates_that_do_not_fit_are_refused_by_name(files, tmp_path):
    path, key = files["server"]
    text = tmp_path / "text.pem"
    text.write_text("no certificate")
    other = files["stranger"][1]
    nameless = certificate(tmp_path, "nameless", uri=False)
    cases = [
        ((tmp_path / "absent.der", key), NOW, "certificate: no such file: .*absent.der"),
        ((path, tmp_path / "absent.pem"), NOW, "private_key: no such file: .*absent.pem"),
        ((text, key), NOW, "certificate: .*text.pem is no certificate"),
        ((path, text), NOW, "private_key: .*text.pem is no private key"),
        ((path, other), NOW, "is not the key of"),
        ((path, key), NOW + timedelta(days=11), "expired on .*; renew it"),
        ((path, key), NOW - timedelta(days=1), "is valid from .* check the clock"),
        (nameless, NOW + timedelta(hours=1), "has no application URI"),
    ]
    for given, now, reason in cases:
        with pytest.raises(SloshPlcError, match=reason) as caught:
            read_server_certificate(*given, now)
        assert "\n" not in str(caught.value)


def test_a_folder_without_clients_is_refused(tmp_path):
    with pytest.raises(SloshPlcError, match="no such folder"):
        read_trusted(tmp_path / "absent")
    with pytest.raises(SloshPlcError, match="has no certificate"):
        read_trusted(tmp_path)
    (tmp_path / "a.pem").write_text("no certificate")
    with pytest.raises(SloshPlcError, match=r"a\.pem is no certificate"):
        read_trusted(tmp_path)


def test_other_machines_need_a_certificate():
    with pytest.raises(SloshPlcError, match=r"host = 0.0.0.0: .* needs certificate"):
        OpcUaSettings(CELL, "0.0.0.0", 4840)


def test_a_port_that_is_taken_is_named():
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        own = OpcUaSettings(CELL, "127.0.0.1", other.getsockname()[1])
        with (
            pytest.raises(SloshPlcError, match=f"opc_ua_port = {own.port} on .*in use"),
            ServedCell().serve(OpcUaServer(own)),
        ):
            pass


GARBAGE = (b"", b"\0" * 12, b"GET / HTTP/1.1\r\n\r\n", b"HELF\x08\0\0\0", bytes(range(256)) * 40)


def test_strangers_bytes_cost_no_client_anything(served, capfd):
    _, url = served
    port = int(url.rpartition(":")[2].partition("/")[0])
    for data in GARBAGE:
        with socket.create_connection(("127.0.0.1", port), 5.0) as stranger:
            stranger.sendall(data)
    (value,) = ask(url, told("heartbeat"))
    assert value.StatusCode is not None
    assert capfd.readouterr().err == ""
