"""What flags and states mean, as the messages' own definitions say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ament_index_python.packages import get_package_share_directory

OWNERS: Mapping[str, str] = {
    "FreeSurface": "flag of a measurement",
    "SloshEstimate": "flag of an estimate",
    "SloshComparison": "state of the monitor",
}
"""Message -> what its constants are."""
_CONSTANT = re.compile(
    r"^uint\d+ (?:STATE_)?(?P<name>[A-Z_]+)=\d+ +# (?P<meaning>.+?)(?:; see .+)?$", re.M
)


class Flag(NamedTuple):
    """A flag or a state: its name, the message that has it, and what it says."""

    name: str
    message: str
    meaning: str

    @property
    def kind(self) -> str:
        """What it is."""
        return f"{OWNERS[self.message]} ({self.message})"


@cache
def flags() -> tuple[Flag, ...]:
    """All of them, message by message, in the order of their values."""
    folder = Path(get_package_share_directory("slosh_msgs")) / "msg"
    return tuple(
        Flag(found["name"], message, found["meaning"])
        for message in OWNERS
        for found in _CONSTANT.finditer((folder / f"{message}.msg").read_text(encoding="utf-8"))
    )
