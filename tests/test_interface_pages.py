"""Tests that the pages on topics and limits say what the code says."""

import re
from pathlib import Path

import pytest

from slosh_motion.inputs.inputs import MESSAGE_TYPES
from slosh_msgs.msg import FreeSurface, SloshEstimate

ROOT = Path(__file__).resolve().parent.parent
SOURCES = {
    path: path.read_text(encoding="utf-8")
    for path in ROOT.glob("*/slosh*/slosh*/**/*.py")
    if "test" not in path.parts
}


def page(name):
    return (ROOT / "docs" / name).read_text(encoding="utf-8")


def row(text, start):
    (found,) = re.findall(rf"^\| {re.escape(start)}.*$", text, re.M)
    return found


def test_all_nodes_that_publish_settings_are_named():
    nodes = {
        path.stem.removesuffix("_node")
        for path, text in SOURCES.items()
        if "SettingsPublisher(" in text and "class SettingsPublisher" not in text
    }
    told = row(page("interfaces.md"), "`settings`").split(" | ")[-1].rstrip(" |")
    assert set(told.split(", ")) == nodes


def test_the_attitude_of_every_input_is_told():
    table = page("interfaces.md").split("| input | attitude and rates |")[1].split("\n\n")[0]
    told = re.findall(r"`(\w+)`", " ".join(re.findall(r"^\| ([^|]+) \|", table, re.M)))
    assert sorted(told) == sorted(MESSAGE_TYPES)


@pytest.mark.parametrize("message", [SloshEstimate, FreeSurface])
def test_every_flag_is_told(message):
    flags = [
        name for name in dir(message)
        if name.isupper() and name != "SLOT_TYPES" and not name.startswith("PEAK_")
    ]  # fmt: skip
    told = page("interfaces.md").split("## Flags")[1].split("\n## ")[0]
    assert [flag for flag in flags if f"`{flag}`" not in told] == []


def test_the_keys_of_the_diagnostics_exist():
    keys = set(re.findall(r"`([a-z][a-z ]* \[[^\]]+\])`", page("interfaces.md")))
    assert len(keys) >= 5
    code = "\n".join(SOURCES.values())
    assert [key for key in keys if key not in code] == []


def test_shapes_that_a_camera_measures_are_not_told_as_missing():
    for text in (page("roadmap.md"), page("camera.md").split("## Limits")[1]):
        assert not re.search(r"other than upright|conical cup", text)
    assert "frustum" in page("calibration.md").split("## Requirements")[1]
