"""Contents of a validation report, in SI units; NaN means unknown."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

from slosh_report.page.units import unit_style
from slosh_report.run_report.rows import ExcessSpan, Fact, ModelRow, RunMotion

NAN: Final = float("nan")
ROLES: Final = ("Prepared by", "Checked by", "Approved by")


class Verdict(StrEnum):
    """Result of judging a value against an acceptance limit."""

    PASS = "pass"
    FAIL = "fail"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Criterion:
    """An acceptance criterion with its result.

    Attributes:
        name: the judged quantity.
        recording: name of the judged recording; empty: all recordings together.
        value: found.
        uncertainty: expanded uncertainty of the value (k = 2); NaN: unknown.
        limit: greatest accepted value.
        unit: in which the report shows it, one of UNITS; the numbers are in SI units.
        verdict: pass, fail or undecided.
        reason: why, one line; empty: the numbers say it.

    Raises:
        SloshReportError: another unit.
    """

    name: str
    recording: str
    value: float
    uncertainty: float
    limit: float
    unit: str
    verdict: Verdict
    reason: str = ""

    def __post_init__(self) -> None:
        unit_style(self.unit)


@dataclass(frozen=True, slots=True)
class SignedFile:
    """Name, size and digest of a file that a validation report is based on.

    Attributes:
        role: what it is, such as "recording" or "model".
        path: as given on the command line.
        size: [bytes].
        sha256: digest of its content, in hexadecimal digits.
    """

    role: str
    path: str
    size: int
    sha256: str


@dataclass(frozen=True, slots=True)
class Peak:
    """The greatest measured height of a time span, with its uncertainty.

    Attributes:
        height: [m]; NaN: nothing was measured.
        uncertainty: expanded (k = 2) [m]; NaN: unknown.
        is_bound: the liquid left the view: the true height is at or above this one.
    """

    height: float = NAN
    uncertainty: float = NAN
    is_bound: bool = False


@dataclass(frozen=True, slots=True)
class Recording:
    """Data and results of one recording in a validation report.

    Attributes:
        name: of the recording.
        recorded: date and time of its first image or input, UTC.
        duration: from the first to the last image [s].
        images, samples: numbers of measured images and of input samples.
        lost, dropped: messages lost while recording; input samples dropped.
        gaps: start and end of each span without a measurement, on the report's time axis [s].
        flags: names of the measurement's flags, each with the number of images that have it.
        peak: greatest measured height.
        estimated_peak: greatest height of the nonlinear model [m].
        models, motions, events: as in the report of a replay.
        motion_peaks: of each motion, in the order of `motions`.
        reproduced, estimates: recorded estimates that the replay gave bit for bit, and all.
        warnings: about the recording, one line each.
    """

    name: str
    recorded: str
    duration: float
    images: int
    samples: int
    lost: int
    dropped: int
    gaps: tuple[tuple[float, float], ...]
    flags: tuple[tuple[str, int], ...]
    peak: Peak
    estimated_peak: float
    models: tuple[ModelRow, ...]
    motions: tuple[RunMotion, ...]
    events: tuple[ExcessSpan, ...]
    motion_peaks: tuple[Peak, ...]
    reproduced: int
    estimates: int
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LimitInForce:
    """A limit that the cell's monitor applied to liquid heights during a recording.

    Attributes:
        recording: name of the recording.
        quantity: what was limited, such as "measured height".
        limit: [m].
        origin: where the limit comes from, such as a parameter of the monitor.
    """

    recording: str
    quantity: str
    limit: float
    origin: str


@dataclass(frozen=True, slots=True)
class Repeatability:
    """Spread of one motion's greatest measured height over several recordings.

    Attributes:
        motion: its number in each recording, from 1.
        count: recordings in which it was measured.
        mean, deviation, lowest, highest: of the heights; the deviation is that of the sample [m].
        uncertainty: expanded (k = 2), of the difference of the highest and the lowest [m].
    """

    motion: int
    count: int
    mean: float
    deviation: float
    lowest: float
    highest: float
    uncertainty: float

    @property
    def spread(self) -> float:
        """Difference of the highest and the lowest height [m]."""
        return self.highest - self.lowest


@dataclass(frozen=True, slots=True)
class Signature:
    """A line for a handwritten signature.

    Attributes:
        role: such as "Prepared by".
        name: of the person; empty: to be filled in.
    """

    role: str
    name: str = ""


@dataclass(frozen=True, slots=True)
class ValidationReport:
    """The signed contents of a validation report.

    Attributes:
        title: heading.
        document: number of the document; empty: none was given.
        issued: date of issue as given, YYYY-MM-DD; empty: to be filled in by hand.
        verdict: of all criteria together.
        subject: container, liquid, model and motion.
        method: models, measurement, comparison and rule of decision.
        versions: software and digests of settings.
        files, recordings, limits, criteria, repeatability: tables.
        deviations: what was not as planned, one line each.
        open_points: what could not be judged and why, one line each.
        signatures: lines to be signed.
        model_text: the model file.
    """

    title: str
    document: str
    issued: str
    verdict: Verdict
    subject: tuple[Fact, ...]
    method: tuple[Fact, ...]
    versions: tuple[Fact, ...]
    files: tuple[SignedFile, ...]
    recordings: tuple[Recording, ...]
    limits: tuple[LimitInForce, ...]
    criteria: tuple[Criterion, ...]
    repeatability: tuple[Repeatability, ...] = ()
    deviations: tuple[str, ...] = ()
    open_points: tuple[str, ...] = ()
    signatures: tuple[Signature, ...] = tuple(Signature(role) for role in ROLES)
    model_text: str = ""


def overall(criteria: tuple[Criterion, ...]) -> Verdict:
    """Combines the verdicts of all criteria: the worst one, or undecided if there are none."""
    found = {criterion.verdict for criterion in criteria}
    if Verdict.FAIL in found:
        return Verdict.FAIL
    return Verdict.PASS if found == {Verdict.PASS} else Verdict.UNDECIDED
