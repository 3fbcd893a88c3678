"""What flags and states mean, as the messages' own definitions say."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

from slosh_base.files.installed import shared_folder

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
    """All of them, message by message, in the order of their values; none without the messages."""
    share = shared_folder("slosh_msgs")
    if share is None:
        return ()
    folder = share / "msg"
    return tuple(
        Flag(found["name"], message, found["meaning"])
        for message in OWNERS
        for found in _CONSTANT.finditer((folder / f"{message}.msg").read_text(encoding="utf-8"))
    )
