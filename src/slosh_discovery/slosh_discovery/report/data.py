"""What a report shows, as plain arrays and tables in SI units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.errors import SloshDiscoveryError

Array = NDArray[np.float64]
NAN = float("nan")
MEDIA_TYPES = ("image/png", "image/jpeg")


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """One number on top of the page.

    Attributes:
        label: what it is.
        value: as text, rounded as it should be read.
        unit: beside the value; may be empty.
        note: a few words below; may be empty.
    """

    label: str
    value: str
    unit: str = ""
    note: str = ""


@dataclass(frozen=True, slots=True)
class Span:
    """An excess of a limit.

    Attributes:
        source: what exceeded it: "measured", "estimated", "disagreement".
        start, end: on the report's time axis [s]; end NaN: not over when the run ended.
        limit, peak: [m].
        description: one line.
    """

    source: str
    start: float
    end: float
    limit: float
    peak: float
    description: str = ""


@dataclass(frozen=True, slots=True)
class ModelRow:
    """Agreement of one model.

    Attributes:
        name: 2D-L, 3D-L, 2D-NL, 3D-NL, …
        sigma: mean absolute error (DL22, eq. (33)) [m].
        epsilon: relative error of the maximum (DL22, eq. (32)) [1].
        rms: [m].
        offset: clock offset that was applied [s]; NaN: the clocks are one.
        count: compared images.
    """

    name: str
    sigma: float
    epsilon: float
    rms: float = NAN
    offset: float = NAN
    count: int = 0


@dataclass(frozen=True, slots=True)
class Frame:
    """A camera frame, with whatever is to be seen in it drawn in.

    Attributes:
        image: the encoded image.
        caption: one line.
        media_type: one of MEDIA_TYPES.

    Raises:
        SloshDiscoveryError: another media type.
    """

    image: bytes
    caption: str
    media_type: str = "image/jpeg"

    def __post_init__(self) -> None:
        if self.media_type not in MEDIA_TYPES:
            raise SloshDiscoveryError(
                f"frame {self.caption!r}: media type {self.media_type!r} is not one of "
                f"{', '.join(MEDIA_TYPES)}"
            )


@dataclass(frozen=True, slots=True)
class Topic:
    """A recorded topic.

    Attributes:
        name, type: as in the bag.
        count: messages.
        rate: [1/s]; NaN: too few messages.
    """

    name: str
    type: str
    count: int
    rate: float = NAN


@dataclass(frozen=True, slots=True)
class RunReport:
    """Everything that a page shows.

    Attributes:
        title, subtitle: headings.
        t: (N,) [s], strictly increasing, from the run's start.
        measured, linear, nonlinear: (N,) heights [m]; NaN: none.
        linear_name, nonlinear_name: of the two models.
        limit: of the height [m]; None: none.
        key_figures, events, models, frames, topics: tables, in the order shown.
        model_text: the model file.
        notes: remarks, one line each.

    Raises:
        SloshDiscoveryError: series that do not match.
    """

    title: str
    t: Array
    measured: Array
    linear: Array
    nonlinear: Array
    subtitle: str = ""
    linear_name: str = "L"
    nonlinear_name: str = "NL"
    limit: float | None = None
    key_figures: tuple[KeyFigure, ...] = ()
    events: tuple[Span, ...] = ()
    models: tuple[ModelRow, ...] = ()
    frames: tuple[Frame, ...] = ()
    topics: tuple[Topic, ...] = ()
    model_text: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if self.t.ndim != 1:
            raise SloshDiscoveryError(f"t has the shape {self.t.shape}, expected one dimension")
        for name in ("measured", "linear", "nonlinear"):
            shape = getattr(self, name).shape
            if shape != self.t.shape:
                raise SloshDiscoveryError(f"{name} has the shape {shape}, t has {self.t.shape}")
