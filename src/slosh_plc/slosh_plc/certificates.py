"""Reads the certificates of an OPC UA server and of the clients that it trusts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from slosh_plc.errors import SloshPlcError
from slosh_plc.server import missing
from slosh_plc.tuning import TUNING

DAY = 86400.0  # s
ENDINGS = (".pem", ".der", ".crt")
LARGEST = 64_000
"""Largest certificate or key file [bytes]."""


@dataclass(frozen=True, slots=True)
class ServerCertificate:
    """A server's certificate, checked against its key and the time.

    Attributes:
        path, key: PEM or DER files of the certificate and of its private key.
        uri: application URI in the certificate, by which clients know the server.
        until: the time at which it expires.
    """

    path: Path
    key: Path
    uri: str
    until: datetime

    def complaint(self, now: datetime) -> str:
        """Returns a sentence if the certificate expires soon or has expired; else empty."""
        rest = (self.until - now).total_seconds() / DAY
        if rest > TUNING.expiring:
            return ""
        when = f"{self.until:%Y-%m-%d}"
        if rest <= 0.0:
            return f"certificate {self.path} expired on {when}: clients refuse it; renew it"
        return f"certificate {self.path} expires on {when}: renew it"


def read_server_certificate(path: Path, key: Path, now: datetime) -> ServerCertificate:
    """Reads and checks the server's certificate.

    Args:
        path: PEM or DER file of the certificate.
        key: PEM or DER file of its private key, without a password.
        now: time at which it must be valid, with a time zone.

    Raises:
        SloshPlcError: a file is missing or unreadable, they do not belong together, the
            certificate has no application URI, or it is not valid now.
    """
    certificate = _load("certificate", path)
    private = _read("private_key", key, _key_of)
    if private.public_key() != certificate.public_key():
        raise SloshPlcError(f"private_key: {key} is not the key of {path}")
    found = ServerCertificate(path, key, _uri(certificate, path), certificate.not_valid_after_utc)
    if certificate.not_valid_before_utc > now:
        begin = f"{certificate.not_valid_before_utc:%Y-%m-%d %H:%M}"
        raise SloshPlcError(f"certificate: {path} is valid from {begin} UTC on; check the clock")
    if found.until <= now:
        raise SloshPlcError(f"certificate: {path} expired on {found.until:%Y-%m-%d}; renew it")
    return found


def read_trusted(folder: Path) -> frozenset[bytes]:
    """Reads the certificates of trusted clients; returns their SHA-256 fingerprints.

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
    return frozenset(fingerprint(_load("trusted_clients", path)) for path in paths)


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


def _uri(certificate: Any, path: Path) -> str:
    from cryptography import x509

    try:
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except x509.ExtensionNotFound:
        names = None
    found = names.get_values_for_type(x509.UniformResourceIdentifier) if names else []
    if not found:
        raise SloshPlcError(
            f"certificate: {path} has no application URI among its alternative names, "
            "which OPC UA clients check"
        )
    return str(found[0])
