"""Table and summary written by `slosh detect`."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from slosh_camera.measurement import Flag, Measurement

COLUMNS = (
    "t", "frame", "msh", "msh_stddev", "azimuth", "sh_left", "sh_right", "peak_u", "peak_v",
    "peak_side", "flags", "fitted_msh", "fitted_msh_stddev", "fitted_azimuth", "azimuth_left",
    "azimuth_right", "slope_angle",
)  # fmt: skip


def row(measurement: Measurement, name: str, first_ns: int) -> list[str]:
    """Formats one table row; NaN means unknown, flag names are joined by '|'."""
    numbers = (
        measurement.msh, measurement.msh_stddev, measurement.azimuth, measurement.sh_left,
        measurement.sh_right, *measurement.peak_pixel,
    )  # fmt: skip
    further = (
        measurement.fitted_msh, measurement.fitted_msh_stddev, measurement.fitted_azimuth,
        measurement.azimuth_left, measurement.azimuth_right, measurement.slope_angle,
    )  # fmt: skip
    return [
        f"{(measurement.stamp_ns - first_ns) * 1e-9:.6f}",
        name,
        *(f"{number:.7g}" for number in numbers),
        measurement.peak_side.name.lower(),
        "|".join(flag_names(measurement.flags)),
        *(f"{number:.7g}" for number in further),
    ]


def flag_names(flags: Flag) -> list[str]:
    """Returns the names of the flags that are set."""
    return [str(flag.name) for flag in flags]


@dataclass(slots=True)
class DetectionSummary:
    """Counts and heights of all images measured so far."""

    frames: int = 0
    problems: int = 0
    heights: list[float] = field(default_factory=list)
    sigmas: list[float] = field(default_factory=list)
    flags: Counter[str] = field(default_factory=Counter)

    @property
    def measured(self) -> int:
        """Number of images in which the liquid height was measured."""
        return len(self.heights)

    @property
    def mostly_unseen(self) -> bool:
        """Whether the surface was not found in more than half of the images."""
        return 2 * self.flags[str(Flag.NOT_FOUND.name)] > self.frames

    def add(self, measurement: Measurement, problem: str = "") -> None:
        """Adds an image's measurement, with the reason if it could not be measured."""
        self.frames += 1
        self.problems += bool(problem)
        self.flags.update(flag_names(measurement.flags))
        if math.isfinite(measurement.msh):
            self.heights.append(measurement.msh)
            if math.isfinite(measurement.msh_stddev):
                self.sigmas.append(measurement.msh_stddev)

    def facts(self) -> Mapping[str, Any]:
        """Returns the summary as a dictionary for JSON, in metres; unknown values are None."""
        return {
            "frames": self.frames,
            "measured": self.measured,
            "flags": dict(self.flags),
            "msh_min": min(self.heights, default=None),
            "msh_max": max(self.heights, default=None),
            "msh_stddev_median": statistics.median(self.sigmas) if self.sigmas else None,
        }

    def text(self) -> str:
        """Formats the summary as text, in millimetres."""
        words = f"{self.measured} of {self.frames} images measured"
        if self.heights:
            low, high = 1e3 * min(self.heights), 1e3 * max(self.heights)
            words += f", MSH {low:.1f} … {high:.1f} mm"
        if self.sigmas:
            words += f", median sigma {1e3 * statistics.median(self.sigmas):.2f} mm"
        if self.flags:
            counts = ", ".join(f"{name} {count}" for name, count in self.flags.most_common())
            words += f"; flags: {counts}"
        return words
