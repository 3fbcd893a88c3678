"""Facts with a checksum of their own: MCAP gives metadata records none."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping

SEAL = "crc32"


def sealed(facts: Mapping[str, str]) -> dict[str, str]:
    """The content of a metadata record: facts, and their checksum."""
    return {**facts, SEAL: seal_of(facts)}


def seal_of(facts: Mapping[str, str]) -> str:
    """The checksum of facts, whatever their order."""
    return f"{zlib.crc32(json.dumps(dict(facts), sort_keys=True).encode()):08x}"
