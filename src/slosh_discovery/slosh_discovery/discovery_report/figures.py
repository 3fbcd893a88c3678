"""Figures of a finding that the page, the text and the document show alike."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.finding import MotionFinding
from slosh_model.effects.registry import EFFECTS
from slosh_report.page.units import DASH

NAN = float("nan")
PARAMETER_UNITS = {
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
    "rad": (180.0 / math.pi, "°"),
    "1": (1.0, ""),
}
"""Scale and unit in which a parameter is shown; another unit is shown as it is."""
MOST_DIGITS = 9
SIGNIFICANT = 4
"""Digits of a value whose error is not known."""


@dataclass(frozen=True, slots=True)
class ShownParameter:
    """A parameter as people read it.

    Attributes:
        name: as in model.yaml.
        value, error: rounded to two digits of the error; an unknown error is a dash.
        unit: of both; may be empty.
    """

    name: str
    value: str
    error: str
    unit: str

    @property
    def text(self) -> str:
        """For example "tau = −12.3 ± 0.4 ms"."""
        error = "" if self.error == DASH else f" ± {self.error}"
        return f"{self.name} = {self.value}{error}{self.unit and ' '}{self.unit}"


def shown_parameter(effect: str, name: str, value: float, error: float = NAN) -> ShownParameter:
    """How a fitted parameter is shown.

    Args:
        effect, name: whose; of an effect that is not known the unit is not either.
        value: in its SI unit.
        error: its standard error; NaN: unknown.
    """
    scale, unit = parameter_unit(effect, name)
    value, error = scale * value, scale * error
    if not (math.isfinite(error) and error > 0.0):
        return ShownParameter(name, _minus(f"{value:.{SIGNIFICANT}g}"), DASH, unit)
    digits = min(max(0, 1 - math.floor(math.log10(error))), MOST_DIGITS)
    return ShownParameter(name, _minus(f"{value:.{digits}f}"), f"{error:.{digits}f}", unit)


def parameter_unit(effect: str, name: str) -> tuple[float, str]:
    """Scale from the SI unit to the shown one, and the shown one's name."""
    unit = si_unit(effect, name)
    return PARAMETER_UNITS.get(unit, (1.0, unit))


def si_unit(effect: str, name: str) -> str:
    """A parameter's unit, "1" for none; empty: not known."""
    parameters = EFFECTS[effect].parameters if effect in EFFECTS else ()
    return next((entry.unit for entry in parameters if entry.name == name), "")


def shown_confidence(value: float) -> str:
    """A probability with two digits; nothing that was measured reads as certain."""
    if not math.isfinite(value):
        return DASH
    if value >= 0.995:
        return "> 0.99"
    if value < 0.005:
        return "< 0.01"
    return f"{value:.2f}"


def residual_rms(finding: MotionFinding, heights: Array) -> float:
    """Root mean square of measured minus model over all measured heights [m].

    Of wall heights by azimuth it counts each, not only the highest.
    """
    difference = (finding.motion.heights - heights).ravel()
    known = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else NAN


def highest(values: Array, measured: Array) -> Array:
    """(M,) the highest of a model's heights where something was measured [m].

    Args:
        values: (M, K) the model's.
        measured: (M, K) NaN: no sample.
    """
    seen = np.isfinite(measured) & np.isfinite(values)
    top = np.where(seen, values, -np.inf).max(axis=1)
    return np.where(seen.any(axis=1), top, NAN)


def largest_share(shares: Iterable[float]) -> int | None:
    """Index of the largest known share; None: none is known."""
    known = [(share, -index) for index, share in enumerate(shares) if math.isfinite(share)]
    return -max(known)[1] if known else None


def _minus(text: str) -> str:
    return text.replace("-", "−")
