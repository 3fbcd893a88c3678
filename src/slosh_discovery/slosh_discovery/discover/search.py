"""Searches for missing physical effects: adds them to the model one by one, and removes some.

Every single effect is fitted. Where the best leaves more than noise, the best few are extended:
for each further effect the linearised fit tells what it could gain, and the most promising are
fitted fully. Where the motions have groups, what belongs to the rig is fitted in both ways, with
the same parameters for all and with each group's own. An explanation whose part explains the data
as well is in the pool beside it, so that what a later effect explains better is dropped by the
comparison itself.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from slosh_base.types import Array
from slosh_discovery.discover.evidence import log_evidence, residual_series, temperature_of
from slosh_discovery.discover.explanation import Explanation, Key, Part, starts
from slosh_discovery.discover.fitting import Evaluator, Fit, fit
from slosh_discovery.discover.noise import removable
from slosh_discovery.discover.problem import PreparedMotion
from slosh_discovery.discover.tuning import TUNING
from slosh_model.effects.registry import EFFECTS
from slosh_model.model import Model

Progress = Callable[[str, float], None]

FORETOLD = tuple(
    name
    for name, effect in EFFECTS.items()
    if any(parameter.expected is not None for parameter in effect.parameters)
)
"""Effects whose size theory foretells: a handful of others would explain anything."""


@dataclass(frozen=True, slots=True, eq=False)
class Start:
    """Initial values of a fit, and the improvement that is expected from the fit."""

    explanation: Explanation
    vector: Array
    promise: float


@dataclass(slots=True)
class Pool:
    """All fitted candidate models, and the physical effects without influence on these motions."""

    motions: Sequence[PreparedMotion]
    fits: dict[Key, Fit] = field(default_factory=dict)
    without_effect: dict[str, str] = field(default_factory=dict)

    def add(self, fits: Iterable[Fit]) -> None:
        """Adds fits; of two fits with the same physical effects it keeps the better one."""
        for one in fits:
            known = self.find(one.explanation)
            if known is None or one.chi_square < known.chi_square:
                self.fits[one.explanation.key] = one

    def find(self, explanation: Explanation) -> Fit | None:
        """Returns the fit of a candidate model's effects, or None if they were not fitted."""
        return self.fits.get(explanation.key)

    @property
    def base(self) -> Fit:
        """The fit of the base model without added physical effects."""
        return self.fits[(), ()]

    def ranked(self) -> list[Fit]:
        """Returns the fits, the most probable first."""
        temperature = self.temperature
        return sorted(self.fits.values(), key=lambda one: -log_evidence(one, temperature))

    @property
    def temperature(self) -> float:
        """χ² per sample times correlation length of the most probable fit."""
        best = min(self.fits.values(), key=lambda one: one.chi_square)
        for _ in range(3):
            temperature = temperature_of(best, self.motions)
            best = max(self.fits.values(), key=lambda one: log_evidence(one, temperature))
        return temperature_of(best, self.motions)


@dataclass(frozen=True, slots=True)
class Leftover:
    """The part of a fit's residual that is correlated and thus no white noise.

    Attributes:
        mean_square: its mean square, in squares of the noise.
        stddev: standard deviation of that.
        tolerated: mean square that is hardly more than noise.
    """

    mean_square: float
    stddev: float
    tolerated: float = TUNING.adequate**2

    @property
    def adequate(self) -> bool:
        """Whether the residual is small enough to be explained by noise."""
        return self.mean_square < max(self.tolerated, TUNING.sure * self.stddev)


def leftover(one: Fit, motions: Sequence[PreparedMotion]) -> Leftover:
    """Returns the part of a fit's residual that is not noise."""
    parts = [
        removable(motion.t, series)
        for motion, series in zip(motions, residual_series(one.residual, motions), strict=True)
    ]
    counts = np.array([int(motion.kept.sum()) for motion in motions])
    weights = counts / counts.sum()
    mean = float(weights @ np.array([part.mean_square for part in parts]))
    spread = weights * np.array([part.mean_square_stddev for part in parts])
    coloured = any(motion.law is not None for motion in motions)
    driven = any(motion.driven is not None for motion in motions)
    share = (
        TUNING.adequate_driven
        if driven
        else TUNING.adequate_coloured
        if coloured
        else TUNING.adequate
    )
    slow = float(weights @ np.array([motion.slow_share for motion in motions]))
    return Leftover(mean, float(np.sqrt(spread @ spread)), share**2 + slow)


