"""The aggregator's file has a group for the diagnostics of each node, and one only."""

import re

import pytest
import yaml

from slosh_bringup.processes import config_folder, known_nodes

(PARAMETERS,) = (
    content["ros__parameters"]
    for content in yaml.safe_load((config_folder() / "diagnostics.yaml").read_text()).values()
)
GROUPS = {name: group for name, group in PARAMETERS.items() if isinstance(group, dict)}


def groups_of(name):
    """Returns the aggregator's groups whose patterns match the whole name of a status."""
    return [
        group
        for group, analyzer in GROUPS.items()
        if any(re.fullmatch(pattern, name) for pattern in analyzer["regex"])
    ]


@pytest.mark.parametrize("namespace", ["/slosh", "/line_1/cell", "/camera/monitor", ""])
@pytest.mark.parametrize("node", [*known_nodes(), "camera_left"])
def test_each_node_is_in_one_group(node, namespace):
    assert len(groups_of(f"{namespace}/{node}")) == 1


def test_others_are_in_none():
    assert groups_of("/arm/driver") == []
    assert groups_of("/slosh/camera: frames") == []


def test_every_group_is_complete():
    for group in GROUPS.values():
        assert group["type"] == "diagnostic_aggregator/GenericAnalyzer"
        assert group.keys() - {"discard_stale"} == {"type", "path", "regex", "timeout"}
    assert len({group["path"] for group in GROUPS.values()}) == len(GROUPS)
