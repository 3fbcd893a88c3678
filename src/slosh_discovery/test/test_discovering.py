"""Tests a discovery from files to its report: fitted motions and images."""

import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slosh_bag.reader import BagReader
from slosh_discovery.discover.finding import WorstMoment
from slosh_discovery.discover_data import read_motions
from slosh_discovery.discover_frames import worst_frames
from slosh_discovery.discovering import (
    MANY,
    MOST,
    DiscoveryRequest,
    check_size,
    grouped,
    next_commands,
    part,
    recorded_model,
    tell_ignored_tilt,
    unique_names,
    write_results,
)
from slosh_discovery.discovery_report import DiscoveryReport
from slosh_discovery.errors import SloshDiscoveryError
from slosh_model.model_text import read_model
from slosh_model.simulate import Inputs
from slosh_testing.example_finding import BASE, FOUND, example_finding, example_motion

BAGS = Path(__file__).parents[3] / "bags"


@pytest.fixture
def day():
    """Returns the path of a recording of the simulated cell."""
    if not (BAGS / "c3").exists():
        pytest.skip("the recordings are not there")
    return BAGS / "c3"


def test_the_worst_moments_images_are_those_of_their_stamps(day):
    asked = []

    def picture(bag, wanted):
        asked.append((bag, dict(wanted)))
        return dict.fromkeys(wanted, (b"jpeg", 0.0123))

    motion, *_ = read_motions(day)
    moments = [
        WorstMoment(motion.name, float(motion.t[row]), 0.01, 0.02, 0.01) for row in (7, 9, 11, 13)
    ]
    elsewhere = WorstMoment("other#1", 1.0, 0.01, 0.02, 0.01)
    for data in (day, day.parent):
        frames = worst_frames([data], [elsewhere, *moments], picture)
        assert [frame.caption[:7] for frame in frames] == ["B: c3#1", "C: c3#1"]
        assert frames[0].caption.endswith(" s, 12.3 mm")
    reader = BagReader(day)
    stamps = {
        1_000_000_000 * surface.header.stamp.sec + surface.header.stamp.nanosec
        for surface in (reader.decode(m) for m in reader.messages(["/slosh/free_surface"]))
    }
    # A bag is asked once for all of its moments.
    assert [bag for bag, _ in asked] == [day, day]
    assert list(asked[0][1]) == ["B", "C"]
    assert set(asked[0][1].values()) <= stamps
    assert len(set(asked[0][1].values())) == 2


def test_motions_of_one_name_are_told_apart():
    motions = tuple(example_motion(name, 1) for name in ("run#1", "run#2", "run#1"))
    fit, holdout = unique_names(motions[:2], motions[2:])
    assert [motion.name for motion in fit] == ["run#1 (1)", "run#2"]
    assert [motion.name for motion in holdout] == ["run#1 (2)"]


def test_every_motion_is_either_fitted_or_held_out():
    motions = tuple(example_motion(f"run {number}", number) for number in range(9))
    fit, holdout = part(motions)
    assert len(fit) == 6
    assert holdout == motions[2::3]


def test_a_search_that_takes_long_is_told_and_one_without_an_end_refused():
    told = []
    one = example_motion("run", 1)
    few = MANY // len(one.t)
    check_size([one] * few, told.append)
    assert not told
    check_size([one] * (few + 1), told.append)
    assert "the search takes minutes" in told[0]
    with pytest.raises(SloshDiscoveryError, match=f"more than {MOST}: 100 heights a second"):
        check_size([one] * (MOST // len(one.t) + 1), told.append)


def test_a_table_tells_no_model(tmp_path):
    table = tmp_path / "run_1.csv"
    table.write_text("t,ax,ay,az\n")
    with pytest.raises(SloshDiscoveryError, match="give one"):
        recorded_model(table)


def test_a_pattern_puts_motions_into_groups_by_their_name_or_by_what_they_were_read_from():
    groups = {"first": ("LE_*", "RD_?"), "second": ("runs/october",)}
    for name, path, expected in [
        ("LE_2D", "a.csv", "first"), ("RD_7", "a.csv", "first"), ("TRD", "runs/october", "second")
    ]:  # fmt: skip
        assert grouped(example_motion(name, 1), Path(path), groups).group == expected
    assert grouped(example_motion("LE_2D", 1), Path("a.csv"), {}).group is None


@pytest.mark.parametrize(
    ("name", "path", "which"),
    [("TRD", "a.csv", "none of the groups"), ("LE_2D", "runs/october", "groups first, second")],
)
def test_a_motion_of_no_group_or_of_two_is_one_clear_error(name, path, which):
    groups = {"first": ("LE_*",), "second": ("runs/october",)}
    with pytest.raises(SloshDiscoveryError, match=f"motion {name} matches {which}; .*--group"):
        grouped(example_motion(name, 1), Path(path), groups)


def test_each_group_gets_its_model_file_and_the_command_that_loads_it(tmp_path):
    models = {name: FOUND.with_effect("height_offset", offset=0.001) for name in ("a", "b")}
    finding = replace(example_finding(), model=BASE, group_models=models)
    request = DiscoveryRequest(
        (Path("runs"),), tmp_path, Path("model.yaml"), groups={"a": ("x", "y")}
    )
    write_results(tmp_path, DiscoveryReport(finding))
    for name, model in models.items():
        assert read_model(tmp_path / f"model_{name}.yaml") == model
    assert read_model(tmp_path / "model.yaml") == BASE
    loads = [one for one in next_commands(request, finding) if "load_model" in one.line]
    assert [one.purpose.split()[-1] for one in loads] == ["a", "b"]
    assert f"{tmp_path}/model_b.yaml" in loads[1].line


def test_the_command_that_loads_a_model_works_on_this_machine(tmp_path, monkeypatch):
    (tmp_path / "bin").mkdir()
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    request = DiscoveryRequest((Path("runs"),), tmp_path / "it's", Path("model.yaml"))

    def load():
        (line,) = [
            one.line for one in next_commands(request, example_finding())
            if "load_model" in one.line
        ]  # fmt: skip
        return shlex.split(line)

    path = tmp_path / "it's" / "model.yaml"
    assert load() == ["slosh", "call", "/slosh/load_model", f'path: "{path}"']
    program = tmp_path / "bin" / "ros2"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    kind = "slosh_msgs/srv/LoadModel"
    assert load() == [
        "ros2", "service", "call", "/slosh/load_model", kind, f'{{path: "{path}"}}',
    ]  # fmt: skip


def test_the_largest_tilt_that_the_model_does_not_feel_is_told():
    motions = []
    for name, angle in (("upright", 0.0), ("tilted", 0.35), ("a little", 0.1)):
        motion = example_motion(name, 1)
        turn = np.tile([0.0, np.sin(angle / 2), 0.0, np.cos(angle / 2)], (len(motion.inputs.t), 1))
        inputs = Inputs(motion.inputs.t, motion.inputs.acceleration, turn)
        motions.append(replace(motion, inputs=inputs))
    told = []
    tell_ignored_tilt(BASE, tuple(motions), told.append)
    (line,) = told
    assert line.startswith("tilted: the container tilts by up to 20.1 deg")
    assert not line.wrong  # to name the effect is what a discovery is for
    tell_ignored_tilt(BASE.with_gravity_tilt(), tuple(motions), told.append)
    tell_ignored_tilt(BASE, tuple(motions[:1]), told.append)
    assert len(told) == 1
