"""Describes the settings in effect in a robot cell: limits, topics, model, calibration."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable, Mapping
from typing import Any

from slosh_base.files.yaml_document import format_yaml
from slosh_camera.calibrate.camera_file import parse_any_calibration
from slosh_camera.optics.calibration import Calibration
from slosh_estimator.limits import Source
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_model.model import Model
from slosh_model.model_text import parse_model
from slosh_motion.inputs.inputs import TOPIC_NAMES
from slosh_motion.recorded.settings import NodeStart, after, last_of_each, tray_of
from slosh_msgs_py import topics
from slosh_replay.recorded_run import RecordedRun

_FIELDS = ("parameters", "topics", "files", "code", "arithmetic")

_NO_STILL = "no still image: an inverted or shifted picture is not detected"

Starts = Mapping[str, NodeStart]
"""The last start of each node, by its name."""


def last_starts(run: RecordedRun) -> dict[str, NodeStart]:
    """Returns the settings that each node recorded last; empty if none were recorded.

    Raises:
        SloshBagError: the bag or what a node says in it cannot be read.
    """
    return last_of_each(run.starts)


def in_force(starts: Starts) -> dict[str, str]:
    """Describes the settings in effect, one text for each subject.

    Args:
        starts: of the nodes that have told; what they do not tell is left out.
    """
    rows: dict[str, str] = {}
    for label, (node, text_of) in _ROWS.items():
        # A recording of old may lack a value; a report comes all the same.
        with contextlib.suppress(KeyError, TypeError, ValueError):
            rows[label] = text_of(starts[node])
    return {label: text for label, text in rows.items() if text}


def parameter_changes(run: RecordedRun, zero_ns: int) -> tuple[str, ...]:
    """Lists the parameter changes of running nodes in a recording, one line each.

    Args:
        run: the recording.
        zero_ns: the stamp from which times are told [ns].

    Raises:
        SloshBagError: the bag or what a node says in it cannot be read.
    """
    lines: list[str] = []
    known: dict[str, NodeStart] = {}
    for start in run.starts:
        before = known.get(start.node)
        earlier = before.parameters if before is not None else start.parameters
        for name in start.changed if before else ():
            old, new = earlier.get(name), start.parameters.get(name)
            if old is None and not start.stamp_ns:
                continue  # nothing changed: the node learned it when it started
            since = (start.stamp_ns - zero_ns) * 1e-9
            when = f"after {since:.3f} s" if start.stamp_ns else "before the first input"
            lines.append(f"{start.node}: {name} changed from {old} to {new} {when}")
        known[start.node] = after(before, start)
    return tuple(lines)


def in_force_lines(starts: Starts) -> list[str]:
    """Formats the settings in effect as lines of text."""
    return [f"{label:<20}{text}" for label, text in in_force(starts).items()]


def described(model: Model) -> str:
    """Describes a model's container and modelled effects in one line."""
    effects = ", ".join(use.name for use in model.effects) or "no effects"
    return f"{model.container.described}; {effects}"


def settings_document(starts: Starts) -> str:
    """Formats all recorded node settings as YAML."""
    document = {
        name: {field: _plain(getattr(start, field)) for field in _FIELDS}
        for name, start in starts.items()
    }
    return format_yaml(document, sort_keys=True, allow_unicode=True)


def topic_of(start: NodeStart | None, name: str) -> str:
    """Returns the full name of a node's topic; the relative name if the full one is unknown."""
    return start.topics.get(name, name) if start else name


def has_camera(starts: Starts) -> bool:
    """Returns whether the cell has a camera; true if the settings were not recorded."""
    monitor = starts.get("monitor")
    return monitor is None or bool(monitor.parameters.get("camera", True))


def input_topic(estimator: NodeStart | None) -> str:
    """Returns the topic of the estimator's input."""
    kind = estimator.parameters["input"] if estimator else topics.ACCEL
    return topic_of(estimator, TOPIC_NAMES.get(kind, kind))


def image_topic(camera: NodeStart | None) -> str:
    """Returns the topic of the camera node's images."""
    is_raw = camera is None or camera.parameters["transport"] == "raw"
    return topic_of(camera, topics.IMAGE if is_raw else topics.IMAGE_COMPRESSED)


def _limits(monitor: NodeStart) -> str:
    settings = MonitorSettings.from_partial(monitor.parameters)
    told = [
        f"{source.name.lower()} {1e3 * limit:.4g} mm"
        + f" ({settings.limit_name(source)})" * settings.at_rim(source)
        for source, limit in settings.limits.items()
        if math.isfinite(limit)
    ]
    if math.isfinite(settings.rim) and not settings.at_rim(Source.MEASURED):
        told.append(f"rim {1e3 * settings.rim:.1f} mm")
    return ", ".join(told)


def _model(estimator: NodeStart) -> str:
    model = parse_model(estimator.files["model"], "the estimator's model")
    # One that was loaded since has no file that the parameters name.
    path = "as loaded" if estimator.stamp_ns else estimator.parameters["model"]
    return f"{path}: {described(model)}"


def _tray(estimator: NodeStart) -> str:
    tray = tray_of(estimator)
    return "" if tray is None else f"{', '.join(tray.names)}; the model is that of the first"


def _camera(monitor: NodeStart) -> str:
    return (
        "" if monitor.parameters["camera"] else ("none configured: only the estimate is monitored")
    )


def _calibration(camera: NodeStart) -> str:
    calibration = parse_any_calibration(camera.files["calibration"], "the calibration", None)
    size = calibration.view.camera
    if isinstance(calibration, Calibration):
        cup = calibration.view.cup
        container = f"radius {1e3 * cup.radius:g} mm, filled to {1e3 * cup.fill_height:g} mm"
    else:
        box = calibration.view.box
        container = f"width {1e3 * box.width:g} mm, filled to {1e3 * box.fill_height:g} mm"
    path = camera.parameters["calibration"]
    still = camera.parameters["still_image"] or calibration.still_image
    known = f"still image {still}" if still else _NO_STILL
    return f"{path}: {size.width} x {size.height} pixels; {container}; {known}"


_ROWS: Mapping[str, tuple[str, Callable[[NodeStart], str]]] = {
    "limits": ("monitor", _limits),
    "input": ("estimator", lambda node: f"{node.parameters['input']} from {input_topic(node)}"),
    "images": ("camera", lambda node: f"{node.parameters['transport']} from {image_topic(node)}"),
    "camera": ("monitor", _camera),
    "answers": ("monitor", lambda node: ", ".join(node.topics.values())),
    "model": ("estimator", _model),
    "tray": ("estimator", _tray),
    "calibration": ("camera", _calibration),
}
"""Which node tells it, and how it is put."""


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value
