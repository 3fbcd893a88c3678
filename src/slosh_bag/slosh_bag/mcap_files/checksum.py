"""Adds a checksum to facts, since MCAP metadata records have none."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

CHECKSUM = "crc32"


def with_checksum(facts: Mapping[str, str]) -> dict[str, str]:
    """Returns the content of a metadata record: the facts and their checksum."""
    return {**facts, CHECKSUM: checksum_of(facts)}


def checksum_of(facts: Mapping[str, str]) -> str:
    """Computes the checksum of facts, independent of their order."""
    return f"{zlib.crc32(json.dumps(dict(facts), sort_keys=True).encode()):08x}"
