"""Images and topics of a bag for the HTML page of its replay."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from slosh_bag.errors import SloshBagError
from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.detect.source import frames_at
from slosh_camera.calibrate.camera_file import parse_any_calibration
from slosh_camera.detection.detectors import learnt_detector
from slosh_camera.detection.drawing import draw_measurement
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.calibration import AnyCalibration
from slosh_motion.recorded import settings
from slosh_replay.recorded_run import RecordedRun
from slosh_replay.replay.report import report_start, shown_models
from slosh_replay.replay.result import ReplayResult
from slosh_report.run_report import Frame, TopicRow

JPEG_QUALITY = 85


def bag_topics(run: RecordedRun, seconds: float) -> tuple[TopicRow, ...]:
    """Returns the topics of a bag with their message counts and mean rates.

    Args:
        run: the recording.
        seconds: length of the run [s].
    """
    return tuple(
        TopicRow(
            name,
            info.message_type,
            info.count or 0,
            (info.count or 0) / seconds if seconds > 0.0 else math.nan,
        )
        for name, info in sorted(run.topics.items())
    )


def bag_calibration(run: RecordedRun) -> AnyCalibration | None:
    """Returns the calibration that the camera node recorded; None if it recorded none."""
    started = settings.latest(run.starts, "camera")
    text = started.files.get("calibration") if started else None
    if started is None or text is None:
        return None
    # The bag holds the file's text; its still image lies where the node found it, if anywhere.
    folder = Path(str(started.parameters.get("calibration", ""))).parent
    try:
        calibration = parse_any_calibration(text, f"{run.path}: the recorded calibration", folder)
    except SloshCameraError:
        return None
    still = calibration.still_image
    if still is None or still.is_file():
        return calibration
    return replace(calibration, still_image=None)


def bag_pictures(run: RecordedRun, result: ReplayResult) -> tuple[Frame, ...]:
    """Returns the first image and the images of largest height and largest model error.

    None where the bag holds no images or does not say how its camera looks at the container.
    """
    wanted = moments(result)
    found = []
    for label, (jpeg, height) in pictures_at(run, wanted).items():
        second = (wanted[label] - report_start(result)) * 1e-9
        caption = f"{label}: {second:.2f} s, {1e3 * height:.1f} mm"
        found.append(Frame(jpeg, caption, time=second))
    return tuple(found)


def pictures_at(run: RecordedRun, wanted: Mapping[str, int]) -> dict[str, tuple[bytes, float]]:
    """Returns annotated images as JPEG and their measured heights [m], by label.

    Args:
        run: where they are.
        wanted: stamps by label [ns]; what is not there is left out.
    """
    calibration = bag_calibration(run)
    if calibration is None or not wanted:
        return {}
    try:
        images = frames_at(run.reader, set(wanted.values()))
    except SloshBagError:
        return {}
    if not images:
        return {}
    try:
        detector = learnt_detector(calibration)
    except SloshCameraError:
        return {}
    found = {}
    for label, stamp in wanted.items():
        frame = images.get(stamp)
        picture = None if frame is None else _picture(detector, calibration, stamp, frame)
        if picture is not None:
            found[label] = picture
    return found


def moments(result: ReplayResult) -> dict[str, int]:
    """Returns the stamps [ns] of the images to show, by label."""
    known = np.isfinite(result.measured)
    if not known.any():
        return {}
    wanted = {
        "first image": int(result.stamps[np.flatnonzero(known)[0]]),
        "highest": int(result.stamps[np.nanargmax(result.measured)]),
    }
    for name in shown_models(result)[1:]:
        residual = np.abs(result.measured - result.heights[name])
        if np.isfinite(residual).any():
            wanted["largest residual"] = int(result.stamps[np.nanargmax(residual)])
    return wanted


def _picture(
    detector: object, calibration: AnyCalibration, stamp: int, frame: SourceFrame
) -> tuple[bytes, float] | None:
    """Draws the measured line in an image; returns it as JPEG with the height [m]."""
    try:
        image = frame.image()
        measurement = detector.measure(stamp, image)  # type: ignore[attr-defined]
    except SloshCameraError:
        return None
    drawn = draw_measurement(image, calibration, measurement)
    jpeg = cv2.imencode(".jpg", drawn, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1].tobytes()
    return jpeg, measurement.msh
