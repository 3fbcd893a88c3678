"""Frames for any number of viewers, none of whom can hold another up.

What is new is put once; each viewer takes what has come since it took last. One that is slow gets
more at once and at last misses what is older than the drawing; one that reads nothing costs no
more than what lies in its socket.
"""

from __future__ import annotations

import asyncio
from collections import deque
from typing import NamedTuple

KEPT = 300
"""Frames of the drawing: 30 s."""


class News(NamedTuple):
    """What a viewer has not seen.

    Attributes:
        frames: as JSON, in their order.
        picture: the newest camera image with its heading; None: it has seen that.
        seen: numbers of the last frame and picture, for the next time.
    """

    frames: list[str]
    picture: bytes | None
    seen: tuple[int, int]


class Hub:
    """Takes frames and pictures in the server's loop and gives them to whoever asks.

    Attributes:
        viewers: how many there are.
    """

    def __init__(self) -> None:
        self.viewers = 0
        self._frames: deque[str] = deque(maxlen=KEPT)
        self._picture = b""
        self._last = (0, 0)
        self._news = asyncio.Event()

    def put_frame(self, frame: str) -> None:
        """Takes the next frame."""
        self._frames.append(frame)
        self._last = (self._last[0] + 1, self._last[1])
        self._tell()

    def put_picture(self, picture: bytes) -> None:
        """Takes the newest picture."""
        self._picture = picture
        self._last = (self._last[0], self._last[1] + 1)
        self._tell()

    async def after(self, seen: tuple[int, int] = (0, 0)) -> News:
        """Waits for what is newer than what a viewer has seen."""
        while seen == self._last:
            await self._news.wait()
        missed = min(self._last[0] - seen[0], len(self._frames))
        frames = list(self._frames)[len(self._frames) - missed :]
        picture = self._picture if seen[1] != self._last[1] else None
        return News(frames, picture, self._last)

    def _tell(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()
