"""The documentation tells the truth: links, commands, parameters."""

import re
from pathlib import Path

import pytest
from slosh_bag.nodes import recorder_node
from slosh_bringup.cli.main import COMMANDS
from slosh_bringup.nodes import cell_node
from slosh_camera.nodes import camera_node
from slosh_estimator.nodes import estimator_node, monitor_node

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]
NODES = {
    "estimator": estimator_node,
    "camera": camera_node,
    "monitor": monitor_node,
    "recorder": recorder_node,
    "cell": cell_node,
}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8")):
        if "://" not in target:
            assert (page.parent / target).exists(), target


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_named_commands_exist(page):
    for name in re.findall(r"`(?:\.venv/bin/)?slosh ([a-z]+)", page.read_text(encoding="utf-8")):
        assert name in COMMANDS, name


@pytest.mark.parametrize("name", NODES)
def test_parameters_are_documented_with_their_defaults(name):
    text = (ROOT / "docs" / "interfaces.md").read_text(encoding="utf-8")
    section = text.split(f"### `{name}`")[1].split("###")[0]
    documented = dict(re.findall(r"^\| `(\w+)` \| `(.*?)` \|", section, re.MULTILINE))
    assert documented == {spec.name: repr(spec.default) for spec in NODES[name].PARAMETERS}
