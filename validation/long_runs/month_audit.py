"""Checks a month: each motion is stored or its loss reported, and each outage was noticed."""

from __future__ import annotations

import re
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import NamedTuple

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagReader
from validation.long_runs.month_clients import GOOD, HEARING, SERVED, Clients
from validation.long_runs.month_days import ACTIVE, PERIOD, Day

SECOND = 10**9
AFTER = 1.0
"""Time after the loss of a cell from which its values must be bad [s]."""
NEAR = 0.3
"""How far a motion's begin may be from where it is expected [s]."""
WHOLE = 0.75
"""Part of its length that a whole motion has, in bins of 0.05 s above the threshold."""
LOSS = re.compile(r"[1-9]\d* messages are lost")
"""What the recorder says, and writes into the bag."""
WORTH_TELLING = (1, 2)
"""Levels WARN and ERROR of diagnostics."""
GROWTH, BUFFERS = 1.05, 5.0  # 1, MB; what memory may grow from the first third to the last


class Fate(Enum):
    """What happened to a motion's data: stored, cut or lost, and whether a loss was reported."""

    STORED = "stored"
    CUT = "stored in part, told"
    LOST = "lost, told"
    UNTOLD = "lost or cut, not told"


class Row(NamedTuple):
    """A stored motion: start [ns since 1970], duration [s] and digest."""

    begin_ns: int
    duration: float
    digest: str


class Outage(NamedTuple):
    """A time span without a running cell, start and end [s since 1970]."""

    begin: float
    end: float


@dataclass(slots=True)
class Shift:
    """Records that remain of one day: bags, outputs of processes and diagnostics.

    Attributes:
        day: of the plan.
        began: middle of the first motion, by this machine's clock [s since 1970]; NaN: it was
            not seen.
        bags: of the day.
        words: what the cell's processes have said.
        told: WARN and ERROR of the nodes' diagnostics in its bags.
        codes: exit codes of the cell.
        memory: private memory of the nodes at its end [MB].
        played: whether the robot made all motions.
    """

    day: Day
    began: float = float("nan")
    bags: list[Path] = field(default_factory=list)
    words: str = ""
    told: set[str] = field(default_factory=set)
    codes: list[int] = field(default_factory=list)
    memory: dict[str, float] = field(default_factory=dict)
    played: bool = False


class Counted(NamedTuple):
    """What happened to a day's motions, how losses were reported, and unexpected rows."""

    fates: list[Fate]
    reasons: set[str]
    strange: int


def count_motions(
    shift: Shift, rows: Sequence[Row], clients: Clients, moments: Sequence[float]
) -> Counted:
    """Returns what happened to each motion of a day: stored, cut or lost.

    Args:
        shift: the day.
        rows: its stored motions.
        clients: of the PLC node.
        moments: middle of each motion by this machine's clock [s since 1970].
    """
    rows = sorted(rows)
    origin = rows[0].begin_ns if rows else 0
    found: dict[int, list[Row]] = {}
    strange = 0
    for row in rows:
        number = round((row.begin_ns - origin) / SECOND / PERIOD)
        late = (row.begin_ns - origin) / SECOND - PERIOD * number
        is_whole = row.duration >= WHOLE * ACTIVE and abs(late) <= NEAR
        if not 0 <= number < shift.day.motions or (not is_whole and late > ACTIVE + NEAR):
            strange += 1
            continue
        found.setdefault(number, []).append(row)
    fates, reasons = [], set()
    for number, moment in enumerate(moments):
        own = found.get(number, [])
        whole = [row for row in own if row.duration >= WHOLE * ACTIVE]
        strange += max(len(own) - 1, 0)
        if whole:
            fates.append(Fate.STORED)
            continue
        reason = _told(shift, clients, moment)
        reasons |= {reason} - {""}
        fates.append((Fate.CUT if own else Fate.LOST) if reason else Fate.UNTOLD)
    return Counted(fates, reasons, strange)


def _told(shift: Shift, clients: Clients, moment: float) -> str:
    """Returns how the loss of a motion was reported; empty if it was not reported."""
    seen = list(clients.between("OPC UA", moment - PERIOD / 2, moment + PERIOD / 2))
    worse = {one.what for one in seen} - {GOOD}
    if worse:
        return "over OPC UA: " + ", ".join(sorted(worse))
    for text in (shift.words, *shift.told):
        found = LOSS.search(text)
        if found:
            return "recorder: " + re.sub(r"\d+", "N", found[0])
    return ""


def moments_of(shift: Shift) -> list[float]:
    """Returns the middle time of each motion of a day [s since 1970], by this machine's clock."""
    return [shift.began + PERIOD * number for number in range(shift.day.motions)]


def late_losses(clients: Clients, outages: Sequence[Outage], deaf: Sequence[Outage]) -> list[str]:
    """Returns a line for each outage that a client did not notice within a second.

    Args:
        clients: of the PLC node.
        outages: times without a cell.
        deaf: times without a broker, in which MQTT clients hear nothing.
    """
    found = []
    for outage in outages:
        for protocol in clients.seen:
            begin, end = outage.begin + AFTER, outage.end
            if protocol in HEARING and any(one.begin < end and begin < one.end for one in deaf):
                continue
            wrong = [one for one in clients.between(protocol, begin, end) if one.what in SERVED]
            last = list(clients.between(protocol, 0.0, end))[-1:]
            if wrong or not last or last[0].what in SERVED:
                found.append(f"{protocol}: good {len(wrong)} times without a cell")
    return found


def grown(memories: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, float]]:
    """Returns the nodes whose memory grew, with the mean of the first and last third [MB]."""
    found = {}
    for name, sizes in memories.items():
        part = max(len(sizes) // 3, 1)
        early, late = statistics.fmean(sizes[:part]), statistics.fmean(sizes[-part:])
        if late > GROWTH * early + BUFFERS:
            found[name] = early, late
    return found


def told_in(bags: Iterable[Path]) -> set[str]:
    """Returns the warnings and errors in bags: diagnostics, and those of reading a damaged bag."""
    found: set[str] = set()
    for bag in bags:
        try:
            reader = BagReader(bag)
            for message in reader.messages(["/diagnostics"]):
                for status in reader.decode(message).status:
                    if int(status.level) in WORTH_TELLING:
                        found.add(f"{status.name}: {status.message}")
            found |= set(reader.warnings)
        except SloshBagError as error:
            found.add(str(error))
    return found
