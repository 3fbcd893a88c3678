"""Tests files of trays: read as written, errors with line numbers."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.tray import Tray, TrayContainer, format_tray, parse_tray, read_tray

CUP = "container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.09}\n"
TWO = """
containers:
- {name: left, model: cup.yaml, place: [0.0, 0.1, 0.0], limit: 0.01}
- name: right
  model: {container: {shape: cylinder, radius: 0.03, fill_height: 0.05}}
"""
PLACES = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
SIZES = st.floats(0.02, 0.1)


@given(
    st.lists(
        st.tuples(SIZES, SIZES, PLACES, st.floats(1e-3, 0.1), st.booleans()),
        min_size=1, max_size=6,
    )
)  # fmt: skip
def test_a_tray_comes_back_from_its_text(cups):
    tray = Tray(
        tuple(
            TrayContainer(f"cup_{index}", Model(Cylinder(radius, fill)), place, limit, empty=empty)
            for index, (radius, fill, place, limit, empty) in enumerate(cups)
        )
    )
    assert parse_tray(format_tray(tray)) == tray


def test_files_are_relative_and_a_model_is_a_tray_of_one(tmp_path):
    (tmp_path / "cup.yaml").write_text(CUP)
    (tmp_path / "tray.yaml").write_text(TWO)
    tray = read_tray(tmp_path / "tray.yaml")
    assert tray.is_tray
    assert tray.names == ("left", "right")
    assert tray.bounds.tolist() == [0.01, 1.0]
    one = read_tray(tmp_path / "cup.yaml")
    assert not one.is_tray
    assert one.first.placed is one.first.model
    assert one.bounds == pytest.approx([0.03])


def test_the_arm_of_the_place_adds_to_that_of_the_model():
    model = Model(Cylinder(0.04, 0.06)).with_effect("lever_arm", x=0.1, y=0.0, z=0.2)
    (use,) = TrayContainer("a", model, (0.1, 0.3, 0.0)).placed.effects
    assert dict(use.parameters) == pytest.approx({"x": 0.2, "y": 0.3, "z": 0.2})


def test_the_worst_is_the_nearest_to_its_own_limit():
    cup = Model(Cylinder(0.04, 0.06))
    tray = Tray((TrayContainer("a", cup, limit=0.02), TrayContainer("b", cup, limit=0.01)))
    assert tray.worst(np.array([0.011, 0.006])) == 1
    assert tray.worst(np.array([0.011, math.nan])) == 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("containers: []", "list of 1 to 16"),
        ("containers: {a: 1}", "list of 1 to 16"),
        ("containers: [7]", "must be a mapping"),
        ("containers: [{name: a, model: cup.yaml}]\nlimits: 1", "unknown key 'limits'"),
        ("containers: [{name: a, modell: cup.yaml}]", "unknown key 'modell'"),
        ("containers: [{model: cup.yaml}]", "name = None"),
        ("containers: [{name: ../a, model: cup.yaml}]", "name = '../a'"),
        ("containers: [{name: a, model: none.yaml}]", "none.yaml"),
        ("containers: [{name: a}]", "model = None"),
        ("containers: [{name: a, model: cup.yaml, place: [1, 2]}]", "place"),
        ("containers: [{name: a, model: cup.yaml, place: [.nan, 0, 0]}]", "place"),
        ("containers: [{name: a, model: cup.yaml, place: [100, 0, 0]}]", "place"),
        ("containers: [{name: a, model: cup.yaml, limit: -1}]", "limit"),
        ("containers: [{name: a, model: {container: 7}}]", "must be a mapping"),
        ("containers: [{name: a, model: cup.yaml}, {name: a, model: cup.yaml}]", "twice"),
    ],
)
def test_what_is_no_tray_is_named(tmp_path, text, message):
    (tmp_path / "cup.yaml").write_text(CUP)
    path = tmp_path / "tray.yaml"
    path.write_text(text)
    with pytest.raises(SloshModelError, match=message.replace("[", r"\[")) as caught:
        read_tray(path)
    assert "\n" not in str(caught.value)
