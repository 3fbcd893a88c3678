"""Rows of a report's tables in SI units; NaN means unknown."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

from slosh_report.page.units import unit_style

NAN = float("nan")
INFINITE = float("inf")


class RunVerdict(StrEnum):
    """Result of checking a run: passed, failed, or no expected values to compare with."""

    PASSED = "passed"
    FAILED = "failed"
    NO_EXPECTATION = "no expectation"


@dataclass(frozen=True, slots=True)
class Status:
    """Overall status of a run, as shown at the top of the report page.

    Attributes:
        verdict: of all checks together.
        reasons: why, one line each; the first one matters most.
    """

    verdict: RunVerdict = RunVerdict.NO_EXPECTATION
    reasons: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class CheckRow:
    """A checked number of a run, with its expected range.

    Attributes:
        name: what it is, for example "MAE 3D-NL".
        value: found.
        lower, upper: bounds, both allowed; infinite: none.
        unit: in which the page shows it, one of UNITS; the numbers are in SI units.

    Raises:
        SloshReportError: another unit.
    """

    name: str
    value: float
    lower: float = -INFINITE
    upper: float = INFINITE
    unit: str = ""

    def __post_init__(self) -> None:
        unit_style(self.unit)

    @property
    def expected(self) -> float:
        """Middle of the expected range; NaN unless both bounds are given."""
        return 0.5 * (self.lower + self.upper) if self._bounded else NAN

    @property
    def tolerance(self) -> float:
        """Half the width of the expected range; NaN unless both bounds are given."""
        return 0.5 * (self.upper - self.lower) if self._bounded else NAN

    @property
    def _bounded(self) -> bool:
        return abs(self.lower) < INFINITE and abs(self.upper) < INFINITE

    @property
    def passed(self) -> bool:
        """Whether the value is known and within its expected range."""
        return self.lower <= self.value <= self.upper


@dataclass(frozen=True, slots=True)
class DifferenceRow:
    """A message field that a replay did not reproduce.

    Attributes:
        topic: of the messages.
        field: with dots, for example "nonlinear.msh".
        count: messages that differ.
        first: moment of the first of them on the report's time axis [s].
        largest: greatest absolute difference, in the field's own unit.
        recorded, replayed: the two values of the first message that differs.
    """

    topic: str
    field: str
    count: int
    first: float = NAN
    largest: float = NAN
    recorded: float = NAN
    replayed: float = NAN


@dataclass(frozen=True, slots=True)
class VerificationRow:
    """Number of recorded messages that a replay has reproduced, with the differences.

    Attributes:
        name: what was compared, for example "recorded estimates reproduced bit for bit".
        same: how many came out the same.
        total: how many were compared.
        differences: fields that differ.
    """

    name: str
    same: int
    total: int
    differences: tuple[DifferenceRow, ...] = ()

    @property
    def passed(self) -> bool:
        """Whether all recorded messages were reproduced."""
        return self.same == self.total


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """A main result, shown at the top of the report page.

    Attributes:
        label: what it is.
        value: a number in SI units that the page rounds, or a text shown as it is.
        unit: in which it is shown; for a number one of UNITS.
        note: a few words below; may be empty.

    Raises:
        SloshReportError: a number with another unit.
    """

    label: str
    value: str | float
    unit: str = ""
    note: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.value, str):
            unit_style(self.unit)


@dataclass(frozen=True, slots=True)
class Fact:
    """Information about the run, such as the bag, its length or the program's version.

    Attributes:
        label: what it is.
        text: as it is shown.
    """

    label: str
    text: str


@dataclass(frozen=True, slots=True)
class ExcessSpan:
    """A time span in which the liquid's height exceeded a limit.

    Attributes:
        source: what exceeded it: "measured", "estimated", "disagreement".
        start, end: on the report's time axis [s]; end NaN: not over when the run ended.
        limit, peak: [m].
        description: one line.
        peak_time: moment of the peak [s].
    """

    source: str
    start: float
    end: float
    limit: float
    peak: float
    description: str = ""
    peak_time: float = NAN

    @property
    def duration(self) -> float:
        """Duration of the limit violation [s]; NaN if it has not ended."""
        return self.end - self.start


@dataclass(frozen=True, slots=True)
class ModelRow:
    """Agreement of one model with the measurement.

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
class RunMotion:
    """A motion of the run with each model's accuracy.

    Attributes:
        name: of the motion; may be empty: the page numbers the motions itself.
        start, end: on the report's time axis [s].
        peak: highest measured [m].
        models: one row per model.
    """

    name: str
    start: float
    end: float
    peak: float = NAN
    models: tuple[ModelRow, ...] = ()


@dataclass(frozen=True, slots=True)
class TopicRow:
    """A recorded topic and its number of messages.

    Attributes:
        name, type: as in the bag.
        count: messages.
        rate: [1/s]; NaN: too few messages.
        lost: messages that were published and are not in the bag; None: nobody counted.
    """

    name: str
    type: str
    count: int
    rate: float = NAN
    lost: int | None = None
