"""Creates the validation report of recordings of one container and motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bag.held_folder import is_held
from slosh_camera.calibrate.camera_file import parse_any_calibration
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import Calibration
from slosh_fleet.validation.content import (
    ROLES,
    Criterion,
    Peak,
    Recording,
    Repeatability,
    Signature,
    ValidationReport,
    Verdict,
    overall,
)
from slosh_fleet.validation.criteria import Acceptance, Evidence, criteria_of
from slosh_fleet.validation.evidence import (
    deviations_of,
    evidence_of,
    limits_of,
    read_noise,
)
from slosh_fleet.validation.files import bag_files, signed_file
from slosh_fleet.validation.texts import method, subject, versions
from slosh_model.containers import Container
from slosh_model.model import Model
from slosh_model.model_text import format_model, read_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_motion.inputs.inputs import WantedInput
from slosh_motion.recorded.settings import first, latest, model_of
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay import ReplayResult, replay_bag
from slosh_replay.replay.report import Surroundings, replay_report
from slosh_report.run_report import RunReport

ALIKE, SHORTEST = 0.05, 0.1
"""Durations of one motion differ by at most this share, or this time [s]."""
LEAST = 1e-9  # m; a radius written to ten digits


@dataclass(frozen=True, slots=True)
class Order:
    """Contents and acceptance criteria that the user chooses for a validation report.

    Attributes:
        names: of the recordings.
        title: heading.
        document: number of the document.
        issued: date of issue, YYYY-MM-DD; empty: to be filled in by hand.
        motion: name of the motion.
        model: file of the container; None: the recorded model.
        cell: namespace of the cell; None: the only or first one.
        given: how the input is read; None: as the recorded estimator did.
        uncertainty: standard uncertainty of the measurement beside the camera's own [m].
        acceptance: greatest accepted values.
        signatures: lines to be signed.
    """

    names: tuple[str, ...]
    title: str = "Sloshing height of a moved container"
    document: str = ""
    issued: str = ""
    motion: str = ""
    model: Path | None = None
    cell: str | None = None
    given: WantedInput | None = None
    uncertainty: float = 0.0
    acceptance: Acceptance = field(default_factory=Acceptance)
    signatures: tuple[Signature, ...] = tuple(Signature(role) for role in ROLES)


class Assembled(NamedTuple):
    """A validation report, and the replay reports whose charts it contains."""

    report: ValidationReport
    runs: tuple[RunReport, ...]


class _Replayed(NamedTuple):
    """A recording with its replay, the replay's report and the evidence from both."""

    run: RecordedRun
    result: ReplayResult
    page: RunReport
    evidence: Evidence


def assemble(
    bags: Sequence[Path], order: Order, told: Callable[[], object] = lambda: None
) -> Assembled:
    """Replays recordings and creates their validation report.

    Args:
        bags: at least one; folders or files.
        order: what else the report says, and how it judges.
        told: is called after each replay.

    Raises:
        SloshBagError: a recording cannot be read, is still being recorded, or is of another
            container than the model or than the other recordings.
        SloshModelError: the model cannot be read.
        OSError: a file cannot be read.
    """
    given = None if order.model is None else read_model(order.model)
    found = []
    for bag, name in zip(bags, order.names, strict=True):
        found.append(_replayed(bag, name, given, order))
        told()
    model = _one_container(found)
    evidence = [one.evidence for one in found]
    repeats, refusal = repeatability([one.recording for one in evidence])
    criteria = criteria_of(evidence, repeats, order.acceptance)
    files = [file for bag in bags for file in bag_files(bag)]
    files += [] if order.model is None else [signed_file(order.model, "model")]
    runs, results = [one.run for one in found], [one.result for one in found]
    text = format_model(model)
    strange = [line for one in found for line in deviations_of(one.run, one.result)]
    report = ValidationReport(
        title=order.title,
        document=order.document,
        issued=order.issued,
        verdict=overall(criteria),
        subject=subject(model, results, order.motion),
        method=method(model, runs, results, order.uncertainty),
        versions=versions(runs, text),
        files=tuple(files),
        recordings=tuple(one.recording for one in evidence),
        limits=tuple(row for one in found for row in limits_of(one.run, one.result)),
        criteria=criteria,
        repeatability=repeats,
        deviations=(*_other_models(found, model), *strange),
        open_points=tuple(_open_points(criteria, refusal, found, order)),
        signatures=order.signatures,
        model_text=text,
    )  # fmt: skip
    return Assembled(report, tuple(one.page for one in found))


def _replayed(bag: Path, name: str, given: Model | None, order: Order) -> _Replayed:
    if is_held(bag):
        raise SloshBagError(f"{bag}: is being recorded; report on it when it is finished")
    run = RecordedRun(bag)
    if given is not None:
        _check_container(run, given.container, str(order.model))
    result = replay_bag(run, given, given=order.given, cell=order.cell)
    result = replace(result, name=name)
    if result.model is not None:
        _check_camera(run, result.model.container)
    page = replay_report(result, Surroundings())
    if order.acceptance.height is not None:
        page = replace(page, limit=order.acceptance.height, limit_name="accepted")
    noise = read_noise(run, order.cell, order.uncertainty)
    same = given is None or given == _recorded_model(run)
    return _Replayed(run, result, page, evidence_of(run, result, page, noise, same_model=same))


