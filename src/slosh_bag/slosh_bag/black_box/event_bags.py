"""Manages a folder of event bags: starts and finishes bags and deletes superfluous ones."""

from __future__ import annotations

import json
import re
import shutil
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from slosh_bag.bag_writer import Qos
from slosh_bag.black_box.black_box import EVENTS, BlackBox, Cause, Happening, Windows
from slosh_bag.black_box.ring import Place
from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import HeldFolder
from slosh_bag.mcap_files.bag_metadata import NAME
from slosh_bag.recorder import Recorder, RecorderStatus, free_space
from slosh_base.files.errors import SloshFileError
from slosh_base.files.yaml_document import read_yaml

_NAME = re.compile(rf"(\d{{4,}})_({'|'.join(Cause)})")
SHARE: Final = 4
"""Of the quota the ring takes a quarter at most, a bag two of them: a finished bag always fits."""


class KeptBag(NamedTuple):
    """A finished event bag that still exists: folder, causes of its events, and size.

    Attributes:
        folder: where it is.
        causes: of its events.
        size: of its files [bytes].
    """

    folder: Path
    causes: frozenset[str]
    size: int


def superfluous(bags: Sequence[KeptBag], per_cause: int, quota: int) -> list[KeptBag]:
    """Returns the bags to delete, oldest first, so that number and size limits are met.

    A bag is kept while it is among the last so many of any of its causes; then the newest are, as
    far as the quota goes.

    Args:
        bags: the oldest first.
        per_cause: kept of each cause.
        quota: bytes of all that are kept.
    """
    counts: Counter[str] = Counter()
    size, given_up, is_full = 0, [], False
    for bag in reversed(bags):
        is_wanted = any(counts[cause] < per_cause for cause in bag.causes)
        is_full = is_full or (is_wanted and size + bag.size > quota)
        if is_wanted and not is_full:
            counts.update(bag.causes)
            size += bag.size
        else:
            given_up.append(bag)
    return given_up[::-1]


class _OpenBag:
    """An event bag that is being written."""

    def __init__(self, recorder: Recorder, folder: Path, cause: Cause) -> None:
        self.recorder, self.folder = recorder, folder
        self.causes = {cause.value}
        self.closing: threading.Thread | None = None
        self.add_topic, self.add, self.miss = recorder.add_topic, recorder.add, recorder.miss

    def note(self, name: str, value: str) -> None:
        """Stores a key and value of the bag's metadata."""
        if name == EVENTS:
            self.causes |= _causes(value)
        self.recorder.note(name, value)

    def close(self) -> None:
        """Finishes the bag in a separate thread, so that a busy disk delays no messages."""
        self.closing = threading.Thread(target=self.recorder.close, name="bag end")
        self.closing.start()


