"""Tests that the layouts for Foxglove and PlotJuggler show existing topics and fields."""

import importlib
import json
from pathlib import Path
from xml.etree import ElementTree

from slosh_bringup.processes import config_folder

TYPES = {
    "/slosh/comparison": "slosh_msgs.msg.SloshComparison",
    "/slosh/estimate": "slosh_msgs.msg.SloshEstimate",
    "/slosh/free_surface": "slosh_msgs.msg.FreeSurface",
    "/slosh/limit_event": "slosh_msgs.msg.LimitEvent",
    "/slosh/camera/image_raw/compressed": "sensor_msgs.msg.CompressedImage",
    "/slosh/camera/camera_info": "sensor_msgs.msg.CameraInfo",
    "/diagnostics": "diagnostic_msgs.msg.DiagnosticArray",
}
LAYOUTS = config_folder().parent / "layouts"


def has(topic, fields):
    """Returns True if a topic's message type has a nested field; raises an error otherwise."""
    module, _, name = TYPES[topic].rpartition(".")
    value = getattr(importlib.import_module(module), name)()
    for field in fields:
        value = getattr(value, field)
    return True


def foxglove():
    return json.loads((LAYOUTS / "foxglove.json").read_text())


def texts(value):
    """Returns all topic names in a nested document."""
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list):
        return [text for entry in value for text in texts(entry)]
    return [value] if isinstance(value, str) and value.startswith("/") else []


def panels(layout):
    return (
        [layout]
        if isinstance(layout, str)
        else [*panels(layout["first"]), *panels(layout["second"])]
    )


def test_each_panel_of_foxglove_is_described_and_shown():
    document = foxglove()
    assert sorted(panels(document["layout"])) == sorted(document["configById"])


def test_what_foxglove_shows_exists():
    named = texts(foxglove()["configById"])
    assert len(named) >= 12
    for name in named:
        topic, *fields = name.split(".")
        assert has(topic, fields), name


def test_what_plotjuggler_shows_exists():
    root = ElementTree.parse(LAYOUTS / "plotjuggler.xml").getroot()
    curves = [curve.get("name") for curve in root.iter("curve")]
    assert len(curves) >= 10
    for name in curves:
        topic = next(topic for topic in TYPES if name.startswith(f"{topic}/"))
        assert has(topic, name.removeprefix(f"{topic}/").split("/")), name


def test_both_are_installed_from_the_package():
    sources = Path(__file__).parents[1] / "src/slosh_bringup/layouts"
    assert {path.name for path in LAYOUTS.iterdir()} == {path.name for path in sources.iterdir()}