def _recorded_model(run: RecordedRun) -> Model | None:
    started = first(run.starts, "estimator")
    return model_of(started) if started is not None and "model" in started.files else None


def _check_container(run: RecordedRun, container: Container, source: str) -> None:
    """Raises an error if a recording's container differs from the given model's."""
    recorded = _recorded_model(run)
    if recorded is not None and not _same(recorded.container, container):
        raise SloshBagError(
            f"{run.path}: was recorded with another container ({_told(recorded.container)}) than "
            f"{source} has ({_told(container)}); give the model of the recorded container, or "
            "leave out --model: the recording holds it"
        )


def _check_camera(run: RecordedRun, container: Container) -> None:
    """Raises an error if the camera was calibrated for a round container of another size."""
    camera = latest(run.starts, "camera")
    text = camera.files.get("calibration") if camera else None
    if text is None or not isinstance(container, Cylinder):
        return
    try:
        calibration = parse_any_calibration(text, "the recorded calibration", None)
    except SloshCameraError:
        return
    if not isinstance(calibration, Calibration) or calibration.view.cup.taper:
        return
    cup = calibration.view.cup
    apart = max(abs(cup.radius - container.radius), abs(cup.fill_height - container.fill_height))
    if apart > LEAST:
        raise SloshBagError(
            f"{run.path}: the camera was calibrated for another container (radius "
            f"{1e3 * cup.radius:g} mm, filled to {1e3 * cup.fill_height:g} mm) than the model has "
            f"({_told(container)}); calibrate it for this container and record again"
        )


def _same(one: Container, other: Container) -> bool:
    return _told(one) == _told(other)


def _told(container: Container) -> str:
    return f"{container.shape}, {container.described}"


def _one_container(found: Sequence[_Replayed]) -> Model:
    """Returns the first recording's model; raises an error if the containers differ.

    Raises:
        SloshBagError: the recordings are of different containers, or a replay had no model.
    """
    models = [one.result.model for one in found]
    start = models[0]
    for one, model in zip(found, models, strict=True):
        if start is None or model is None:
            raise SloshBagError(f"{one.run.path}: no model is known; give one (--model)")
        if not _same(model.container, start.container):
            raise SloshBagError(
                f"{one.run.path}: is of another container ({_told(model.container)}) than "
                f"{found[0].run.path} ({_told(start.container)}); make a report for each"
            )
    if start is None:
        raise SloshBagError("no recording was given")
    return start


def _other_models(found: Sequence[_Replayed], model: Model) -> list[str]:
    lines = []
    for one in found:
        if one.result.model != model:
            lines.append(f"{one.result.name}: was estimated with another model than the first one")
        recorded = _recorded_model(one.run)
        if recorded is not None and recorded != one.result.model:
            lines.append(
                f"{one.result.name}: was recorded with another model of this container: its "
                "recorded estimates were not compared"
            )
    return lines


def repeatability(
    recordings: Sequence[Recording],
) -> tuple[tuple[Repeatability, ...], str]:
    """Computes the spread of each motion's peak over recordings, or the reason if impossible.

    Args:
        recordings: their data and results.

    Returns:
        one row for each motion; the reason, empty if there are rows or only one recording.
    """
    if len(recordings) < 2:
        return (), ""
    measured = [one for one in recordings if one.motions]
    if len(measured) < 2:
        return (), "repeatability: fewer than two recordings have a measured motion"
    spans = [[motion.end - motion.start for motion in one.motions] for one in measured]
    alike = all(
        len(own) == len(spans[0]) and np.allclose(own, spans[0], rtol=ALIKE, atol=SHORTEST)
        for own in spans
    )
    if not alike:
        return (), "repeatability: the recordings show different motions, by number or duration"
    columns = zip(*(one.motion_peaks for one in measured), strict=True)
    return tuple(_repeats(number, peaks) for number, peaks in enumerate(columns, start=1)), ""


def _repeats(motion: int, peaks: Sequence[Peak]) -> Repeatability:
    known = sorted((one for one in peaks if math.isfinite(one.height)), key=lambda one: one.height)
    if not known:
        return Repeatability(motion, 0, *[math.nan] * 5)
    heights = np.array([one.height for one in known])
    return Repeatability(
        motion,
        len(known),
        float(heights.mean()),
        float(heights.std(ddof=1)) if len(known) > 1 else math.nan,
        known[0].height,
        known[-1].height,
        math.hypot(known[0].uncertainty, known[-1].uncertainty),
    )


def _open_points(
    criteria: Sequence[Criterion], refusal: str, found: Sequence[_Replayed], order: Order
) -> list[str]:
    lines = [
        ": ".join(filter(None, (one.recording, one.name, one.reason)))
        for one in criteria
        if one.verdict is Verdict.UNDECIDED
    ]
    lines += [refusal] if refusal else []
    lines += [
        f"{one.result.name}: {one.evidence.doubt}"
        for one in found
        if one.evidence.doubt and not any(one.evidence.doubt in line for line in lines)
    ]
    if order.uncertainty == 0.0:
        lines.append(
            "What the camera's standard deviation does not hold, such as errors of the still "
            "level and of the calibration, is not part of U; --uncertainty adds it."
        )
    return lines
