"""Containers that change in a recorded run: the replay gives the live estimates, bit for bit."""

import numpy as np
import pytest

from slosh_bag.reader import BagReader
from slosh_estimator.held_container import HeldContainer
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import parse_model
from slosh_replay.replay import replay_bag
from slosh_testing.live_bag import MODEL, LiveBag

MUG = parse_model(
    "container: {shape: cylinder, radius: 0.04, fill_height: 0.05}\n"
    "effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]"
)


def shift(kind="accel"):
    """Refilled, laid down, another one picked up, in motion; 500 inputs a second."""
    live, held = LiveBag(kind), HeldContainer(MODEL, "cup")
    live.states = True
    refilled = held.changed(fill_height=0.05)
    empty = refilled.changed(empty=True)
    live.holds = {200: refilled, 900: empty, 1300: empty.changed(name="mug", model=MUG)}
    return live


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["accel", "imu", "pose"])
@pytest.mark.parametrize("start", [0, 400, 1000])
def test_each_change_is_replayed_to_the_bit(kind, start, tmp_path):
    """From the beginning, or from where a late recorder begins: after a change, or empty."""
    live = shift(kind)
    live.unheard = live.unrecorded = range(start)
    folder = live.write(tmp_path / "bag")
    found = replay_bag(folder).verification
    assert found.exact, found.lines()
    assert found.recorded > 2000 - start


def test_the_estimates_say_when_the_gripper_was_empty_and_what_is_unknown(tmp_path):
    reader = BagReader(shift().write(tmp_path / "bag"))
    flags = np.array([reader.decode(m).flags for m in reader.messages(["/slosh/estimate"])])
    empty = (flags & EstimateFlag.NO_CONTAINER) != 0
    assert np.flatnonzero(empty).tolist() == list(range(900, 1300))
    settling = (flags & EstimateFlag.SETTLING) != 0
    assert not settling[:1300].any()  # refilled at rest
    assert settling[1300:].all()  # picked up in motion
