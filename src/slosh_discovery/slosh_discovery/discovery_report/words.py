"""Words and formatted numbers that a discovery's page, text and JSON share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.finding import Finding, FoundEffect, MotionFinding, Verdict
from slosh_model.effects.registry import EFFECTS
from slosh_report.page.units import DASH, shown

AS_IT_IS = "the model as it is"
LIKELY = 0.2
"""An explanation this likely, relative to the likeliest, is one of those that are left."""
PARTS = {
    "time": "time",
    "phase": "phase",
    "amplitude": "height",
    "direction": "direction",
    "frequency": "frequency",
    "input": "input",
}
"""What the rows of `where` are parts of, for people."""
PER_GROUP = "(per group)"
"""Behind an effect whose parameters each group of motions has its own of."""
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
"""Of the worst moments, the worst first, in charts, tables and captions."""

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


def part_name(by: str) -> str:
    """Returns the readable name of a criterion that divides the data, such as time or phase."""
    return PARTS.get(by, by)


def effect_title(name: str) -> str:
    """Returns the title of a physical effect, or its id if the effect is unknown."""
    return EFFECTS[name].title if name in EFFECTS else name


def effect_meaning(name: str) -> str:
    """Returns the meaning of a physical effect in one sentence; empty if it is unknown."""
    return EFFECTS[name].meaning if name in EFFECTS else ""


def explanation(names: Iterable[str]) -> str:
    """Joins the names of physical effects to the name of a candidate model."""
    return " + ".join(names) or AS_IT_IS


def marked(names: Iterable[str], per_group: Sequence[str]) -> list[str]:
    """Marks the ids of effects that have separate parameters for each group of motions."""
    return [f"{name} {PER_GROUP}" if name in per_group else name for name in names]


def listed(words: Sequence[str], last: str = "and") -> str:
    """Joins words, for example "a, b and c"."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def headline(finding: Finding) -> str:
    """Summarises the verdict in a few words."""
    if finding.verdict is Verdict.NONE:
        return "Nothing is missing"
    if finding.verdict is Verdict.UNEXPLAINED:
        gap = finding.gap
        left = gap.holdout_after if math.isfinite(gap.holdout_after) else gap.fit_after
        return f"Unexplained: a gap of {shown(left, 'mm')} mm remains"
    if finding.verdict is Verdict.AMBIGUOUS:
        _, rest = apart(rivals(finding))
        return "Not settled: " + listed(
            [" + ".join(map(effect_title, names)) or "nothing" for names in rest], "or"
        )
    added, changed = _split(finding.effects)
    parts = []
    if added:
        parts.append("Missing: " + listed([effect_title(effect.name) for effect in added]))
    if changed:
        word = "other parameters" if parts else "Other parameters"
        parts.append(f"{word}: " + listed([effect_title(effect.name) for effect in changed]))
    return "; ".join(parts) or "Missing: an effect"


def verdict_sentence(finding: Finding) -> str:
    """Describes the verdict in one sentence."""
    name = finding.base.name
    if finding.verdict is Verdict.NONE:
        return f"{name} lacks no effect that these motions show: its residual is noise."
    if finding.verdict is Verdict.AMBIGUOUS:
        common, rest = apart(rivals(finding))
        if len(rest) < 2:
            perhaps = explanation(names for only in rest for names in only)
            return f"Perhaps {name} lacks {perhaps}: these motions are not conclusive."
        sure = f"{listed(common)}, and " if common else ""
        found = listed([explanation(names) if names else "nothing" for names in rest], "or")
        return f"{name} lacks {sure}either {found}: these motions cannot distinguish them."
    if finding.verdict is Verdict.UNEXPLAINED:
        known = [effect.name for effect in finding.effects]
        nearest = f"; {explanation(known)} comes nearest" if known else ""
        return f"No listed effect closes the gap that {name} leaves{nearest}."
    confidence = f" (confidence {shown_confidence(finding.confidence)})"
    added, changed = _split(finding.effects)
    lacks = f"lacks {listed([effect.name for effect in added])}" if added else ""
    other = (
        f"has other parameters of {listed([effect.name for effect in changed])}" if changed else ""
    )
    return f"{name} {' and '.join(part for part in (lacks, other) if part)}{confidence}."


def gap_sentence(finding: Finding) -> str:
    """Describes in one sentence how much the discovery reduces the height error."""
    gap = finding.gap
    held = math.isfinite(gap.holdout_before)
    before = gap.holdout_before if held else gap.fit_before
    after = gap.holdout_after if held else gap.fit_after
    motions = "held-out motions" if held else "the fitted motions"
    noise = f"the noise is {shown(gap.noise, 'mm')} mm"
    if not finding.changed:
        return f"On {motions} the gap is {shown(before, 'mm')} mm; {noise}."
    sentence = (
        f"On {motions} the gap goes from {shown(before, 'mm')} to {shown(after, 'mm')} mm; {noise}"
    )
    if math.isfinite(gap.closed):
        sentence += (
            f", so {shown(gap.closed, '% of')} % of what a better model could remove is closed"
        )
    return sentence + "."


