"""Common fields of containers of every shape: wall, rim and fill height."""

from __future__ import annotations

from dataclasses import fields
from typing import Any, ClassVar, Protocol

import numpy as np

from slosh_camera.errors import SloshCameraError

LARGEST = 10.0
"""Dimension of a container [m]; a larger one is a unit mistaken for another."""
WALL = ("wall_thickness", "wall_refractive_index", "rim_height")
"""Fields that say what the wall is like; all others of a container are lengths inside it."""


class _Filled(Protocol):
    """Fields of a container of any shape; all lengths in metres."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def fill_height(self) -> float: ...
    @property
    def wall_thickness(self) -> float: ...
    @property
    def wall_refractive_index(self) -> float: ...
    @property
    def rim_height(self) -> float | None: ...


def _lengths(container: _Filled) -> list[str]:
    return [
        entry.name
        for entry in fields(container)
        if entry.name not in WALL and entry.metadata.get("is_length", True)
    ]


class SeenContainer:
    """Base class of the containers that a camera sees, with their common fields."""

    __slots__ = ()

    def __post_init__(self: _Filled) -> None:
        """Raises SloshCameraError for physically impossible dimensions."""
        for name in _lengths(self):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise SloshCameraError(f"{name}: {value} m, must be positive")
            if value is not None and value > LARGEST:
                meant = f"did you mean {value:g} mm, {1e-3 * value:g}?"
                raise SloshCameraError(
                    f"{name}: {value:g} m, must be at most {LARGEST:g}; {meant}"
                )
        if not (np.isfinite(self.wall_thickness) and self.wall_thickness >= 0.0):
            raise SloshCameraError(f"wall_thickness: {self.wall_thickness} m, must be >= 0")
        if not (np.isfinite(self.wall_refractive_index) and self.wall_refractive_index >= 1.0):
            raise SloshCameraError(
                f"wall_refractive_index: {self.wall_refractive_index}, must be at least 1"
            )
        if self.rim_height is not None and not (
            np.isfinite(self.rim_height) and self.rim_height > self.fill_height
        ):
            raise SloshCameraError(
                f"rim_height: {self.rim_height} m, must be above fill_height {self.fill_height} m"
            )

    @property
    def rim_level(self: _Filled) -> float | None:
        """Height of the rim above the liquid's level at rest [m], or None if unknown."""
        return None if self.rim_height is None else self.rim_height - self.fill_height
