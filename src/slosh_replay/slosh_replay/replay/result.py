"""Result of a replay as Python object, as JSON and as a table."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_estimator.limits import Event
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.for_notebooks import Shown, height_axes, table
from slosh_model.model import Model
from slosh_motion.signals.alignment import ClockOffset, StillLevel
from slosh_msgs_py.topics import COMPARISON, ESTIMATE
from slosh_replay.replay.verification import Verification
from slosh_report.json_values import plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


def _none() -> Array:
    return np.empty(0)


def _no_flags() -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


@dataclass(frozen=True, slots=True)
class ModelAccuracy:
    """Agreement of one model with the measurement.

    Attributes:
        name: 2D-L, 3D-L, 2D-NL or 3D-NL, with '+' and further effects.
        sigma: mean absolute error (DL22, eq. (33)) [m].
        epsilon: relative error of the maximum (DL22, eq. (32)), single-sample spikes of the
            measurement left out [1].
        epsilon_raw: the same with them.
        rms: root mean square error [m].
        count: compared images.
        clock: offset of the measured clock; None: the clocks are one.

    >>> row = ModelAccuracy("3D-NL", 1.5e-4, -0.01, -0.01, rms=2e-4, count=90)
    >>> f"{1e3 * row.sigma:.2f} mm"
    '0.15 mm'
    """

    name: str
    sigma: float
    epsilon: float
    epsilon_raw: float
    rms: float
    count: int
    clock: ClockOffset | None = None


@dataclass(frozen=True, slots=True)
class MotionAccuracy:
    """Agreement of the models with the measurement during one motion.

    Attributes:
        start, end: on the measured clock [s].
        peak: greatest measured height, spikes left out [m].
        models: of each model.
    """

    start: float
    end: float
    peak: float
    models: tuple[ModelAccuracy, ...]


@dataclass(frozen=True, slots=True, repr=False)
class ReplayResult(Shown):
    """Estimates, accuracy, events and warnings of a replay.

    The series are whole for runs up to some minutes; of a longer one they hold the extremes.

    >>> import slosh
    >>> result = slosh.replay("bags/c3")
    >>> list(result.heights)
    ['2D-L', '3D-L', '2D-NL', '3D-NL']

    Attributes:
        name: of the bag or table.
        source: topic or file that drove the models.
        stamps: (N,) of the images, on the measured clock [ns].
        measured: (N,) heights above the still level [m]; NaN: none.
        heights: (N,) of each model at the images [m]; NaN: no estimate.
        accuracy: of each model, in the order of `heights`; empty where nothing was measured.
        motions: the same over each motion.
        events: limit events of the monitor.
        counters: samples used and dropped, gaps, images, spikes, …
        still: still level and noise where they were estimated.
        azimuth: (N,) measured azimuth of the highest point [rad]; NaN: unknown.
        model_azimuth: (N,) that of the loaded model's NL twin [rad]; NaN: none.
        flags: (N,) of FreeSurface.msg.
        verified: recorded messages against replayed ones, by the last name of their topic.
        model: that was replayed with.
        limits: that the monitor watched at first.
        limit_changes: that it watched for data with stamps after these [ns].
        warnings: one line each.
    """

    name: str
    source: str
    stamps: NDArray[np.int64]
    measured: Array
    heights: Mapping[str, Array]
    accuracy: tuple[ModelAccuracy, ...]
    motions: tuple[MotionAccuracy, ...] = ()
    events: tuple[Event, ...] = ()
    counters: Mapping[str, int] = field(default_factory=dict)
    still: StillLevel | None = None
    azimuth: Array = field(default_factory=_none)
    model_azimuth: Array = field(default_factory=_none)
    flags: NDArray[np.int64] = field(default_factory=_no_flags)
    verified: Mapping[str, Verification] = field(default_factory=dict)
    model: Model | None = None
    limits: MonitorSettings | None = None
    limit_changes: tuple[tuple[int, MonitorSettings], ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def verification(self) -> Verification | None:
        """Comparison of replayed with recorded estimates, or None if none were recorded."""
        return self.verified.get(ESTIMATE)

    @property
    def comparisons(self) -> Verification | None:
        """Comparison of replayed with recorded monitor results, or None if none were recorded."""
        return self.verified.get(COMPARISON)

    @property
    def t(self) -> Array:
        """Time stamps (N,) of the images [s]."""
        return np.asarray(self.stamps * 1e-9, dtype=np.float64)

    @property
    def seconds(self) -> float:
        """Time from the first to the last image [s]; 0 without images."""
        return float(self.stamps[-1] - self.stamps[0]) * 1e-9 if len(self.stamps) else 0.0

    def __repr__(self) -> str:
        told = [f"{len(self.stamps)} images, {self.seconds:.3g} s"]
        told += [f"{row.name} MAE {1e3 * row.sigma:.2f} mm" for row in self.accuracy[-1:]]
        told += [f"{len(self.events)} events"] if self.events else []
        if self.verification is not None:
            same = f"{self.verification.identical} of {self.verification.recorded}"
            told.append(f"{same} bit for bit")
        return f"ReplayResult({self.name}: {', '.join(told)})"

    def to_pandas(self) -> DataFrame:
        """Returns a pandas table of measured and modelled heights at the images [m].

        The index is `t`, the time since the first image [s]; `stamp` is the image's own [ns].

        Raises:
            ImportError: pandas is not installed.
        """
        columns = {"stamp": self.stamps, "measured": self.measured, **self.heights}
        if len(self.flags) == len(self.stamps):
            columns["flags"] = self.flags
        units = {"stamp": "ns", **({"flags": "1"} if "flags" in columns else {})}
        return table(self._since_start, columns, units=units)

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws measured and modelled heights over the time since the first image.

        Args:
            axes: matplotlib's; None: of a new figure.

        Raises:
            ImportError: matplotlib is not installed.
        """
        axes = height_axes(axes, self.name)
        t = self._since_start
        axes.plot(t, 1e3 * self.measured, ".", color="black", ms=3, label="measured")
        for name, heights in self.heights.items():
            axes.plot(t, 1e3 * heights, label=name)
        axes.legend()
        return axes

    @property
    def _since_start(self) -> Array:
        first = self.stamps[0] if len(self.stamps) else 0
        return np.asarray((self.stamps - first) * 1e-9, dtype=np.float64)

    def to_json(self, *, series: bool = False) -> str:
        """Returns the result as JSON; an unknown number is null.

        Args:
            series: also the series at the images.
        """
        verified = {
            "verification": self.verification,
            "comparisons": self.comparisons,
            **{n: v for n, v in self.verified.items() if n not in (ESTIMATE, COMPARISON)},
        }
        document: dict[str, Any] = {
            "name": self.name,
            "source": self.source,
            "accuracy": plain(self.accuracy),
            "motions": plain(self.motions),
            **{
                name: None if found is None else {**plain(found), "exact": found.exact}
                for name, found in verified.items()
            },
            "events": plain(self.events),
            "counters": dict(self.counters),
            "still": plain(self.still),
            "warnings": list(self.warnings),
        }
        if series:
            document["series"] = {
                "t": plain(self.t),
                "measured": plain(self.measured),
                **plain(self.heights),
            }
        return json.dumps(document, indent=2, allow_nan=False)


class Judged(Protocol):
    """Interface of a run with a name and the accuracy of each model."""

    @property
    def name(self) -> str:
        """Name of the run."""

    @property
    def accuracy(self) -> tuple[ModelAccuracy, ...]:
        """Accuracy of each model, by model name."""
