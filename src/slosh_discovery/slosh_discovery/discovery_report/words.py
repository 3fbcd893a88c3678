"""A finding in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from slosh_discovery.discover.finding import Finding, FoundEffect, Verdict
from slosh_discovery.discovery_report.figures import shown_confidence
from slosh_model.effects.registry import EFFECTS
from slosh_report.page.units import shown

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


def part_name(by: str) -> str:
    """What a row of `where` is a part of."""
    return PARTS.get(by, by)


def effect_title(name: str) -> str:
    """An effect's title; of one that is not known its id."""
    return EFFECTS[name].title if name in EFFECTS else name


def effect_meaning(name: str) -> str:
    """What an effect is, in a sentence; of one that is not known nothing."""
    return EFFECTS[name].meaning if name in EFFECTS else ""


def explanation(names: Iterable[str]) -> str:
    """A set of effects as one name."""
    return " + ".join(names) or AS_IT_IS


def marked(names: Iterable[str], per_group: Sequence[str]) -> list[str]:
    """The ids, those whose parameters each group of motions has its own of marked as such."""
    return [f"{name} {PER_GROUP}" if name in per_group else name for name in names]


def listed(words: Sequence[str], last: str = "and") -> str:
    """For example "a, b and c"."""
    if len(words) < 2:
        return "".join(words)
    return f"{', '.join(words[:-1])} {last} {words[-1]}"


def headline(finding: Finding) -> str:
    """The verdict in a few words."""
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
    """The verdict in one sentence."""
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
    """What became of the gap, in one sentence."""
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
    """The explanations that an ambiguous finding leaves, the likeliest first, as sets of ids.

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
    """What all sets share, and what is left of each."""
    if len(sets) < 2:
        return (), list(sets)
    common = tuple(name for name in sets[0] if all(name in names for names in sets))
    return common, [tuple(name for name in names if name not in common) for names in sets]


def _split(effects: Iterable[FoundEffect]) -> tuple[list[FoundEffect], list[FoundEffect]]:
    """Those that are new, and those whose parameters changed."""
    effects = list(effects)
    return (
        [effect for effect in effects if not effect.refitted],
        [effect for effect in effects if effect.refitted],
    )