def rivals(finding: Finding) -> list[tuple[str, ...]]:
    """Returns the candidate models of an ambiguous result, the most probable first.

    Where no effect stands in another's place, those that are about as likely as the first one.
    """
    likeliest = tuple(effect.name for effect in finding.effects)
    found = [likeliest] if likeliest else []
    for effect in finding.effects:
        for other in effect.alternatives:
            place = [other if name == effect.name else name for name in likeliest]
            found.append(tuple(name for part in place for name in part.split(" + ")))
    if len(found) < 2:
        tried = [one for one in finding.candidates if not one.reason]
        least = LIKELY * max((one.probability for one in tried), default=0.0)
        found += [tuple(one.effects) for one in tried if one.probability >= least > 0.0]
    return list({frozenset(names): names for names in reversed(found)}.values())[::-1]


def apart(
    sets: Sequence[tuple[str, ...]],
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Returns the names that all sets contain, and the other names of each set."""
    if len(sets) < 2:
        return (), list(sets)
    common = tuple(name for name in sets[0] if all(name in names for names in sets))
    return common, [tuple(name for name in names if name not in common) for names in sets]


def _split(effects: Iterable[FoundEffect]) -> tuple[list[FoundEffect], list[FoundEffect]]:
    """Splits physical effects into added ones and those that only got new parameters."""
    effects = list(effects)
    return (
        [effect for effect in effects if not effect.refitted],
        [effect for effect in effects if effect.refitted],
    )


@dataclass(frozen=True, slots=True)
class ShownParameter:
    """A fitted parameter, formatted for display.

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
        """Formats the parameter, for example "tau = −12.3 ± 0.4 ms"."""
        error = "" if self.error == DASH else f" ± {self.error}"
        return f"{self.name} = {self.value}{error}{self.unit and ' '}{self.unit}"


def shown_parameter(effect: str, name: str, value: float, error: float = NAN) -> ShownParameter:
    """Formats a fitted parameter with its standard error.

    Args:
        effect, name: whose; of an effect that is not known the unit is not either.
        value: in its SI unit.
        error: its standard error; NaN: unknown.
    """
    return shown_value(name, si_unit(effect, name), value, error)


def shown_value(name: str, unit: str, value: float, error: float = NAN) -> ShownParameter:
    """Formats a value with its standard error, both with two digits of the error.

    Args:
        name: of the parameter.
        unit: SI unit, "1" for none.
        value, error: in it; NaN: unknown.
    """
    scale, shown_unit = PARAMETER_UNITS.get(unit, (1.0, unit))
    value, error = scale * value, scale * error
    if not (math.isfinite(error) and error > 0.0):
        return ShownParameter(name, minus(f"{value:.{SIGNIFICANT}g}"), DASH, shown_unit)
    digits = min(max(0, 1 - math.floor(math.log10(error))), MOST_DIGITS)
    return ShownParameter(name, minus(f"{value:.{digits}f}"), f"{error:.{digits}f}", shown_unit)


def si_unit(effect: str, name: str) -> str:
    """Returns a parameter's SI unit: "1" if dimensionless, empty if unknown."""
    parameters = EFFECTS[effect].parameters if effect in EFFECTS else ()
    return next((entry.unit for entry in parameters if entry.name == name), "")


def shown_confidence(value: float) -> str:
    """Formats a probability with two digits; never as exactly 0 or 1."""
    if not math.isfinite(value):
        return DASH
    if value >= 0.995:
        return "> 0.99"
    if value < 0.005:
        return "< 0.01"
    return f"{value:.2f}"


def residual_rms(finding: MotionFinding, heights: Array) -> float:
    """Returns the rms of measured minus modelled heights over all heights [m].

    Of wall heights by azimuth it counts each, not only the highest.
    """
    difference = (finding.motion.heights - heights).ravel()
    known = difference[np.isfinite(difference)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else NAN


def highest(values: Array, measured: Array) -> Array:
    """Returns the maximum (M,) [m] of a model's heights over the measured azimuths.

    Args:
        values: (M, K) the model's.
        measured: (M, K) NaN: no sample.
    """
    seen = np.isfinite(measured) & np.isfinite(values)
    top = np.where(seen, values, -np.inf).max(axis=1)
    return np.where(seen.any(axis=1), top, NAN)


def largest_share(shares: Iterable[float]) -> int | None:
    """Returns the index of the largest known fraction, or None if none is known."""
    known = [(share, -index) for index, share in enumerate(shares) if math.isfinite(share)]
    return -max(known)[1] if known else None


def millimetres(value: float) -> str:
    """Returns a height with its unit; a dash if it is not known."""
    return f"{shown(value, 'mm')} mm" if math.isfinite(value) else DASH


def minus(text: str) -> str:
    """Returns the text with a typographic minus sign."""
    return text.replace("-", "−")
