"""Signs a validation report with a digest, and detects later changes.

A report file holds two digests. One is that of the signed content, whose JSON text every file
carries: it is shown on each page. The other one is the file's seal: the digest of all its bytes,
taken with zeros in the place of the digest itself.
"""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from typing import Any, Final

from slosh_fleet.validation.content import ValidationReport
from slosh_report.errors import SloshReportError
from slosh_report.json_values import plain

FORMAT: Final = "slosh validation report"
VERSION: Final = 1
_HEAD: Final = f'{{"format":"{FORMAT}"'
_SEAL: Final = re.compile(rb"slosh-seal sha256:([0-9a-f]{64})")
_NO_SEAL: Final = b"0" * 64


@dataclass(frozen=True, slots=True)
class SealCheck:
    """Result of checking a report file against its digest.

    Attributes:
        content: the signed content, as JSON has it; empty: it is unreadable.
        digest: SHA-256 that the content has now; empty: it is unreadable.
        failures: what was changed, one line each; empty: nothing.
    """

    content: dict[str, Any]
    digest: str
    failures: tuple[str, ...]


def content_of(report: ValidationReport) -> dict[str, Any]:
    """Converts a report's signed contents to JSON-compatible values in SI units."""
    document: dict[str, Any] = plain(report)
    return document


def content_digest(content: dict[str, Any]) -> str:
    """Returns the SHA-256 digest of the contents as canonical JSON text, in hexadecimal."""
    return hashlib.sha256(_canonical(content).encode()).hexdigest()


def envelope(content: dict[str, Any]) -> str:
    """Returns the JSON text embedded in a report file: the contents and their digest, in ASCII.

    It has no '<', which would end an element of a page.
    """
    head = {"format": FORMAT, "version": VERSION, "digest": content_digest(content)}
    text = json.dumps({**head, "content": content}, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c")


def seal_line() -> str:
    """Returns the placeholder line that a report file contains before it is sealed."""
    return f"slosh-seal sha256:{_NO_SEAL.decode()}"


def sealed(unsealed: bytes) -> bytes:
    """Returns the bytes of a report file with its seal, the digest of the file, filled in.

    Args:
        unsealed: the file, with the text of `seal_line` once.

    Raises:
        SloshReportError: the file has no place for a seal, or several.
    """
    places = list(_SEAL.finditer(unsealed))
    if len(places) != 1:
        raise SloshReportError(f"the report has {len(places)} places for a seal, expected one")
    return _with_seal(unsealed, places[0], _seal_of(unsealed, places[0]))


def check_seal(file: bytes, source: str) -> SealCheck:
    """Checks the seal and the contents of a report file.

    Args:
        file: its bytes.
        source: its name in error messages.

    Raises:
        SloshReportError: it is not a validation report, or of a later version.
    """
    document = _carried(file, source)
    places = list(_SEAL.finditer(file))
    failures = []
    if len(places) != 1:
        failures.append(f"the file has {len(places)} seals, expected one: it was changed")
    elif _seal_of(file, places[0]) != places[0][1]:
        failures.append("the file was changed since it was sealed")
    content = document.get("content")
    if not isinstance(content, dict):
        return SealCheck({}, "", (*failures, "the signed content was changed: it is unreadable"))
    digest = content_digest(content)
    if digest != document.get("digest"):
        failures.append("the signed content was changed: its SHA-256 is another one")
    return SealCheck(content, digest, tuple(failures))


def _carried(file: bytes, source: str) -> dict[str, Any]:
    """Returns the JSON document embedded in a report file; empty if it is unreadable."""
    text = file.decode("latin-1")
    start = text.find(_HEAD)
    if start < 0:
        raise SloshReportError(
            f"{source}: is not a validation report, or its content was removed; give a file "
            "written by slosh report --validation"
        )
    try:
        document = json.JSONDecoder().raw_decode(text, start)[0]
    except ValueError:
        return {}
    if document.get("version") != VERSION:
        raise SloshReportError(
            f"{source}: is of version {document.get('version')}, this slosh reads {VERSION}; "
            "check it with the slosh that wrote it, or a later one"
        )
    return dict(document)


def _canonical(content: dict[str, Any]) -> str:
    return json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)


def _seal_of(file: bytes, place: re.Match[bytes]) -> bytes:
    blank = _with_seal(file, place, _NO_SEAL)
    return hashlib.sha256(blank).hexdigest().encode()


def _with_seal(file: bytes, place: re.Match[bytes], seal: bytes) -> bytes:
    return file[: place.start(1)] + seal + file[place.end(1) :]
