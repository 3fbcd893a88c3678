"""What a cell works with: limits, topics, model and calibration, as its nodes tell it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from slosh_bag.reader import BagReader
from slosh_bag.replay import settings
from slosh_bag.replay.cells import CellTopics
from slosh_bag.replay.settings import NodeStart
from slosh_camera.calibration import Calibration, parse_any_calibration
from slosh_model.model_text import parse_model
from slosh_msgs_py import topics

TELLING = ("estimator", "camera", "monitor")
"""The nodes that publish their settings."""
_FIELDS = ("parameters", "topics", "files", "code", "arithmetic")

Starts = Mapping[str, NodeStart]
"""The last start of each node, by its name."""


def recorded_starts(bag: Path) -> dict[str, NodeStart]:
    """What the nodes of a recorded cell worked with; empty where the bag does not tell.

    Raises:
        SloshBagError: the bag or what a node says in it cannot be read.
    """
    reader = BagReader(bag)
    topic = CellTopics(reader.topics()).topic(settings.TOPIC, settings.MESSAGE_TYPE)
    if topic is None:
        return {}
    return {start.node: start for start in settings.read_starts(reader, topic)}


def in_force(starts: Starts) -> dict[str, str]:
    """What is in force, for people: a text by what it is about.

    Args:
        starts: of the nodes that have told; what the others would tell is left out.
    """
    rows: dict[str, str] = {}
    if "monitor" in starts:
        rows["limits"] = _limits(starts["monitor"].parameters)
    if "estimator" in starts:
        kind = starts["estimator"].parameters["input"]
        rows["input"] = f"{kind} from {topic_of(starts, 'estimator', kind)}"
    if "camera" in starts:
        transport = starts["camera"].parameters["transport"]
        rows["images"] = f"{transport} from {topic_of(starts, 'camera', image_topic(transport))}"
    answers = ", ".join(starts["monitor"].topics.values()) if "monitor" in starts else ""
    if answers:
        rows["answers"] = answers
    if "estimator" in starts:
        rows["model"] = _model(starts["estimator"])
    if "camera" in starts:
        rows["calibration"] = _calibration(starts["camera"])
    return rows


def in_force_lines(starts: Starts) -> list[str]:
    """The same as lines for the screen."""
    return [f"{label:<20}{text}" for label, text in in_force(starts).items()]


def settings_document(starts: Starts) -> str:
    """All that the nodes have told, as YAML."""
    document = {
        name: {field: _plain(getattr(start, field)) for field in _FIELDS}
        for name, start in starts.items()
    }
    text: str = yaml.safe_dump(document, sort_keys=True, allow_unicode=True)
    return text


def topic_of(starts: Starts, node: str, name: str) -> str:
    """The full name of a topic as a node has it; the name itself where it does not tell."""
    return starts[node].topics.get(name, name) if node in starts else name


def image_topic(transport: str) -> str:
    """The topic of the camera node's parameter `transport`."""
    return topics.IMAGE if transport == "raw" else topics.IMAGE_COMPRESSED


def _limits(parameters: Mapping[str, Any]) -> str:
    named = (
        ("measured", "measured_limit"),
        ("estimated", "estimated_limit"),
        ("disagreement", "disagreement_limit"),
    )
    return ", ".join(f"{name} {1e3 * parameters[key]:g} mm" for name, key in named)


def _model(start: NodeStart) -> str:
    model = parse_model(start.files["model"], "the estimator's model")
    effects = ", ".join(use.name for use in model.effects) or "no effects"
    cup = model.container
    # One that was loaded since has no file that the parameters name.
    path = "as loaded" if start.stamp_ns else start.parameters["model"]
    return (
        f"{path}: radius {1e3 * cup.radius:g} mm, "
        f"filled to {1e3 * cup.fill_height:g} mm; {effects}"
    )


def _calibration(start: NodeStart) -> str:
    calibration = parse_any_calibration(start.files["calibration"], "the calibration", None)
    camera = calibration.view.camera
    if isinstance(calibration, Calibration):
        cup = calibration.view.cup
        container = f"radius {1e3 * cup.radius:g} mm, filled to {1e3 * cup.fill_height:g} mm"
    else:
        box = calibration.view.box
        container = f"width {1e3 * box.width:g} mm, filled to {1e3 * box.fill_height:g} mm"
    path = start.parameters["calibration"]
    return f"{path}: {camera.width} x {camera.height} pixels; {container}"


def _plain(value: Any) -> Any:
    return dict(value) if isinstance(value, Mapping) else value
