"""What the camera node says of liquid whose level has changed since the still image."""

from __future__ import annotations

import statistics

from slosh_camera.measurement import Flag, Measurement


class LevelChanges:
    """The changes that the images between two reports show."""

    def __init__(self) -> None:
        self._changes: list[tuple[float, float]] = []

    def add(self, measurement: Measurement) -> None:
        """Take note of one measurement."""
        if Flag.LEVEL_CHANGED in measurement.flags:
            self._changes.append((measurement.level_change, measurement.level_change_stddev))

    def report(self, images: int) -> str:
        """One line, empty where fewer than half of the images show a change; starts anew.

        Args:
            images: how many there were since the last report.
        """
        changes, self._changes = self._changes, []
        if 2 * len(changes) <= images:
            return ""
        level, stddev = (statistics.median(part) for part in zip(*changes, strict=True))
        return (
            f"the liquid's level has changed by {1e3 * level:+.1f} ± "
            f"{max(1e3 * stddev, 0.1):.1f} mm since the still image ({len(changes)} of "
            f"{images} images): heights refer to the old level; record a new still image and "
            "correct the fill height of camera and model"
        )
