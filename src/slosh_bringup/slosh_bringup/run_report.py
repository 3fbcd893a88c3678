"""Turns a recorded run into a report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.detect.source import bag_frames
from slosh_bringup.run_data import RecordedEvent, RunData
from slosh_bringup.run_result import RunResult
from slosh_camera.calibration import AnyCalibration
from slosh_camera.drawing import draw_measurement
from slosh_camera.errors import SloshCameraError
from slosh_camera.learnt import learnt_detector
from slosh_discovery.report import Frame, KeyFigure, ModelRow, RunReport, Span, Topic

SOURCES = ("measured", "estimated", "disagreement")
START = 0


def make_report(
    data: RunData, result: RunResult, title: str, model_text: str, calibration: AnyCalibration
) -> RunReport:
    """The report of a recorded run."""
    limits = [event.limit for event in data.events if event.source == 0]
    return RunReport(
        title=title,
        subtitle=f"{data.seconds[-1]:.1f} s, {len(data.stamps)} images"
        if len(data.stamps)
        else "",
        t=data.seconds,
        measured=data.columns["measured"],
        linear=data.columns["estimated_linear"],
        nonlinear=data.columns["estimated_nonlinear"],
        linear_name=data.models[0],
        nonlinear_name=data.models[1],
        limit=limits[0] if limits else None,
        key_figures=key_figures(data, result),
        events=spans(data),
        models=tuple(
            ModelRow(row.name, row.sigma, row.epsilon, row.rms, count=row.count)
            for row in result.agreements
        ),
        frames=frames(data, calibration),
        topics=topics(data),
        model_text=model_text,
        notes=data.warnings,
    )


def key_figures(data: RunData, result: RunResult) -> tuple[KeyFigure, ...]:
    """The numbers on top of the page."""
    best = result.agreements[0]
    latency = result.latency.get("monitor", (math.nan, math.nan))
    measured = data.columns["measured"]
    peak = np.nanmax(measured) if np.isfinite(measured).any() else math.nan
    return (
        KeyFigure("highest measured", _rounded(1e3 * peak, 1), "mm"),
        KeyFigure("σ", _rounded(1e3 * best.sigma, 2), "mm", best.name),
        KeyFigure("ε", _rounded(1e2 * best.epsilon, 1), "%", best.name),
        KeyFigure(
            "latency", _rounded(1e3 * latency[0], 0), "ms",
            f"image to comparison, median; maximum {_rounded(1e3 * latency[1], 0)} ms",
        ),
        KeyFigure("limit events", str(result.events)),
        KeyFigure(
            "lost messages", str(sum(result.lost.values())), "",
            f"{sum(result.dropped.values())} samples dropped",
        ),
    )  # fmt: skip


def spans(data: RunData) -> tuple[Span, ...]:
    """The excesses, from the starts and ends of the events."""
    origin = data.stamps[0] if len(data.stamps) else 0
    ends: Mapping[int, RecordedEvent] = {e.id: e for e in data.events if e.kind != START}
    found = []
    for event in data.events:
        if event.kind != START:
            continue
        end = ends.get(event.id)
        last = end or event
        found.append(
            Span(
                SOURCES[event.source],
                (event.stamp_ns - origin) * 1e-9,
                (end.stamp_ns - origin) * 1e-9 if end else math.nan,
                event.limit,
                last.peak,
                last.description,
            )
        )
    return tuple(found)


def topics(data: RunData) -> tuple[Topic, ...]:
    """The recorded topics with their mean rates."""
    length = data.seconds[-1] if len(data.stamps) > 1 else math.nan
    return tuple(
        Topic(name, info.message_type, info.count or 0, (info.count or 0) / length)
        for name, info in sorted(data.topics.items())
    )


def frames(data: RunData, calibration: AnyCalibration) -> tuple[Frame, ...]:
    """Three images with the detected line: still, highest, and farthest from the model."""
    wanted = moments(data)
    images = find_images(data.bag, set(wanted.values()))
    detector = learnt_detector(calibration)
    found = []
    for label, moment in wanted.items():
        if moment not in images:
            continue
        try:
            image = images[moment].image()
            measurement = detector.measure(moment, image)
        except SloshCameraError:
            continue
        picture = draw_measurement(image, calibration, measurement)
        data_jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 85])[1].tobytes()
        second = (moment - data.stamps[0]) * 1e-9
        found.append(Frame(data_jpeg, f"{label}: {second:.2f} s, {1e3 * measurement.msh:.1f} mm"))
    return tuple(found)


def moments(data: RunData) -> dict[str, int]:
    """Stamps of the images worth showing, by what they show."""
    measured = data.columns["measured"]
    residual = np.abs(measured - data.columns["estimated_nonlinear"])
    wanted = {}
    if np.isfinite(measured).any():
        wanted["first image"] = int(data.stamps[np.flatnonzero(np.isfinite(measured))[0]])
        wanted["highest"] = int(data.stamps[np.nanargmax(measured)])
    if np.isfinite(residual).any():
        wanted["largest residual"] = int(data.stamps[np.nanargmax(residual)])
    return wanted


def find_images(bag: Path, stamps: set[int]) -> dict[int, SourceFrame]:
    """The images with these stamps; none where the bag has no images."""
    try:
        return {frame.stamp_ns: frame for frame in bag_frames(bag, stamps)}
    except SloshBagError:
        return {}


def _rounded(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if math.isfinite(value) else "–"
