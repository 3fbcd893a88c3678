"""Tests what the add-on brings to the core by its entry point."""

import argparse
from types import SimpleNamespace

import pytest

from slosh_base.addons import add_ons, cell_nodes
from slosh_bringup.cell.motions import make_motion
from slosh_bringup.cli.demo import Demo
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import default_setup
from slosh_bringup.processes import NodeProcess, known_nodes, restarted
from slosh_governor import demo_option
from slosh_governor.addon import ADDON
from slosh_governor.figure import figure
from slosh_msgs.msg import GovernedMotion
from slosh_replay.journaled.replay import ROWS, known_rows


def test_the_core_finds_it():
    assert ADDON in add_ons()
    assert known_nodes()["governor"] == "slosh_governor.nodes.governor_node"
    assert known_nodes()["relay"] == "slosh_governor.nodes.relay_node"
    assert "governor" in known_rows()
    assert "governor" not in ROWS
    assert cell_nodes()["govern"].node == "governor"


def test_a_governor_that_is_restarted_does_not_believe_that_the_liquid_is_at_rest():
    first = NodeProcess("governor", parameters={"starts_at_rest": "true", "rate": "50.0"})
    assert restarted(first, 1).parameters == {"starts_at_rest": "false", "rate": "50.0"}
    # A file may say so, too: the single parameter wins.
    assert restarted(NodeProcess("governor"), 1).parameters["starts_at_rest"] == "false"


@pytest.mark.parametrize(
    ("told", "words"),
    [
        ({"state": 0, "safe": True}, "following"),
        ({"state": 1, "safe": False}, "limited · no stop keeps the limit"),
        ({"state": 2, "reason": 1, "safe": True}, "stopping · no command"),
        ({"state": 3, "reason": 9, "safe": True}, "at rest · an old command"),
        ({"state": 3, "reason": 200, "safe": True}, "at rest"),
    ],
)
def test_the_page_shows_how_much_is_followed_and_why_not_more(told, words):
    shown = figure(GovernedMotion(share=0.25, **told))
    assert shown == ("command followed", 25.0, "%", words)


def test_every_state_and_reason_has_words():
    states = ("FOLLOWING", "LIMITED", "STOPPING", "RESTING")
    reasons = (
        "SILENT",
        "INVALID",
        "LATE",
        "REQUESTED",
        "JOINTS",
        "TURN",
        "FAST",
        "FRAME",
        "STAMP",
    )
    shown = {
        figure(
            GovernedMotion(
                state=getattr(GovernedMotion, state), reason=getattr(GovernedMotion, reason),
                safe=True,
            )
        ).words
        for state in states
        for reason in reasons
    }  # fmt: skip
    assert len(shown) == len(states) * len(reasons)
    assert all(len(words.split(" · ")) == 2 for words in shown)


def demo(motion="c3"):
    return Demo(default_setup(), {"motion": motion}, make_motion(motion, 100.0))


def test_the_demonstration_has_a_governor_if_it_is_asked_for():
    parser = argparse.ArgumentParser()
    demo_option.add_arguments(parser)
    plain = demo()
    assert demo_option.changed(parser.parse_args([]), plain) is plain
    given = SimpleNamespace(governor=True, force=False)
    changed = demo_option.changed(given, demo())
    (governor,) = (one for one in changed.setup.processes("bag") if one.name == "governor")
    assert governor.parameters["command"] == "twist"
    assert governor.parameters["starts_at_rest"] == "true"
    assert changed.given == {"motion": "c3", "govern": "100.0"}
    cell = NodeProcess("cell", parameters=changed.given, module=changed.cell)
    assert "slosh_governor.nodes.governed_cell_node" in cell.command("/slosh")


def test_a_force_sensor_and_a_governor_are_refused_together():
    with pytest.raises(SloshBringupError, match="--governor and --force"):
        demo_option.changed(SimpleNamespace(governor=True, force=True), demo())
