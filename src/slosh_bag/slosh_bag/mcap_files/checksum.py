"""Facts with a checksum of their own: MCAP gives metadata records none."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

CHECKSUM = "crc32"


def with_checksum(facts: Mapping[str, str]) -> dict[str, str]:
    """The content of a metadata record: facts, and their checksum."""
    return {**facts, CHECKSUM: checksum_of(facts)}


def checksum_of(facts: Mapping[str, str]) -> str:
    """The checksum of facts, whatever their order."""
    return f"{zlib.crc32(json.dumps(dict(facts), sort_keys=True).encode()):08x}"
