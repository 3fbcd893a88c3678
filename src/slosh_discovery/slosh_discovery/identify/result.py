"""Result of an identification."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING

from slosh_base.types import Array
from slosh_discovery.discover.colour import Colour
from slosh_discovery.discover.finding import Role
from slosh_discovery.identify.information import Unidentified
from slosh_discovery.identify.trials import OperatingPoint
from slosh_discovery.identify.validity import LineLimit
from slosh_model.for_notebooks import Shown, counted, height_axes, table
from slosh_model.model import Model

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


class Strategy(Enum):
    """Which operating points a model covers: all together or each by itself (TM20, §2.4)."""

    SOSM = "sosm"
    MOSM = "mosm"


@dataclass(frozen=True, slots=True)
class FoundParameter:
    """An identified parameter with value, standard error and confidence interval.

    Attributes:
        name: as in model.yaml; of derived ones their own.
        unit: SI unit, "1" for none.
        before: what the model had.
        value: what was found.
        error: standard error.
        lower, upper: ends of the 95 % interval.
    """

    name: str
    unit: str
    before: float
    value: float
    error: float
    lower: float
    upper: float


@dataclass(frozen=True, slots=True, eq=False)
class IdentifiedModel:
    """An identified model and the data from which it was identified.

    Attributes:
        label: of the operating point; "all" for one of all motions.
        speed: n [1/min]; NaN: of all, or none.
        model: with its covariance.
        parameters: those fitted.
        derived: what follows from them: natural frequency and damping ratio of the first mode
            where they were not fitted themselves, TM20's p.
        correlations: (P, P) of the fitted parameters.
        held: parameters that these motions do not tell of; they keep their values.
        noise: of the measurement.
        outliers: share of the heights that stand out.
        scatter: by how much the standard errors were raised, as the motions differ by more than
            their noise explains; 1: they do not.
        seoe: root mean square residual over all its motions [m].
    """

    label: str
    speed: float
    model: Model
    parameters: tuple[FoundParameter, ...]
    derived: tuple[FoundParameter, ...]
    correlations: Array
    held: tuple[Unidentified, ...]
    noise: Colour
    outliers: float
    scatter: float
    seoe: float


@dataclass(frozen=True, slots=True, eq=False)
class FittedMotion:
    """A motion with the response of the identified model.

    Attributes:
        name: of the motion.
        point: label of its operating point.
        role: what it was used for.
        free_decay: whether its first state was fitted.
        t: (M,) [s].
        measured: (M, K) heights [m]; NaN: no sample.
        azimuths: (K,) [rad]; None: the maximum over the wall.
        before, after: (M, K) of the model that came in, and of the identified one [m].
        band: (M, K) half width of the 95 % band of `after` [m].
        clock_offset: measured minus inputs' clock [s].
        seoe_before, seoe: root mean square residuals [m].
        sigma, epsilon: mean absolute error of the highest height, relative error of its maximum.
    """

    name: str
    point: str
    role: Role
    free_decay: bool
    t: Array
    measured: Array
    azimuths: Array | None
    before: Array
    after: Array
    band: Array
    clock_offset: float
    seoe_before: float
    seoe: float
    sigma: float
    epsilon: float


@dataclass(frozen=True, slots=True)
class PointAgreement:
    """Agreement of the models with the motions of an operating point.

    Attributes:
        point: the point.
        repetitions: number of its motions.
        before: root mean square residual of the model that came in [m].
        sosm: of the model of this point alone [m]; NaN: there is none.
        mosm: of the model of all points [m].
    """

    point: OperatingPoint
    repetitions: int
    before: float
    sosm: float
    mosm: float


@dataclass(frozen=True, slots=True)
class DwellVibration:
    """Residual vibration at an operating point (TM20, eqs. (17)-(19)).

    Attributes:
        point: label of the operating point.
        repetitions: number of its motions.
        measured: greatest η_eff of them [m].
        line: Δη_appr, effective distance of the surface from the nearest lines [m].
        simulated: Δη_simul, that from the simulated lines [m].
    """

    point: str
    repetitions: int
    measured: float
    line: float
    simulated: float


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Identification(Shown):
    """Models, parameters and residuals of an identification.

    Attributes:
        base: the model that came in.
        strategy: which of the models are the answer.
        overall: of all motions.
        single: one for each operating point; empty: not asked for.
        points: how well they describe each operating point.
        motions: what they say of each motion: the point's own where the strategy is SOSM.
        line: up to which speed the surface is a line; None: no profiles tell.
        dwell: residual vibration by operating point, of motions with profiles.
        remarks: what the reader must know, a sentence each.
    """

    base: Model
    strategy: Strategy
    overall: IdentifiedModel
    single: tuple[IdentifiedModel, ...]
    points: tuple[PointAgreement, ...]
    motions: tuple[FittedMotion, ...]
    line: LineLimit | None
    dwell: tuple[DwellVibration, ...]
    remarks: tuple[str, ...]

    @property
    def model(self) -> Model:
        """The model identified from all motions, with its covariance."""
        return self.overall.model

    def __repr__(self) -> str:
        found = ", ".join(
            f"{one.name} {one.value:.4g} ± {one.error:.1g} {one.unit}".removesuffix(" 1")
            for one in self.overall.parameters
        )
        return (
            f"Identification({found}, f {self.model.natural_frequency_hz:.4g} Hz, "
            f"rms {1e3 * self.overall.seoe:.2f} mm, {counted(len(self.motions), 'motion')})"
        )

    def to_pandas(self) -> DataFrame:
        """Returns a pandas table of the parameters with error, interval and unit.

        Raises:
            ImportError: pandas is not installed.
        """
        rows = (*self.overall.parameters, *self.overall.derived)
        columns = ("before", "value", "error", "lower", "upper", "unit")
        return table(
            [row.name for row in rows],
            {name: [getattr(row, name) for row in rows] for name in columns},
            index="parameter",
            units=dict.fromkeys(columns, "as in the column unit"),
        )

    def plot(self, motion: int = 0, axes: Axes | None = None) -> Axes:
        """Draws the maximum heights of a motion, measured and of the identified model.

        Args:
            motion: which of `motions`.
            axes: matplotlib's; None: of a new figure.
        """
        one = self.motions[motion]
        axes = height_axes(axes, one.name)
        axes.plot(
            one.t, 1e3 * one.measured.max(axis=1), ".", color="black", ms=3, label="measured"
        )
        axes.plot(one.t, 1e3 * one.after.max(axis=1), label="identified")
        axes.legend()
        return axes
