"""Adds a checksum to bag metadata, since MCAP metadata records have none."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

CHECKSUM = "crc32"


def with_checksum(facts: Mapping[str, str]) -> dict[str, str]:
    """Returns the metadata entries together with their checksum."""
    return {**facts, CHECKSUM: checksum_of(facts)}


def checksum_of(facts: Mapping[str, str]) -> str:
    """Computes a checksum of metadata entries that does not depend on their order."""
    return f"{zlib.crc32(json.dumps(dict(facts), sort_keys=True).encode()):08x}"
