"""User settings of the free-surface detection."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

import numpy as np

from slosh_camera.errors import SloshCameraError


class LiquidContrast(Enum):
    """Brightness of the liquid relative to its background."""

    ANY = "any"
    DARKER = "darker"
    LIGHTER = "lighter"


@dataclass(frozen=True, slots=True)
class RegionOfInterest:
    """Image rectangle in which the container is searched [px].

    >>> RegionOfInterest(x_offset=100, y_offset=50, width=400, height=300).width  # px
    400
    """

    x_offset: int
    y_offset: int
    width: int
    height: int

    def __post_init__(self) -> None:
        """Raises SloshCameraError for an empty rectangle."""
        if self.x_offset < 0 or self.y_offset < 0 or self.width < 1 or self.height < 1:
            raise SloshCameraError(
                f"region_of_interest: {self.width} x {self.height} at "
                f"({self.x_offset}, {self.y_offset}), needs a positive size and offsets >= 0"
            )


@dataclass(frozen=True, slots=True)
class DetectionSettings:
    """Settings of the free-surface detector; grey levels are those of an 8-bit image.

    >>> DetectionSettings(liquid=LiquidContrast.DARKER).min_contrast  # grey levels
    12.0

    Attributes:
        liquid: how the liquid looks against its background; what looks otherwise is not taken
            for liquid.
        min_contrast: least difference of liquid and background, in the channel in which it is
            largest [grey levels].
        max_dark: an image is too dark where its bright regions are below this level.
        min_bright: an image is too bright where its dark regions are above this level.
        blur: standard deviation of the Gaussian blur before edges are looked for in a side view
            [px]; 0: none.
        max_blur: the line is blurred where its edges are wider than this [px].
        scale_error: relative standard error of the scale, which is in every height's standard
            deviation of a side view.
    """

    liquid: LiquidContrast = LiquidContrast.ANY
    min_contrast: float = 12.0
    max_dark: float = 25.0
    min_bright: float = 230.0
    blur: float = 0.8
    max_blur: float = 4.0
    scale_error: float = 0.0

    def __post_init__(self) -> None:
        """Raises SloshCameraError for values out of bounds."""
        if self.liquid not in tuple(LiquidContrast):
            names = " or ".join(liquid.value for liquid in LiquidContrast)
            raise SloshCameraError(f"liquid: {self.liquid!r}, must be {names}")
        _check("min_contrast", self.min_contrast, 2.0, 255.0)
        _check("max_dark", self.max_dark, 0.0, 255.0)
        _check("min_bright", self.min_bright, 0.0, 255.0)
        _check("blur", self.blur, 0.0, 10.0)
        _check("max_blur", self.max_blur, 2.0, 100.0)
        _check("scale_error", self.scale_error, 0.0, 0.5)


def _check(name: str, value: float, low: float, high: float) -> None:
    if not (np.isfinite(value) and low <= value <= high):
        raise SloshCameraError(f"{name}: {value}, must be in [{low:g}, {high:g}]")
