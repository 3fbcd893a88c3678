"""Result of a discovery as plain values in SI units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import TYPE_CHECKING

import numpy as np

from slosh_base.types import Array
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model.for_notebooks import Shown, counted, height_axes, table
from slosh_model.model import Model
from slosh_model.simulate import Inputs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

NAN = float("nan")


class Verdict(Enum):
    """Possible outcomes of a discovery: effect named, none, ambiguous or unexplained."""

    NAMED = "named"
    NONE = "none"
    AMBIGUOUS = "ambiguous"
    UNEXPLAINED = "unexplained"


class Role(Enum):
    """Purpose of a motion: fitted, or held out for validation."""

    FIT = "fit"
    HOLDOUT = "holdout"


@dataclass(frozen=True, slots=True)
class FittedParameters:
    """Fitted parameters of one physical effect, with standard errors.

    Attributes:
        parameters: fitted values, all of them, in the effect's order.
        standard_errors: of the fitted ones.
    """

    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float]


@dataclass(frozen=True, slots=True)
class FoundEffect:
    """A physical effect that the discovery names, with its parameters and confidence.

    Attributes:
        name: its id.
        parameters: fitted values, all of them, in the effect's order; empty where each group of
            motions has its own.
        standard_errors: of the fitted ones.
        confidence: probability that it is right, in [0, 1]: 0.5 says that another is as likely.
        alternatives: ids that explain the data in its place about as well, the likeliest first.
        refitted: True where the model had the effect already and only its parameters changed.
        by_group: the parameters of each group, where they differ; else empty.
    """

    name: str
    parameters: Mapping[str, float]
    standard_errors: Mapping[str, float]
    confidence: float
    alternatives: tuple[str, ...] = ()
    refitted: bool = False
    by_group: Mapping[str, FittedParameters] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Candidate:
    """A candidate model that was tried: one or several physical effects added to the base model.

    Attributes:
        effects: ids; empty: the base model as it is.
        parameters: fitted values by effect, of those that are the same for all motions.
        by_group: the others' by group of motions and effect.
        probability: among all explanations tried, in [0, 1].
        evidence: log of the evidence over the base model's.
        fit_rms: root mean square of the residual over the motions of the fit [m], of the heights
            as they were measured: where they are the wall's by azimuth, of all of these.
        holdout_rms: over motions that the parameters were not fitted to [m]; NaN: none.
        reason: why it was not fitted ("the motions have no yaw"); empty where it was.
    """

    effects: tuple[str, ...]
    parameters: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    probability: float = 0.0
    evidence: float = 0.0
    fit_rms: float = NAN
    holdout_rms: float = NAN
    reason: str = ""
    by_group: Mapping[str, Mapping[str, Mapping[str, float]]] = field(default_factory=dict)

    @property
    def per_group(self) -> tuple[str, ...]:
        """Ids of the physical effects whose parameters differ between groups of motions."""
        return tuple(next(iter(self.by_group.values()), {}))


@dataclass(frozen=True, slots=True)
class HeightGap:
    """Rms residuals [m] of the maximum height at the wall, before and after the discovery.

    Attributes:
        noise: of the measurement.
        fit_before, fit_after: of the residual over the motions of the fit.
        holdout_before, holdout_after: over the others; NaN: none.
        fit_closed, holdout_closed: share of the removable gap that the found model closes on
            these motions, over their own noise: see `closed_share`.

    >>> gap = HeightGap(2e-4, 1e-3, 3e-4, 1e-3, 4e-4, fit_closed=0.95, holdout_closed=0.87)
    >>> gap.closed  # on held-out motions
    0.87
    """

    noise: float
    fit_before: float
    fit_after: float
    holdout_before: float
    holdout_after: float
    fit_closed: float
    holdout_closed: float

    @property
    def closed(self) -> float:
        """Fraction of the error that is removed, on held-out motions or else on fitted ones."""
        held_out = math.isfinite(self.holdout_before)
        return self.holdout_closed if held_out else self.fit_closed


@dataclass(frozen=True, slots=True)
class Agreement:
    """Agreement of one model's heights with the measured heights of a motion.

    Attributes:
        rms: [m].
        sigma: mean absolute error [m] (DL22, eq. (33)).
        epsilon: relative error of the peak (DL22, eq. (32)).
        peak: the model's highest height [m].
    """

    rms: float
    sigma: float
    epsilon: float
    peak: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class MotionFinding:
    """A motion with the heights of the base model and of the discovered model.

    Attributes:
        motion: the motion.
        role: whether the fit saw it.
        noise: standard deviation of its measurement noise [m].
        clock_offset: measured minus inputs' clock, found or 0 [s].
        level: height at rest, found or 0 [m].
        before_heights, after_heights: (M, 1) or (M, K) the models' answers at the measured
            samples, on the measured clock and level [m].
        before, after: agreement with the measured peak heights.
    """

    motion: MeasuredMotion
    role: Role
    noise: float
    clock_offset: float
    level: float
    before_heights: Array
    after_heights: Array
    before: Agreement
    after: Agreement

    def __repr__(self) -> str:
        before, after = 1e3 * self.before.rms, 1e3 * self.after.rms
        return (
            f"MotionFinding({self.motion.name}, {self.role.value}: "
            f"rms {before:.2f} mm before, {after:.2f} mm after)"
        )

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draws a motion's measured heights with those of the base and of the discovered model.

        Args:
            axes: matplotlib's; None: of a new figure.

        Raises:
            ImportError: matplotlib is not installed.
        """
        axes = height_axes(axes, self.motion.name)
        t = self.motion.t
        axes.plot(t, 1e3 * self.motion.peak_heights, ".", color="black", ms=3, label="measured")
        for heights, name in ((self.before_heights, "before"), (self.after_heights, "after")):
            axes.plot(t, 1e3 * heights.max(axis=1), label=name)
        axes.legend()
        return axes

    @property
    def samples(self) -> int:
        """Number of measured heights."""
        return int(np.count_nonzero(np.isfinite(self.motion.heights)))


