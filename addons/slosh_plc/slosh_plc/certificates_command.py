"""`slosh certificates`: creates and lists the certificates of an OPC UA server and its clients."""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from slosh_base.files.plain_text import plain_line
from slosh_bringup.errors import SloshBringupError
from slosh_plc.certificate_folder import CERTIFICATE, KEY, TRUSTED, certificates_in, create, trust
from slosh_plc.certificates import Certificate
from slosh_plc.tuning import TUNING
from slosh_report.text_table import aligned

EPILOG = f"""For slosh plc: certificate: FOLDER/{CERTIFICATE}, private_key: FOLDER/{KEY},
trusted_clients: FOLDER/{TRUSTED}. A client is given FOLDER/{CERTIFICATE}, and its own certificate
is trusted here; a file in FOLDER/{TRUSTED} that is deleted is trusted no more from the next start.
Needs: pip install -r requirements/plc.txt"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh certificates` to the argument parser."""
    parser.epilog = EPILOG
    parser.add_argument(
        "folder", type=Path, nargs="?", default=Path("certificates"), metavar="FOLDER",
        help="folder of the certificates (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--create", nargs="+", metavar="HOST",
        help="create the server's certificate and key for the names and addresses by which "
        "clients reach it",
    )  # fmt: skip
    parser.add_argument(
        "--days", type=float, default=TUNING.validity, metavar="N",
        help="with --create: time for which the certificate is valid [day] (default %(default)g)",
    )  # fmt: skip
    parser.add_argument(
        "--replace",
        action="store_true",
        help="with --create: replace an existing certificate and key",
    )
    parser.add_argument(
        "--trust", nargs="+", type=Path, default=[], metavar="FILE",
        help="certificates (PEM or DER) of clients to trust",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the certificates as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Creates or trusts certificates and prints all of them; returns 1 if one has expired."""
    if arguments.replace and not arguments.create:
        raise SloshBringupError("--replace: needs --create HOST")
    now = datetime.now(UTC)
    if arguments.create:
        hosts = list(dict.fromkeys(arguments.create))
        create(arguments.folder, hosts, arguments.days, now, replace=arguments.replace)
    for path in arguments.trust:
        trust(arguments.folder, path)
    found = certificates_in(arguments.folder)
    show = as_json if arguments.json else as_text
    print(show(found, now))
    return int(any(one.days_left(now) <= 0.0 for one in found))


def as_text(found: Sequence[Certificate], now: datetime) -> str:
    """Formats certificates as a table, followed by a line for each that needs attention."""
    rows = [("of", "name", "valid until", "days left", "hosts", "SHA-256", "file")]
    rows += [
        (
            _role(one), one.name or one.uri, f"{one.until:%Y-%m-%d}",
            f"{one.days_left(now):.0f}", " ".join(one.hosts), one.fingerprint.hex()[:16],
            str(one.path),
        )
        for one in found
    ]  # fmt: skip
    lines = aligned([tuple(map(plain_line, row)) for row in rows], "<<<><<<")
    return "\n".join([*lines, *filter(None, (one.complaint(now) for one in found))])


def as_json(found: Sequence[Certificate], now: datetime) -> str:
    """Formats certificates as a JSON list."""
    rows = [
        {
            "of": _role(one), "name": one.name, "uri": one.uri, "hosts": one.hosts,
            "begin": one.begin.isoformat(), "until": one.until.isoformat(),
            "sha256": one.fingerprint.hex(), "file": str(one.path),
            "complaint": one.complaint(now),
        }
        for one in found
    ]  # fmt: skip
    return json.dumps(rows, indent=1)


def _role(one: Certificate) -> str:
    return "server" if one.path.name == CERTIFICATE else "client"