class EventRecorder:
    """Recorder that writes only messages from around events, each event to its own bag.

    It takes what `Recorder` takes, and events. All calls come from one thread.

    Args:
        folder: of the bags; of an earlier recorder's bags those are kept on that belong to the
            last. A bag that was renamed is left alone.
        windows: how much is kept round an event; `memory` and `longest` are bounded by the quota.
        per_cause: bags that are kept of each cause.
        quota: bytes of all bags.
        place: of a latched message; see `Ring`.
        clock: steady clock [s].
        free: free space on a folder's disk [bytes].

    Raises:
        SloshBagError: the folder holds a recording, another recorder writes in it, or it cannot
            be made.
    """

    def __init__(
        self,
        folder: Path,
        windows: Windows,
        per_cause: int,
        quota: int,
        place: Callable[[str, bytes], Place | None] = lambda _topic, _data: None,
        clock: Callable[[], float] = time.monotonic,
        free: Callable[[Path], int] = free_space,
    ) -> None:
        self._folder, self._per_cause, self._quota = folder, per_cause, quota
        self._clock, self._free = clock, free
        # Before its bags are looked at: from now on nobody else changes them.
        self._held = HeldFolder.made(folder)
        try:
            self._kept = _found(folder)
        except BaseException:
            self._held.release()
            raise
        self._number = max(map(_number, _named(folder)), default=0)
        self._open: list[_OpenBag] = []  # the last one may be open, the others are being finished
        self._refused: dict[str, str] = {}
        self._heard: Counter[str] = Counter()
        self._missed: Mapping[str, int] = {}
        self._unkept = self._interruptions = self._lost_meanwhile = 0
        self._is_bounded = windows.longest > 2 * quota // SHARE
        self._failed_at = 0.0
        bounded = replace(
            windows,
            memory=min(windows.memory, quota // SHARE),
            longest=min(windows.longest, 2 * quota // SHARE),
        )
        self.box = BlackBox(bounded, self._begin, place)
        self._tidy()

    @property
    def shortage(self) -> str:
        """Warning, in one line, if the disk quota is too small for one event; otherwise empty."""
        if not (self._is_bounded and self.box.continued):
            return ""
        return (
            f"an event is larger than half of event_quota, {5e-7 * self._quota:.3g} MB, and is "
            "split into bags, of which only the last are kept: raise event_quota, or shorten "
            "event_before and event_after"
        )

    @property
    def path(self) -> Path:
        """Folder of the newest event bag, or the folder for all event bags if there is none."""
        bags = [*(bag.folder for bag in self._kept), *(bag.folder for bag in self._open)]
        return bags[-1] if bags else self._folder

    def add_topic(self, name: str, message_type: str, qos: Qos) -> None:
        """Registers a topic before its first message."""
        self.box.add_topic(name, message_type, qos)

    def add(self, topic: str, data: bytes, log_ns: int, publish_ns: int | None = None) -> None:
        """Adds a serialised message of a registered topic."""
        self._heard[topic] += 1
        self.box.add(topic, data, log_ns, publish_ns)

    def happen(self, happening: Happening) -> None:
        """Processes a new event: starts a bag, or extends the open one."""
        self.box.happen(happening)

    def look(self, now_ns: int) -> None:
        """Sets the time [ns] by the messages' clock, and registers bags that are finished."""
        self.box.look(now_ns)
        self._collect()

    def note(self, name: str, value: str) -> None:
        """Stores a key and value of metadata for all bags from now on."""
        self.box.note(name, value)

    def miss(self, counts: Mapping[str, int]) -> None:
        """Sets the number of messages that were sent but not received so far, by topic."""
        self._missed = dict(counts)
        self.box.miss(counts)

    def status(self) -> RecorderStatus:
        """State of the recording: bags, losses and failures."""
        self._collect()
        self._tidy()
        states = [bag.recorder.status() for bag in self._open]
        failure = next((state.failure for state in states if state.failure), self.box.failure)
        now = self._clock()
        self._failed_at = (self._failed_at or now) if failure else 0.0
        return RecorderStatus(
            path=self.path / "metadata.yaml" if self.path != self._folder else self._folder / "-",
            files=len(self._kept) + len(self._open),
            written=dict(self._heard),
            size=sum(bag.size for bag in self._kept) + sum(state.size for state in states),
            refused=self._refused | {k: v for state in states for k, v in state.refused.items()},
            unkept=self._unkept + sum(state.unkept for state in states),
            waiting=sum(state.waiting for state in states),
            highest=max((state.highest for state in states), default=0),
            age=max((state.age for state in states), default=0.0),
            free=self._free(self._folder),
            rate=float("nan"),
            failure=failure,
            since=now - self._failed_at if failure else 0.0,
            interruptions=self._interruptions + sum(state.interruptions for state in states),
            lost_meanwhile=self._lost_meanwhile + sum(state.lost_meanwhile for state in states),
            missed=sum(self._missed.values()),
        )

    def close(self) -> None:
        """Finishes the open event bag."""
        self.box.close()
        for bag in self._open:
            if bag.closing is not None:
                bag.closing.join()
        self._collect()
        self._held.release()

    def _begin(self, happening: Happening) -> _OpenBag:
        folder = self._folder / f"{self._number + 1:04d}_{happening.cause}"
        recorder = Recorder(folder, clock=self._clock, free=self._free)
        self._number += 1
        bag = _OpenBag(recorder, folder, happening.cause)
        self._open.append(bag)
        return bag

    def _collect(self) -> None:
        """Adds newly finished event bags to the list of existing ones."""
        done = [bag for bag in self._open if bag.closing and not bag.closing.is_alive()]
        if not done:
            return
        self._open = [bag for bag in self._open if bag not in done]
        for bag in done:
            state = bag.recorder.status()
            self._unkept += state.unkept
            self._lost_meanwhile += state.lost_meanwhile
            # One that lasted until the end of the bag is over with it.
            self._interruptions += state.interruptions + bool(state.failure)
            self._refused |= state.refused
            if not _holds_data(bag.folder):  # the disk was full: it must not displace others
                shutil.rmtree(bag.folder, ignore_errors=True)
                self.box.missed += 1
                continue
            self._kept.append(KeptBag(bag.folder, frozenset(bag.causes), _size(bag.folder)))
        self._kept.sort(key=lambda bag: _number(bag.folder))
        self._tidy()

    def _tidy(self) -> None:
        """Deletes the oldest event bags if their number or total size is too large."""
        open_size = sum(_size(bag.folder) for bag in self._open)
        for bag in superfluous(self._kept, self._per_cause, max(self._quota - open_size, 0)):
            shutil.rmtree(bag.folder, ignore_errors=True)
            self._kept.remove(bag)


def _found(folder: Path) -> list[KeptBag]:
    """Returns the event bags of earlier recorders in a folder, oldest first.

    Raises:
        SloshBagError: it holds a recording itself.
    """
    if any(folder.glob("*.mcap")):
        raise SloshBagError(f"{folder}: holds a recording; choose another folder for the events")
    return [
        KeptBag(bag, _noted_causes(bag) | {bag.name.partition("_")[2]}, _size(bag))
        for bag in event_bags(folder)
    ]


def event_bags(folder: Path) -> list[Path]:
    """Returns the event bags in a folder, oldest first, except renamed and empty ones."""
    return sorted(filter(_holds_data, _named(folder)), key=_number)


def _named(folder: Path) -> list[Path]:
    """Returns the folders that have an event bag's name."""
    if not folder.is_dir():
        return []
    return [one for one in folder.iterdir() if one.is_dir() and has_event_name(one)]


def has_event_name(folder: Path) -> bool:
    """Returns whether a folder is named as an event bag, such as 0012_limit."""
    return _NAME.fullmatch(folder.name) is not None


def _holds_data(bag: Path) -> bool:
    """Returns whether there is a file of messages in a bag's folder."""
    return any(bag.glob("*.mcap"))


def _number(bag: Path) -> int:
    return int(bag.name.partition("_")[0])


def _noted_causes(folder: Path) -> frozenset[str]:
    """Reads from metadata.yaml the causes of the events for which a bag was written."""
    try:
        facts = read_yaml(folder / NAME).value["rosbag2_bagfile_information"]["custom_data"]
        return _causes(str(facts[EVENTS]))
    except (SloshFileError, LookupError, TypeError):  # the recorder was killed before its end
        return frozenset()


def noted_events(text: str) -> list[Happening]:
    """Parses the event list in a bag's metadata; skips invalid events."""
    try:
        document = json.loads(text)
    except ValueError:
        return []
    return list(filter(None, map(_event, document))) if isinstance(document, list) else []


def _event(entry: object) -> Happening | None:
    try:
        found = Happening(**entry)  # type: ignore[arg-type]
        return Happening(Cause(found.cause), int(found.stamp_ns), str(found.text))
    except (TypeError, ValueError):
        return None


def _causes(text: str) -> frozenset[str]:
    return frozenset(happening.cause.value for happening in noted_events(text))


def _size(folder: Path) -> int:
    size = 0
    for entry in folder.rglob("*"):
        try:
            size += entry.stat().st_size
        except OSError:  # one that goes away meanwhile
            continue
    return size