@dataclass(frozen=True, slots=True)
class WhereRow:
    """Residuals before and after the discovery in one part of the data, such as a time range.

    Attributes:
        by: "phase", "time", "amplitude", "direction", "frequency" or "input".
        label: the part, for people: "dwell", "10 … 15 mm", "near ω₁ (2.5 … 3.5 Hz)".
        before, after: rms of the residual in it [m]; for "input" the size of the correlation of
            the residual's envelope with the input, in [0, 1].
        share: share of the base model's squared residual, in [0, 1]; NaN for "input".
        samples: how many samples.
    """

    by: str
    label: str
    before: float
    after: float
    share: float
    samples: int


@dataclass(frozen=True, slots=True)
class WorstMoment:
    """A time at which the residual of the base model is largest.

    Attributes:
        motion: name.
        t: on the measured clock [s].
        measured, before, after: heights [m].
    """

    motion: str
    t: float
    measured: float
    before: float
    after: float


@dataclass(frozen=True, slots=True, eq=False)
class SeparatingMotion:
    """A motion that distinguishes two candidate models.

    Attributes:
        names: the two explanations, as ids joined by " + ".
        inputs: the motion.
        description: what it is, for people.
        difference: rms by which their heights differ in it [m].
        present_difference: rms by which they differ in the present motions [m].
    """

    names: tuple[str, str]
    inputs: Inputs
    description: str
    difference: float
    present_difference: float


@dataclass(frozen=True, slots=True)
class Proposal:
    """A generic equation term, proposed if no listed effect explains the data.

    Attributes:
        terms: each term with its coefficient, for people: ("J q̇", 1.3, "1/s").
        equation: the proposed equation's addition, as text.
        explained: share of the remaining removable gap that it explains on the fit, in [0, 1].
    """

    terms: tuple[tuple[str, float, str], ...]
    equation: str
    explained: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Finding(Shown):
    """The complete result of a discovery.

    Attributes:
        verdict: how it ends.
        base: the model that came in.
        model: the model that goes out; the base itself where nothing is added. Without the
            effects that each group of motions has its own parameters of.
        effects: what is named; for AMBIGUOUS the likeliest explanation, with its alternatives.
        confidence: probability that the whole set of named effects is right, in [0, 1].
        gap: the disagreement in numbers.
        motions: every motion, those of the fit first.
        where: the residual by part.
        worst: the worst moments, the worst first.
        candidates: every explanation tried, the likeliest first, then those not fitted.
        separating: the motions that would tell the alternatives apart.
        proposal: for UNEXPLAINED.
        remarks: what the reader must know, a sentence each.
        group_models: the whole model of each group of motions; empty where they do not differ.
    """

    verdict: Verdict
    base: Model
    model: Model
    effects: tuple[FoundEffect, ...]
    confidence: float
    gap: HeightGap
    motions: tuple[MotionFinding, ...]
    where: tuple[WhereRow, ...] = ()
    worst: tuple[WorstMoment, ...] = ()
    candidates: tuple[Candidate, ...] = ()
    separating: tuple[SeparatingMotion, ...] = ()
    proposal: Proposal | None = None
    remarks: tuple[str, ...] = ()
    group_models: Mapping[str, Model] = field(default_factory=dict)

    @property
    def changed(self) -> bool:
        """Whether the discovered model differs from the base model."""
        return self.model != self.base or bool(self.group_models)

    def __repr__(self) -> str:
        names = " + ".join(effect.name for effect in self.effects)
        named = f" {names} ({self.confidence:.2f})" if names else ""
        gap = self.gap
        told = f"rms {1e3 * gap.fit_before:.2f} → {1e3 * gap.fit_after:.2f} mm"
        if math.isfinite(gap.holdout_before):
            held = f"{1e3 * gap.holdout_before:.2f} → {1e3 * gap.holdout_after:.2f} mm"
            told += f", held out {held}"
        return (
            f"Finding({self.verdict.value}{named}, {told}, {counted(len(self.motions), 'motion')})"
        )

    def to_pandas(self) -> DataFrame:
        """Returns a pandas table of the fitted candidate models, the most probable first.

        Columns: `probability`, `evidence` (log, over the base model's), `fit_rms` and
        `holdout_rms` [m], by the effects' ids joined by " + "; of the base model "".

        Raises:
            ImportError: pandas is not installed.
        """
        fitted = [row for row in self.candidates if not row.reason]
        columns = ("probability", "evidence", "fit_rms", "holdout_rms")
        return table(
            [" + ".join(row.effects) for row in fitted],
            {name: [getattr(row, name) for row in fitted] for name in columns},
            index="effects",
            units={"probability": "1", "evidence": "1"},
        )

    def plot(self, motion: int = 0, axes: Axes | None = None) -> Axes:
        """Draws a motion with the base and discovered model's heights; see `MotionFinding.plot`.

        Args:
            motion: which of `motions`.
            axes: matplotlib's; None: of a new figure.
        """
        return self.motions[motion].plot(axes)