class Search:
    """One search for the physical effects that explain given motions.

    Args:
        base: the model that came in.
        motions: the data.
        clock_offsets: where each motion's offset starts [s].
        progress: told what is done and the share of it.
        threads: fits at a time.
    """

    def __init__(
        self,
        base: Model,
        motions: Sequence[PreparedMotion],
        clock_offsets: Sequence[float],
        progress: Progress,
        threads: int,
    ) -> None:
        groups = {motion.motion.group for motion in motions} - {None}
        self._base = Explanation(base, groups=tuple(sorted(filter(None, groups))))
        self._motions = motions
        self._offsets = tuple(clock_offsets)
        self._progress = progress
        self._threads = threads

    def run(self) -> Pool:
        """Fits all candidate models that are worth comparing."""
        pool = Pool(self._motions)
        with ThreadPoolExecutor(self._threads) as executor:
            self._executor = executor
            base = fit(self._base, self._motions, np.zeros(0), self._offsets)
            pool.add([base])
            self._progress("single effects", 0.05)
            self._extend(pool, base, len(EFFECTS), TUNING.starts_fitted)
            self._add_effects(pool)
            self._add_foretold(pool)
            self._replace_unlikely(pool)
            self._refine(pool)
        return pool

    def _add_effects(self, pool: Pool) -> None:
        """Extends the best models by further effects while the residual exceeds noise."""
        for size in range(1, TUNING.most_effects):
            ranked = pool.ranked()
            beam = [one for one in ranked if len(one.explanation.effects) == size]
            if not beam or leftover(ranked[0], self._motions).adequate:
                break
            self._progress(f"{size + 1} effects", 0.1 + 0.3 * size)
            for one in beam[: TUNING.beam if size == 1 else TUNING.beam // 2]:
                self._extend(pool, one, TUNING.promising, 1)

    def _add_foretold(self, pool: Pool) -> None:
        """Extends the best candidate models by effects whose size is predicted by theory."""
        for size in range(TUNING.most_effects, TUNING.most_foretold):
            best = pool.ranked()[: TUNING.beam_foretold]
            full = [one for one in best if len(one.explanation.effects) == size]
            if not full or leftover(best[0], self._motions).adequate:
                break
            self._progress(f"{size + 1} effects", 0.8)
            for one in full:
                self._extend(pool, one, TUNING.promising, 1, FORETOLD)

    def _replace_unlikely(self, pool: Pool) -> None:
        """Tries every other physical effect in place of an improbable effect.

        What is far from linear, as a wrong fill height is, promises little and does much.
        """
        best = pool.ranked()[0]
        for name in best.explanation.effects:
            if EFFECTS[name].odds < 1.0:
                without = best.explanation.without(name)
                start = Start(without, without.vector(_carried(best)), 0.0)
                pool.add(self._fit_all([start], best))
                self._extend(pool, pool.fits[without.key], len(EFFECTS), TUNING.starts_fitted)

    def _refine(self, pool: Pool) -> None:
        """Fits the best candidate models, and those that differ in one effect, to convergence."""
        self._progress("comparing", 0.9)
        best = pool.ranked()[: 2 * TUNING.beam]
        pool.add(
            self._executor.map(
                lambda one: fit(
                    one.explanation, self._motions, one.vector, one.clock_offsets, evaluations=30
                ),
                best,
            )
        )
        top = pool.ranked()[0]
        near = [
            Start(other, other.vector(_carried(top)), 0.0)
            for other in _neighbours(top.explanation)
            if pool.find(other) is None
        ]
        pool.add(self._fit_all(near, top))

    def _extend(
        self,
        pool: Pool,
        one: Fit,
        most: int,
        starts_each: int,
        among: Iterable[str] = EFFECTS,
    ) -> None:
        """Fits a candidate model with each of the most promising additional effects."""
        names = [
            name
            for name in among
            if self._may_join(name, one.explanation) and name not in pool.without_effect
        ]
        tried = list(self._executor.map(lambda name: self._starts(one, name), names))
        promising: list[tuple[float, list[Start]]] = []
        for name, (candidates, visible) in zip(names, tried, strict=True):
            if not visible and not one.explanation.effects:
                pool.without_effect[name] = "changes no height in these motions"
            elif candidates:
                best = sorted(candidates, key=lambda start: start.promise)
                apart = [start for start in best if name in start.explanation.per_group]
                whole = [start for start in best if name not in start.explanation.per_group]
                group = [*_distinct(whole, starts_each), *_distinct(apart, starts_each)]
                promising.append((best[0].promise, group))
        promising.sort(key=lambda entry: entry[0])
        chosen = [
            start
            for _, group in promising[:most]
            for start in group
            if starts_each > 1 or pool.find(start.explanation) is None
        ]
        pool.add(self._fit_all(chosen, one))

    @staticmethod
    def _ways(explanation: Explanation, name: str) -> tuple[bool, ...]:
        """Returns how an effect's parameters may differ: not at all, or between groups as well."""
        return (False, True) if _may_differ(explanation, name) else (False,)

    def _may_join(self, name: str, explanation: Explanation) -> bool:
        fits = EFFECTS[name].fits(explanation.base.container.section)
        if name in explanation.effects or not fits:
            return False
        # What the base has already can only be fitted anew.
        return not explanation.base.has(name) or any(
            parameter.choices is None for parameter in EFFECTS[name].parameters
        )

    def _fit_all(self, chosen: Sequence[Start], one: Fit) -> list[Fit]:
        def run(start: Start) -> Fit:
            return fit(start.explanation, self._motions, start.vector, one.clock_offsets)

        return list(self._executor.map(run, chosen))

    def _starts(self, one: Fit, name: str) -> tuple[list[Start], bool]:
        """Returns one more effect's initial values, and whether the effect changes the heights."""
        found, visible = [], False
        offsets = np.array(one.clock_offsets)
        carried = _carried(one)
        for (values, choices), per_group in itertools.product(
            starts(name), self._ways(one.explanation, name)
        ):
            wider = one.explanation.with_effect(name, choices, per_group=per_group)
            vector = wider.vector(_joined(carried, name, values))
            evaluator = Evaluator(wider, self._motions)
            residual = evaluator.residual(evaluator.answers(vector), offsets)
            change = (residual - one.residual)[:, np.newaxis]
            if np.max(np.abs(change)) < TUNING.visible:
                # The start is where the effect does nothing: what it could do from there.
                slopes = evaluator.derivative(vector, offsets, residual)
                change = slopes * wider.widths
                promise = _least(one.residual, change)
            else:
                promise = _promise(one, change)
            visible = visible or bool(np.any(np.abs(change) > TUNING.visible))
            found.append(Start(wider, vector, promise))
        return found, visible


def _carried(one: Fit) -> Part:
    """Returns a function that gives a fit's parameters by physical effect and group of motions."""
    explanation = one.explanation

    def part(name: str, group: str | None) -> dict[str, float]:
        if group is not None or name not in explanation.per_group:
            return explanation.part(one.vector, name, group)
        parts = [explanation.part(one.vector, name, known) for known in explanation.groups]
        return {key: float(np.mean([part[key] for part in parts])) for key in parts[0]}

    return part


def _joined(carried: Part, name: str, values: Mapping[str, float]) -> Part:
    """Returns a function of effect and group that also contains one more effect's parameters."""
    return lambda effect, group: values if effect == name else carried(effect, group)


def _neighbours(explanation: Explanation) -> list[Explanation]:
    """Returns candidate models with one effect less, or whose groups share other parameters."""
    apart = [
        replace(explanation, per_group=tuple(sorted((*explanation.per_group, name))))
        for name in explanation.effects
        if name not in explanation.per_group and _may_differ(explanation, name)
    ]
    return [*explanation.simpler(), *apart]


def _may_differ(explanation: Explanation, name: str) -> bool:
    """Returns whether an effect may have separate parameters for each group of motions."""
    free = any(parameter.choices is None for parameter in EFFECTS[name].parameters)
    return EFFECTS[name].of_rig and free and len(explanation.groups) > 1


def _promise(one: Fit, change: Array) -> float:
    """Returns the χ² that a linearised fit with one more effect predicts; smaller is better.

    Once with the change as it is (an effect may be far from small), once with a share of it.
    """
    moved = one.residual + change[:, 0]
    columns = one.jacobian
    as_it_is = _least(moved, columns)
    scaled = _least(one.residual, np.column_stack([columns, change]))
    return min(as_it_is, 0.5 * (scaled + min(as_it_is, one.chi_square)))


def _least(residual: Array, columns: NDArray[np.float64]) -> float:
    if columns.shape[1] == 0:
        return float(residual @ residual)
    sizes = np.maximum(np.linalg.norm(columns, axis=0), 1e-12)
    scaled = columns / sizes
    normal = scaled.T @ scaled + 1e-9 * np.eye(scaled.shape[1])
    gain = scaled.T @ residual
    return float(residual @ residual - gain @ np.linalg.solve(normal, gain))


def _distinct(best: Sequence[Start], count: int) -> list[Start]:
    """Returns the best initial values of the fit, at least one for each discrete choice."""
    chosen = list(best[:count])
    variants = {tuple(start.explanation.chosen.items()) for start in chosen}
    for start in best[count:]:
        variant = tuple(start.explanation.chosen.items())
        if variant not in variants:
            variants.add(variant)
            chosen.append(start)
    return chosen
