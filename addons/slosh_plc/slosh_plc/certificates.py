"""Reads the certificates of an OPC UA server and of its trusted clients."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, fields
from datetime import datetime
from pathlib import Path
from typing import Any

from slosh_plc.errors import SloshPlcError
from slosh_plc.server import LOOPBACK, missing
from slosh_plc.tuning import TUNING

DAY = 86400.0  # s
ENDINGS = (".pem", ".der", ".crt")
UNSPECIFIED = ("0.0.0.0", "::")
"""All addresses of the machine; which name a client uses is not known."""
LARGEST = 64_000
"""Largest certificate or key file [bytes]."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """Content of a certificate file: name, validity, fingerprint and hosts.

    Attributes:
        path: PEM or DER file.
        name: common name of its subject; empty: it has none.
        uri: application URI, by which OPC UA programs know each other; empty: it has none.
        hosts: DNS names and IP addresses for which it holds, in lower case.
        begin, until: the times between which it is valid, with a time zone.
        der: the certificate itself.
    """

    path: Path
    name: str
    uri: str
    hosts: tuple[str, ...]
    begin: datetime
    until: datetime
    der: bytes = field(repr=False)

    @property
    def fingerprint(self) -> bytes:
        """SHA-256 fingerprint of the certificate."""
        return hashlib.sha256(self.der).digest()

    def days_left(self, now: datetime) -> float:
        """Returns the remaining validity of the certificate [day]; negative if it has expired."""
        return (self.until - now).total_seconds() / DAY

    def complaint(self, now: datetime) -> str:
        """Returns a warning if the certificate has expired, expires soon or is not valid yet."""
        rest = self.days_left(now)
        when = f"{self.until:%Y-%m-%d}"
        if self.begin > now:
            begin = f"{self.begin:%Y-%m-%d %H:%M}"
            return f"certificate {self.path} is valid from {begin} UTC on; check the clock"
        if rest <= 0.0:
            return f"certificate {self.path} expired on {when}; renew it"
        if rest <= TUNING.expiring:
            return f"certificate {self.path} expires on {when}; renew it"
        return ""


@dataclass(frozen=True, slots=True)
class ServerCertificate(Certificate):
    """A server's certificate, checked against its private key and the present time.

    Attributes:
        key_der: its private key, PKCS #8.
    """

    key_der: bytes = field(repr=False)

    def check_host(self, host: str) -> None:
        """Checks that the certificate is issued for the address on which the server listens.

        Raises:
            SloshPlcError: it does not, and clients would refuse it.
        """
        if host in LOOPBACK or host in UNSPECIFIED or host.lower() in self.hosts:
            return
        known = ", ".join(self.hosts) or "no host"
        raise SloshPlcError(
            f"certificate: {self.path} is for {known}, not for host = {host}: clients refuse it; "
            f"slosh certificates {self.path.parent} --create {host} --replace makes a new one"
        )


def read_certificate(name: str, path: Path) -> Certificate:
    """Reads a certificate; does not check its validity period.

    Args:
        name: of the parameter or option that gives the path.
        path: PEM or DER file.

    Raises:
        SloshPlcError: there is no such file, or it is no certificate.
    """
    from cryptography import x509
    from cryptography.hazmat.primitives.serialization import Encoding

    found = _load(name, path)
    names = found.subject.get_attributes_for_oid(x509.NameOID.COMMON_NAME)
    try:
        others = found.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (x509.ExtensionNotFound, ValueError):
        others = x509.SubjectAlternativeName([])
    uris = others.get_values_for_type(x509.UniformResourceIdentifier)
    hosts = [
        *others.get_values_for_type(x509.DNSName), *others.get_values_for_type(x509.IPAddress)
    ]  # fmt: skip
    return Certificate(
        path,
        str(names[0].value) if names else "",
        str(uris[0]) if uris else "",
        tuple(str(host).lower() for host in hosts),
        found.not_valid_before_utc,
        found.not_valid_after_utc,
        found.public_bytes(Encoding.DER),
    )


def read_server_certificate(path: Path, key: Path, now: datetime) -> ServerCertificate:
    """Reads the server's certificate and checks it against its key and the time.

    Args:
        path: PEM or DER file of the certificate.
        key: PEM or DER file of its private key, without a password.
        now: time at which it must be valid, with a time zone.

    Raises:
        SloshPlcError: a file is missing or unreadable, they do not belong together, the
            certificate has no application URI, or it is not valid now.
    """
    from cryptography.hazmat.primitives import serialization as form

    certificate = read_certificate("certificate", path)
    private = _read("private_key", key, _key_of)
    if private.public_key() != _load("certificate", path).public_key():
        raise SloshPlcError(f"private_key: {key} is not the key of {path}")
    if not certificate.uri:
        raise SloshPlcError(
            f"certificate: {path} has no application URI among its alternative names, "
            "which OPC UA clients check"
        )
    if certificate.begin > now or certificate.until <= now:
        raise SloshPlcError(certificate.complaint(now))
    secret = private.private_bytes(
        form.Encoding.DER, form.PrivateFormat.PKCS8, form.NoEncryption()
    )
    given = {one.name: getattr(certificate, one.name) for one in fields(certificate)}
    return ServerCertificate(**given, key_der=secret)


def read_trusted(folder: Path) -> tuple[Certificate, ...]:
    """Reads the certificates of trusted clients, sorted by file name.

    Raises:
        SloshPlcError: there is no such folder, a file in it is no certificate, or it has none.
    """
    if not folder.is_dir():
        raise SloshPlcError(f"trusted_clients: no such folder: {folder}")
    paths = sorted(path for path in folder.iterdir() if path.suffix.lower() in ENDINGS)
    if not paths:
        raise SloshPlcError(
            f"trusted_clients: {folder} has no certificate ({', '.join(ENDINGS)}): "
            "no client could connect"
        )
    return tuple(read_certificate("trusted_clients", path) for path in paths)


def fingerprint(certificate: Any) -> bytes:
    """Returns the SHA-256 fingerprint of an X.509 certificate."""
    from cryptography.hazmat.primitives.hashes import SHA256

    return bytes(certificate.fingerprint(SHA256()))


def _load(name: str, path: Path) -> Any:
    from cryptography import x509

    def parse(data: bytes) -> Any:
        load = x509.load_pem_x509_certificate if _is_pem(data) else x509.load_der_x509_certificate
        return load(data)

    return _read(name, path, parse)


def _key_of(data: bytes) -> Any:
    from cryptography.hazmat.primitives.serialization import (
        load_der_private_key,
        load_pem_private_key,
    )

    return (load_pem_private_key if _is_pem(data) else load_der_private_key)(data, None)


def _is_pem(data: bytes) -> bool:
    return data.lstrip().startswith(b"-----")


def _read(name: str, path: Path, parse: Callable[[bytes], Any]) -> Any:
    try:
        if not path.is_file():
            raise SloshPlcError(f"{name}: no such file: {path}")
        with path.open("rb") as file:
            return parse(file.read(LARGEST))
    except ModuleNotFoundError:
        raise missing("cryptography") from None
    except OSError as error:
        raise SloshPlcError(f"{name}: {path}: {error.strerror}") from None
    except (ValueError, TypeError) as error:
        if isinstance(error, SloshPlcError):
            raise
        what = "private key without a password" if name == "private_key" else "certificate"
        raise SloshPlcError(f"{name}: {path} is no {what} in PEM or DER") from None
