"""What flags, states and fields mean, as the messages' own definitions say."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from slosh_base.files.installed import shared_folder

OWNERS: Mapping[str, str] = {
    "FreeSurface": "flag of a measurement",
    "SloshEstimate": "flag of an estimate",
    "SloshComparison": "state of the monitor",
}
"""Message -> what its constants are."""
_CONSTANT = re.compile(
    r"^uint\d+ (?:STATE_)?(?P<name>[A-Z_]+)=(?P<value>\d+)(?: +# (?P<meaning>.+?)(?:; see .+)?)?$",
    re.M,
)
_FIELD = re.compile(r"^[\w/]+(?:\[[<=\d]*\])? (?P<name>[a-z]\w*)(?: *# *(?P<meaning>.+))?$")
_NUMBER = re.compile(r"0x[0-9a-f]+|\d+", re.I)


class Flag(NamedTuple):
    """A flag or a state: its name, the message that has it, what it says, and its value."""

    name: str
    message: str
    meaning: str
    value: int

    @property
    def kind(self) -> str:
        """What it is."""
        return f"{OWNERS[self.message]} ({self.message})"

    @property
    def is_state(self) -> bool:
        """Whether it is one of several states, and no bit of a sum."""
        return self.message == "SloshComparison"


@cache
def flags() -> tuple[Flag, ...]:
    """All of them, message by message, in the order of their values; none without the messages."""
    share = shared_folder("slosh_msgs")
    if share is None:
        return ()
    folder = share / "msg"
    return tuple(
        Flag(found["name"], message, found["meaning"] or "all is well", int(found["value"]))
        for message in OWNERS
        for found in _CONSTANT.finditer((folder / f"{message}.msg").read_text(encoding="utf-8"))
        if not found["name"].startswith("PEAK_")
    )


def by_number(text: str) -> list[str]:
    """What a number such as 3, 0x3 or 0x0003 means in each message, a line each; none: no number.

    Flags are bits: their sum is split.
    """
    if not _NUMBER.fullmatch(text):
        return []
    number = int(text, 16) if text.lower().startswith("0x") else int(text)
    lines = []
    for message, kind in OWNERS.items():
        own = [flag for flag in flags() if flag.message == message]
        met = [one for one in own if (one.value == number if one.is_state else one.value & number)]
        rest = 0 if met and met[0].is_state else number & ~sum(one.value for one in met)
        lines.append(f"{number} (0x{number:x}) as {kind} ({message}):")
        lines += [f"  {one.name} ({one.value}): {one.meaning}" for one in met]
        if rest or not met:
            lines.append("  no flag is set" if not number else f"  0x{rest or number:x}: unknown")
    return lines


@cache
def fields() -> Mapping[str, tuple[str, ...]]:
    """What each field of the product's messages is, by its name; columns of slosh export."""
    share = shared_folder("slosh_msgs")
    found: dict[str, tuple[str, ...]] = {}
    for path in sorted(share.glob("msg/*.msg")) if share else ():
        for name, meaning in _fields(path):
            found[name] = (*found.get(name, ()), f"field of {path.stem}: {meaning}")
    return found


def _fields(path: Path) -> Iterator[tuple[str, str]]:
    """Names and meanings: the comment beside a field, or above it and its neighbours."""
    above: list[str] = []
    used = False
    for line in path.read_text(encoding="utf-8").splitlines():
        field = _FIELD.match(line)
        if line.startswith("#"):
            above = [line[1:].strip()] if used else [*above, line[1:].strip()]
            used = False
        elif field:
            used = True
            yield field["name"], field["meaning"] or " ".join(above) or "see its message"
        elif not line.strip():
            above, used = [], False
