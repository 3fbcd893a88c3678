"""Creates an OPC UA server's certificate and key, and the folder of trusted client certificates.

FOLDER/server.pem and FOLDER/server.key.pem are the server's; FOLDER/trusted has one file for each
client. Nothing is replaced unless asked for.
"""

from __future__ import annotations

import ipaddress
import os
import re
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path
from typing import Any, Final

from slosh_base.files import NewFile, write_bytes
from slosh_plc.certificates import ENDINGS, Certificate, read_certificate
from slosh_plc.errors import SloshPlcError
from slosh_plc.server import missing
from slosh_plc.tuning import TUNING

CERTIFICATE: Final = "server.pem"
KEY: Final = "server.key.pem"
TRUSTED: Final = "trusted"
HOST = re.compile(r"(?!-)[a-z0-9-]{1,63}(\.[a-z0-9-]{1,63})*", re.ASCII | re.IGNORECASE)
KEY_SIZE = 2048
"""Of RSA [bit]; the security policies take 2048 to 4096."""


def create(
    folder: Path, hosts: Sequence[str], days: float, now: datetime, *, replace: bool = False
) -> Certificate:
    """Creates a self-signed server certificate and its private key.

    Args:
        folder: for both files; made where it is missing.
        hosts: DNS names and IP addresses by which clients reach the server.
        days: for which it is valid [day].
        now: begin of its validity, with a time zone; clocks that are a day late accept it too.
        replace: whether files that are there are replaced.

    Raises:
        SloshPlcError: a host is none, the time is none, the files are there, or the library
            `cryptography` is missing.
        OSError: a file cannot be written.
    """
    if not 0.0 < days <= TUNING.longest_validity:
        raise SloshPlcError(f"--days {days:g}: must be between 0 and {TUNING.longest_validity:g}")
    path, key_path = folder / CERTIFICATE, folder / KEY
    there = [one for one in (path, key_path) if one.exists()]
    if there and not replace:
        raise SloshPlcError(
            f"{there[0]}: exists; --replace makes a new one, which all clients must trust anew"
        )
    certificate, key = _made(hosts, now - timedelta(days=1), now + timedelta(days=days))
    folder.mkdir(parents=True, exist_ok=True)
    (folder / TRUSTED).mkdir(exist_ok=True)
    before = os.umask(0o077)  # the key is for nobody else
    try:
        secret = NewFile(key_path)
    finally:
        os.umask(before)
    # Both are written before either is replaced: they belong together.
    with secret, NewFile(path) as public:
        for new, content in ((secret, key), (public, certificate)):
            with new.open() as stream:
                stream.write(content)
    return read_certificate("certificate", path)


def trust(folder: Path, path: Path) -> Certificate:
    """Adds a client's certificate to the trusted certificates, unless it is already trusted.

    Args:
        folder: of the server's certificate.
        path: PEM or DER file of the client's.

    Raises:
        SloshPlcError: there is no such file, it is no certificate, or it has no application URI.
        OSError: it cannot be written.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding

    found = read_certificate("--trust", path)
    if not found.uri:
        raise SloshPlcError(f"--trust: {path} has no application URI: OPC UA would refuse it")
    (folder / TRUSTED).mkdir(parents=True, exist_ok=True)
    label = re.sub(r"[^A-Za-z0-9.-]+", "_", found.name or found.uri)[:40].strip("._")
    own = folder / TRUSTED / f"{label or 'client'}-{found.fingerprint.hex()[:12]}.pem"
    if not own.exists():
        text = x509.load_der_x509_certificate(found.der).public_bytes(Encoding.PEM)
        write_bytes(own, text)
    return read_certificate("--trust", own)


def certificates_in(folder: Path) -> list[Certificate]:
    """Returns the server's certificate, if it exists, and the trusted clients' certificates.

    Raises:
        SloshPlcError: there is no such folder, or a file is no certificate.
    """
    if not folder.is_dir():
        raise SloshPlcError(f"{folder}: no such folder; --create HOST makes it")
    own = folder / CERTIFICATE
    others = sorted((folder / TRUSTED).glob("*"))
    paths = [own] if own.exists() else []
    paths += [path for path in others if path.suffix.lower() in ENDINGS]
    return [read_certificate("certificate", path) for path in paths]


def _made(hosts: Sequence[str], begin: datetime, until: datetime) -> tuple[bytes, bytes]:
    """Returns a new certificate and its private key, PEM-encoded."""
    try:
        from cryptography import x509
        from cryptography.hazmat.primitives import hashes
        from cryptography.hazmat.primitives import serialization as form
        from cryptography.hazmat.primitives.asymmetric import rsa
    except ModuleNotFoundError:
        raise missing("cryptography") from None
    names: list[Any] = [_general_name(host) for host in hosts]
    key = rsa.generate_private_key(public_exponent=65537, key_size=KEY_SIZE)
    subject = x509.Name([x509.NameAttribute(x509.NameOID.COMMON_NAME, f"slosh {hosts[0]}"[:64])])
    use = x509.KeyUsage(
        digital_signature=True, content_commitment=True, key_encipherment=True,
        data_encipherment=True, key_cert_sign=True, key_agreement=False, crl_sign=False,
        encipher_only=False, decipher_only=False,
    )  # fmt: skip
    extended = [x509.ExtendedKeyUsageOID.SERVER_AUTH, x509.ExtendedKeyUsageOID.CLIENT_AUTH]
    uri = x509.UniformResourceIdentifier(f"urn:{hosts[0]}:slosh")
    public = key.public_key()
    certificate = (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(subject)
        .public_key(public)
        .serial_number(x509.random_serial_number())
        .not_valid_before(begin)
        .not_valid_after(until)
        .add_extension(x509.SubjectAlternativeName([uri, *names]), critical=False)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(use, critical=True)
        .add_extension(x509.ExtendedKeyUsage(extended), critical=False)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(public), critical=False)
        .sign(key, hashes.SHA256())
    )
    secret = key.private_bytes(form.Encoding.PEM, form.PrivateFormat.PKCS8, form.NoEncryption())
    return certificate.public_bytes(form.Encoding.PEM), secret


def _general_name(host: str) -> Any:
    from cryptography import x509

    try:
        return x509.IPAddress(ipaddress.ip_address(host))
    except ValueError:
        if not HOST.fullmatch(host) or len(host) > 253:
            raise SloshPlcError(
                f"--create {host!r}: must be a host's name, such as cell-1.local, or its address"
            ) from None
    return x509.DNSName(host.lower())
