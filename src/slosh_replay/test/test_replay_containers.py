"""Tests recordings with changes of the container: replayed estimates are identical."""

import numpy as np
import pytest

from slosh_bag.reader import BagReader
from slosh_estimator.held_container import HeldContainer
from slosh_estimator.limits import Source
from slosh_estimator.validity import EstimateFlag
from slosh_model.model_text import parse_model
from slosh_model.tray import Tray, TrayContainer
from slosh_replay.replay import replay_bag
from slosh_testing.live_bag import MODEL, LiveBag

MUG = parse_model(
    "container: {shape: cylinder, radius: 0.04, fill_height: 0.05}\n"
    "effects: [{name: vertical_acceleration}, {name: surface_nonlinearity}]"
)


def shift(kind="accel"):
    """Returns a live bag with containers that are refilled, laid down and picked up."""
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
    """Tests that each change of the container is replayed exactly, from any start."""
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


@pytest.mark.parametrize("kind", ["imu", "pose"])
def test_a_tray_is_replayed_to_the_bit(kind, tmp_path):
    """Tests that a tray is replayed exactly, and what a late start cannot compare."""
    names, places = ("a", "b", "c"), ((0.0, 0.0, 0.0), (0.1, 0.2, 0.0), (-0.1, 0.0, 0.05))
    models = (MODEL.with_gravity_tilt(), MUG.with_gravity_tilt(), MODEL.with_gravity_tilt())
    tray = Tray(tuple(map(TrayContainer, names, models, places, (0.5, 0.5, 0.003))))
    live = LiveBag(kind)
    live.tray, live.model, live.states = tray, tray.first.model, True
    live.restarts = [1500]
    live.attitude = lambda index: (0.0, 0.0, np.sin(1e-3 * index), np.cos(1e-3 * index))
    folder = live.write(tmp_path / "bag")
    result = replay_bag(folder)
    for found in (result.verification, result.verified["tray_estimate"]):
        assert found.exact, found.lines()
    estimated = [one for one in result.events if one.source is Source.ESTIMATED]
    assert {one.description.partition(":")[0] for one in estimated} == {"container c"}
    reader = BagReader(folder)
    told = reader.decode(list(reader.messages(["/slosh/tray_estimate"]))[-1200])
    assert len(set(told.msh.tolist())) == 3
    live.restarts, live.unheard, live.unrecorded = (), range(700), range(700)
    late = replay_bag(live.write(tmp_path / "late")).verified
    assert late["estimate"].exact
    (why,) = late["tray_estimate"].unchecked
    assert why == "before the first known state"  # none is recorded of further containers
    assert not late["tray_estimate"].missing


def changing_tray():
    """A recorded IMU tray with three containers, each of which is changed in motion."""
    names, places = ("a", "b", "c"), ((0.0, 0.0, 0.0), (0.1, 0.2, 0.0), (-0.1, 0.0, 0.05))
    tray = Tray(tuple(map(TrayContainer, names, (MODEL, MUG, MODEL), places, (0.5, 0.5, 0.01))))
    live, held = LiveBag("imu"), [HeldContainer(one.model) for one in tray.containers]
    live.tray, live.model, live.states = tray, tray.first.model, True
    gone = held[1].changed(empty=True)
    live.places = {
        200: (2, held[2].changed(fill_height=0.05, limit=0.003)),
        900: (1, gone),
        1300: (1, gone.changed(name="cup", model=MODEL)),
        1600: (0, held[0].changed(model=MUG)),
    }
    return live


def test_each_change_on_a_tray_is_replayed_to_the_bit(tmp_path):
    """The other containers go on as they are; an emptied place has no height."""
    folder = changing_tray().write(tmp_path / "bag")
    result = replay_bag(folder)
    for found in (result.verification, result.verified["tray_estimate"]):
        assert found.exact, found.lines()
    reader = BagReader(folder)
    told = [reader.decode(m) for m in reader.messages(["/slosh/tray_estimate"])]
    flags = np.array([one.flags for one in told])
    empty = (flags & EstimateFlag.NO_CONTAINER) != 0
    assert np.flatnonzero(empty[:, 1]).tolist() == list(range(900, 1300))
    assert not empty[:, [0, 2]].any()
    settling = (flags & EstimateFlag.SETTLING) != 0
    assert settling[1300:, 1].all()
    assert settling[1600:, 0].all()
    assert not settling[:, 2].any()  # refilled at rest
    heights = np.array([one.msh for one in told])
    assert np.isnan(heights[900:1300, 1]).all()
    ended = [one for one in result.events if one.source is Source.ESTIMATED]
    assert {one.description.partition(":")[0] for one in ended} == {"container c"}
    assert {round(one.limit, 6) for one in ended} == {0.003}


def test_a_place_of_a_tray_that_is_another_one_is_found_out(tmp_path):
    """A replay that did not follow the change would differ from there on."""
    live = changing_tray()
    del live.places[900], live.places[1300], live.places[1600]
    index, held = live.places[200]
    entries, told = live.entries(3.0), live.entries
    live.places[200] = (index, held.changed(fill_height=0.06, limit=0.003))
    live.entries = lambda seconds: (
        [entry for entry in entries if "settings" not in entry[1]]
        + [entry for entry in told(seconds) if "settings" in entry[1]]
    )
    found = replay_bag(live.write(tmp_path / "bag")).verified["tray_estimate"]
    assert not found.exact
    assert "msh[2]" in found.largest


def test_a_container_of_a_tray_that_is_another_one_is_found_out(tmp_path):
    tray = Tray((TrayContainer("a", MODEL), TrayContainer("b", MUG)))
    live = LiveBag("imu")
    live.tray = tray
    other = Tray((tray.first, TrayContainer("b", MUG.filled_to(0.04))))
    entries = live.entries(3.0)
    told = live.entries
    live.entries = lambda seconds: (
        [  # what the estimates are of, and what is told
            (log, topic, kind, data)
            for log, topic, kind, data in entries
            if "settings" not in topic
        ]
        + settings_of(live, told, other)
    )
    found = replay_bag(live.write(tmp_path / "bag")).verified
    assert found["estimate"].exact
    assert not found["tray_estimate"].exact
    assert "msh[1]" in found["tray_estimate"].largest


def settings_of(live, entries, tray):
    live.tray = tray
    return [entry for entry in entries(3.0) if "settings" in entry[1]]
