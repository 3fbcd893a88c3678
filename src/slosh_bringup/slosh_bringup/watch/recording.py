"""Converts a recording to the watch-page updates that a live viewer would have received."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from slosh_bag.errors import SloshBagError
from slosh_bag.reader import BagMessage, BagReader
from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.cell_watch import reports
from slosh_bringup.detect.source import frames_at
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.watch import hearing
from slosh_bringup.watch.picture import Camera
from slosh_bringup.watch.state import PERIOD, WatchState
from slosh_bringup.watch.verdict import CellVerdict
from slosh_camera.errors import SloshCameraError
from slosh_motion.recorded.settings import TOPIC, node_start
from slosh_motion.recorded.sources import CellTopics
from slosh_msgs_py import topics

_PAGE = {row.name.lstrip("/"): row for row in topics.TOPICS if row.page}
HEIGHTS = {
    name: row.type
    for name, row in _PAGE.items()
    if row.role is topics.TopicRole.ANSWER and not row.latched
}
"""Topics without one of which nothing of a cell is in a bag, and their types."""
BESIDE = {name: row.type for name, row in _PAGE.items() if name not in HEIGHTS}
MOST = 36_000
"""Frames that are kept: an hour."""
STEP = round(PERIOD * SECOND)
BEFORE = round(2.0 / PERIOD)
"""So many frames before something happens the page begins."""
SHARE, FLAT = 0.2, 1e-3
"""The liquid moves from this share of its greatest height on; a recording below FLAT is of one at
rest [m]."""


class RecordedFrames:
    """Updates of the operator's page, made from a bag, one per period.

    Args:
        bag: the bag.
        tell: is told of what is left out.

    Attributes:
        frames: as JSON, one every PERIOD of its time.
        start: the frame with which the page begins, shortly before something happens.

    Raises:
        SloshBringupError: nothing of a cell is in it.
        SloshBagError: it cannot be read.
    """

    def __init__(self, bag: Path, tell: Callable[[str], None] = lambda line: None) -> None:
        self._bag = bag
        self._listener = _Listener(BagReader(bag), bag)
        self.frames: list[str] = []
        self._surfaces: list[Any] = []
        for frame, surface in self._listener.frames():
            if len(self.frames) == MOST:
                tell(f"{bag}: the page shows the first {MOST * PERIOD / 60.0:.0f} minutes")
                break
            self.frames.append(frame)
            self._surfaces.append(surface)
        for warning in self._listener.reader.warnings:
            tell(warning)
        self.start = max(first_happening(self.frames) - BEFORE, 0)

    def about(self) -> dict[str, Any]:
        """Returns the data that the watch page needs before it requests updates of a recording."""
        facts = {"name": self._bag.name, "frames": len(self.frames), "period": PERIOD}
        return {**facts, "start": self.start}

    def picture(self, frame: int) -> bytes | None:
        """Returns camera image and header for a watch-page update, or None without an image."""
        surface = self._surfaces[frame] if 0 <= frame < len(self._surfaces) else None
        if surface is None:
            return None
        stamp_ns = hearing.stamp_ns(surface)
        try:
            found = frames_at(BagReader(self._bag), [stamp_ns]).get(stamp_ns)
            camera = self._listener.camera
            return camera.picture(found.image(), stamp_ns, surface) if found else None
        except (SloshBagError, SloshBringupError, SloshCameraError):
            return None  # a recording without images, or with a damaged one


def first_happening(frames: Sequence[str]) -> int:
    """Returns the index of the first update with an exceeded limit, else with motion, else 0.

    Args:
        frames: of a recording, as JSON.
    """
    highest = []
    for number, frame in enumerate(map(json.loads, frames)):
        if frame["verdict"] == CellVerdict.EXCEEDED.value:
            return number
        heights = (abs(h) for _, *row in frame["rows"] for h in row if h is not None)
        highest.append(max(heights, default=0.0))
    top = max(highest, default=0.0)
    return next((k for k, height in enumerate(highest) if top > FLAT and height > SHARE * top), 0)


class _Listener:
    """Processes a recording's messages in the same way as the watch node does live messages."""

    def __init__(self, reader: BagReader, bag: Path) -> None:
        self.reader = reader
        self.camera = Camera()
        self._state = WatchState(f"slosh discover {bag} --model MODEL -o out/why")
        self._surface: Any = None
        self._frequent: dict[str, BagMessage] = {}
        cell = CellTopics(reader)
        self._namespace = cell.cells[0] if cell.cells else topics.NAMESPACE
        # Topics with up to a thousand messages per second.
        self._hears = {topics.ESTIMATE: hearing.hear_estimate, **hearing.figures()}
        of_add_ons = {row.name: row.type for row in topics.TOPICS if row.name in self._hears}
        wanted = (HEIGHTS | BESIDE | of_add_ons).items()
        found = {cell.topic(name, kind): name for name, kind in wanted}
        self._names = {topic: name for topic, name in found.items() if topic is not None}
        if not HEIGHTS.keys() & set(self._names.values()):
            raise SloshBringupError(
                f"{bag}: no cell data in this recording (no comparison, free_surface or "
                "estimate); `slosh replay` computes them from a robot's topics"
            )

    def frames(self) -> Iterator[tuple[str, Any]]:
        """Yields watch-page updates, each with the newest measured surface."""
        end_ns = None
        for message in self.reader.messages(self._names):
            name = self._names[message.topic]
            if end_ns is None and name in HEIGHTS:
                end_ns = message.log_ns + STEP  # before that the nodes get ready
            while end_ns is not None and message.log_ns >= end_ns:
                yield self._frame(end_ns)
                end_ns += STEP
            with contextlib.suppress(SloshBagError):  # one that is damaged is left out
                self._hear(name, message)
        if end_ns is not None:
            yield self._frame(end_ns)

    def _hear(self, name: str, message: BagMessage) -> None:
        now = message.log_ns * 1e-9
        if name in self._hears:  # of a thousand a second the last before a frame is decoded
            self._frequent[name] = message
            return
        decoded = self.reader.decode(message)
        if name == "comparison":
            hearing.hear_comparison(self._state, decoded, now)
        elif name == "free_surface":
            self._surface = decoded
            hearing.hear_surface(self._state, decoded)
        elif name == "fused_estimate":
            hearing.hear_fused(self._state, decoded)
        elif name == "calm":
            hearing.hear_calm(self._state, decoded, now)
        elif name == "limit_event":
            hearing.hear_event(self._state, decoded)
        elif name == TOPIC:
            start = node_start(decoded, message.log_ns, message.topic)
            hearing.hear_start(self._state, self.camera, start)
        else:
            for report in reports(decoded, self._namespace):
                self._state.take_report(report, now)

    def _frame(self, now_ns: int) -> tuple[str, Any]:
        now = now_ns * 1e-9
        for name, message in self._frequent.items():
            with contextlib.suppress(SloshBagError):
                self._hears[name](self._state, self.reader.decode(message), now)
        self._frequent.clear()
        return self._state.frame(now), self._surface
