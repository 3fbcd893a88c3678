"""Detects repeated images from a camera or driver that hangs."""

from __future__ import annotations

import zlib
from collections import deque
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from slosh_camera.images.tuning import TUNING

Image = NDArray[np.uint8]
Digest = tuple[tuple[int, ...], tuple[int, ...]]


class RepeatedFrames:
    """Detects repeated images by comparing row checksums; stores no images.

    Noise makes every image of a camera that works differ from all others, in every part of it.
    """

    def __init__(self) -> None:
        self._last: deque[Digest] = deque(maxlen=TUNING.buffers)
        self._known = self._was_partly = False
        self._fresh = [0] * TUNING.bands
        self._stamp_ns: int | None = None

    def is_repeat(self, image: Image, stamp_ns: int | None = None) -> bool:
        """Whether an image has the same pixels as the previous one, or repeats earlier ones.

        A driver that hands out a few old images in turn is told from the second repeat on: a
        single one may be chance in a drawn picture. Of a camera with noise an image is told, too,
        whose upper or lower part is that of an old one.

        Args:
            image: (height, width) or (height, width, 3); may be a view, each the same kind.
            stamp_ns: its moment [ns]; one before the last begins a recording anew.
        """
        return self.repeats(digest(image), stamp_ns)

    def repeats(self, following: Digest, stamp_ns: int | None = None) -> bool:
        """Whether an image repeats earlier ones, judged by its row checksums."""
        if stamp_ns is not None:
            if self._stamp_ns is not None and stamp_ns < self._stamp_ns:
                while len(self._last) > 1:
                    self._last.popleft()
            self._stamp_ns = stamp_ns
        frozen = bool(self._last) and following == self._last[-1]
        known = following in self._last
        in_turn = known and self._known
        partly = self._repeats_partly(following)
        self._known = known
        self._last.append(following)
        return frozen or in_turn or partly

    def _repeats_partly(self, following: Digest) -> bool:
        """Whether noisy parts of an image equal an earlier image pixel by pixel."""
        shape, bands = following
        old = [
            any(shape == one[0] and band == one[1][at] for one in self._last)
            for at, band in enumerate(bands)
        ]
        noisy = [fresh >= TUNING.noisy for fresh in self._fresh]
        for at, is_old in enumerate(old):
            # A band that had noise and repeats is told as long as it does.
            if not noisy[at]:
                self._fresh[at] = 0 if is_old or not self._last else self._fresh[at] + 1
        stale = [at for at, is_old in enumerate(old) if is_old and noisy[at]]
        before, self._was_partly = self._was_partly, bool(stale)
        if not stale or sum(noisy) < TUNING.noisy_bands:
            return False
        # Noise that is drawn may come again all over what does not move; a part that is old lies
        # at one end of the image.
        return before or (0 in stale) != (TUNING.bands - 1 in stale)


def digest(image: Image) -> Digest:
    """Returns an image's shape and the CRC-32 checksums of its bands of rows.

    CRC-32 is the fastest checksum of the standard library that sees every change of one pixel;
    two images that differ are taken for one another once in 4e9.
    """
    rows = np.ascontiguousarray(_in_order_of_memory(image))
    edges = np.linspace(0, len(rows), TUNING.bands + 1).astype(int).tolist()
    return image.shape, tuple(zlib.crc32(rows[start:end].data) for start, end in pairwise(edges))


def _in_order_of_memory(image: Image) -> Image:
    """Returns the same pixels with axes in memory order, which is faster to read."""
    return image[..., ::-1] if image.strides[-1] < 0 else image
