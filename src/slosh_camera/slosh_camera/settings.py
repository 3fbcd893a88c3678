"""What a user may set about the detection."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from slosh_camera.errors import SloshCameraError


class Liquid(Enum):
    """How the liquid looks against its background."""

    DARKER = "darker"
    LIGHTER = "lighter"


@dataclass(frozen=True, slots=True)
class RegionOfInterest:
    """Rectangle of the image in which the container is looked for [px].

    Attributes:
        x_offset: leftmost column.
        y_offset: uppermost row.
        width: number of columns.
        height: number of rows.
    """

    x_offset: int
    y_offset: int
    width: int
    height: int

    def __post_init__(self) -> None:
        """Refuse an empty rectangle."""
        if self.x_offset < 0 or self.y_offset < 0 or self.width < 1 or self.height < 1:
            raise SloshCameraError(
                f"region_of_interest: {self.width} x {self.height} at "
                f"({self.x_offset}, {self.y_offset}), needs a positive size and offsets >= 0"
            )


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """Settings of the detector; grey levels are those of an 8-bit image.

    Attributes:
        liquid: how the liquid looks against its background.
        threshold: grey level between liquid and background; None: found by Otsu's method.
        blur: standard deviation of the Gaussian blur [px]; 0: none.
        min_contrast: least difference of liquid and background [grey levels].
        surface_contrast: least difference of free surface and liquid, as a fraction of the
            difference of background and liquid, for the surface to be told from the liquid.
        min_band: least height of the visible free surface under the peak for the peak to lie on
            the rear wall [px].
        max_dark: an image is too dark where its bright regions are below this level.
        min_bright: an image is too bright where its dark regions are above this level.
    """

    liquid: Liquid = Liquid.DARKER
    threshold: float | None = None
    blur: float = 0.8
    min_contrast: float = 20.0
    surface_contrast: float = 0.12
    min_band: float = 3.0
    max_dark: float = 25.0
    min_bright: float = 230.0

    def __post_init__(self) -> None:
        """Refuse values out of bounds."""
        if not isinstance(self.liquid, Liquid):
            raise SloshCameraError(f"liquid: {self.liquid!r}, must be darker or lighter")
        if self.threshold is not None:
            _check("threshold", self.threshold, 1.0, 254.0)
        _check("blur", self.blur, 0.0, 10.0)
        _check("min_contrast", self.min_contrast, 2.0, 255.0)
        _check("surface_contrast", self.surface_contrast, 0.01, 0.9)
        _check("min_band", self.min_band, 1.0, 100.0)
        _check("max_dark", self.max_dark, 0.0, 255.0)
        _check("min_bright", self.min_bright, 0.0, 255.0)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (np.isfinite(value) and low <= value <= high):
        raise SloshCameraError(f"{name}: {value}, must be in [{low:g}, {high:g}]")
