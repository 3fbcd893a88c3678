"""Tests the ten public names: arguments, results and errors."""

import importlib.metadata
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas
import pytest

import slosh
from slosh_model.simulate import Inputs

CUP = {"diameter": 0.08, "fill_height": 0.06, "rim_height": 0.11}
T = np.arange(0.0, 2.0, 0.002)
MOTION = slosh.Motion(T, np.outer(2.0 * np.sin(9.0 * T) * (T < 1.0), [1.0, 0.3, 0.0]))
BAG = Path(__file__).resolve().parents[3] / "bags" / "c3"
WAY = [[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]


@pytest.fixture(scope="module")
def model():
    return slosh.Model.from_cup(**CUP)


@pytest.fixture(scope="module")
def replayed():
    return slosh.replay(BAG)


def test_the_names_load_nothing_before_they_are_asked_for():
    program = (
        "import sys, slosh\nassert sorted(slosh.__all__ + ['__version__']) == dir(slosh)\n"
        "print([name for name in ('numpy', 'scipy', 'pandas', 'rclpy') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("[]\n", "")


def test_the_version_is_that_of_the_package():
    assert slosh.__version__ == importlib.metadata.version("slosh_bringup")
    with pytest.raises(AttributeError, match="no attribute 'simulat'"):
        _ = slosh.simulat


def test_a_cup_is_that_of_the_command(folder, model):
    assert slosh.Model.load("cup/model.yaml") == model
    model.save("again.yaml")
    assert slosh.Model.load("again.yaml") == model
    assert model.natural_frequency_hz == pytest.approx(3.369, abs=1e-3)
    square = slosh.Model.from_cup(width=0.1, depth=0.06, fill_height=0.05, liquid="oil")
    assert (square.name, square.liquid.density) == ("3D-L", 920.0)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"diameter": 0.08}, "fill_height is missing"),
        ({"fill_height": 0.06}, "given: nothing"),
        ({"diameter": 0.08, "radius": 0.04, "fill_height": 0.06}, "given: diameter and radius"),
        ({"diameter": 80, "fill_height": 0.06}, "diameter = 80 m .*did you mean 80 mm"),
        ({"diameter": "8 cm", "fill_height": 0.06}, "diameter = '8 cm' must be a number"),
        ({"diameter": 0.08, "height": 0.1, "fill_height": 0.06}, "height is no length of a cup"),
        ({"diameter": 0.08, "fill_height": 0.06, "liquid": "beer"}, "liquid = 'beer' .known: wat"),
        ({"diameter": 0.08, "fill_height": 0.06, "rim_height": 0.05}, "rim_height = 0.05 m must"),
    ],
)
def test_what_is_no_cup_is_named(given, words):
    with pytest.raises(ValueError, match=words):
        slosh.Model.from_cup(**given)


def forms(folder):
    """Returns a motion in every form in which it may be given."""
    MOTION.save("m.csv")
    inputs = Inputs(MOTION.t, MOTION.acceleration)
    table = MOTION.to_pandas()
    return [MOTION, inputs, table, table.reset_index(), "m.csv", folder / "m.csv"]


def test_a_motion_may_be_given_in_every_form(folder, model):
    heights = [slosh.simulate(model, motion).msh for motion in forms(folder)]
    assert all(np.array_equal(heights[0], other) for other in heights)
    peaks = {slosh.predict(model, motion).nonlinear.peak for motion in forms(folder)}
    assert len(peaks) == 1
    several = slosh.predict("cup/model.yaml", forms(folder), limit=0.02)
    assert [one.name for one in several][::4] == ["motions[0]", "m.csv"]


def test_a_plan_is_a_motion(folder, model):
    planned = slosh.plan(model, WAY, limit=0.01)
    found = slosh.predict(model, planned, limit=0.01)
    assert found.duration == planned.found.motion.duration
    assert found.nonlinear.peak == pytest.approx(planned.found.peak, abs=5e-5)
    table = pandas.DataFrame(WAY, columns=["x", "y", "z"]).assign(t=[0.0, 1.0])
    again = slosh.plan(model, table, limit=0.01)
    assert again.found.motion.duration == pytest.approx(found.duration, abs=0.05)


def test_heights_of_a_table_are_data(folder, model):
    heights = slosh.simulate(model, MOTION).msh
    measured = slosh.Motion(MOTION.t, MOTION.acceleration, msh=1.02 * heights)
    found = slosh.identify([measured, measured.to_pandas()], model, ["damping_ratio"])
    assert len(found.motions) == 2
    assert found.model.natural_frequency_hz == model.natural_frequency_hz


@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda m: slosh.simulate(5, MOTION), TypeError, "model = 5: must be a Model or"),
        (lambda m: slosh.simulate(MOTION, m), TypeError, "model = Motion.*: must be a Model"),
        (lambda m: slosh.simulate(m, 5), TypeError, "motion = 5: must be a Motion, a pandas"),
        (lambda m: slosh.predict(m, [MOTION, 5]), TypeError, r"motions\[1\] = 5: must be a Mo"),
        (lambda m: slosh.replay(5), TypeError, "recording = 5: must be a Recording or"),
        (lambda m: slosh.identify([3], m), TypeError, r"data\[0\] = 3: must be a Recording"),
        (lambda m: slosh.discover(MOTION, m, holdout=3), ValueError, "^data: holds no measured"),
        (lambda m: slosh.plan(m, [[1, 2]], limit=0.01), ValueError, "shape .1, 2., expected"),
        (lambda m: slosh.plan(m, WAY, limit=10), ValueError, "limit = 10 m .*mean 10 mm, 0.01"),
        (lambda m: slosh.predict(m, MOTION, limit=10), ValueError, "limit = 10 m .*mean 10 mm"),
        (lambda m: slosh.Motion([0, 1], [1, 2]), ValueError, "acceleration has the shape"),
        (lambda m: slosh.Motion([1, 0], np.zeros((2, 3))), ValueError, "does not come after"),
        (lambda m: slosh.simulate(m, pandas.DataFrame({"t": [0.0], "a": 1.0})), ValueError,
         "^motion: line 1: column 'a' is unknown"),
        (lambda m: slosh.simulate("none.yaml", MOTION), ValueError, "none.yaml: No such file"),
        (lambda m: slosh.Recording("none"), ValueError, "none: no such file or folder"),
    ],
)  # fmt: skip
def test_a_refusal_names_the_argument(call, kind, words, model):
    with pytest.raises(kind, match=words) as refused:
        call(model)
    assert "\n" not in str(refused.value)
    assert "attribute" not in str(refused.value)


@pytest.mark.long
def test_what_looks_wrong_is_warned_of(model):
    tilted = slosh.Motion(T, np.add(MOTION.acceleration, [0.0, 0.0, 9.81]))
    for call in (slosh.simulate, slosh.predict):
        with pytest.warns(UserWarning, match="gravity"):
            call(model, tilted)
    with pytest.warns(UserWarning, match="path: the path is 300 m long: .* in mm"):
        slosh.plan(model, [[0.0, 0.0, 0.0], [300.0, 0.0, 0.0]], limit=0.01)


@pytest.fixture(scope="module")
def shown(model, replayed):
    return {
        "container": model.container,
        "model": model,
        "motion": MOTION,
        "recording": slosh.Recording(BAG),
        "response": slosh.simulate(model, MOTION),
        "prediction": slosh.predict(model, MOTION),
        "plan": slosh.plan(model, WAY, limit=0.01),
        "replay": replayed,
        "identification": slosh.identify(BAG, replayed.model, ["damping_ratio"]),
    }


def test_each_result_is_one_line_with_units(shown):
    units = ("mm", " s", "m/s²", "Hz", "messages")
    for value in shown.values():
        text = repr(value)
        assert text.startswith(type(value).__name__)
        assert len(text) < 160
        assert "\n" not in text
        assert any(unit in text for unit in units)


@pytest.mark.parametrize("name", ["motion", "response", "plan", "replay", "identification"])
def test_a_notebook_shows_a_line_and_a_chart(shown, name):
    page = shown[name]._repr_html_()
    assert page.startswith("<p><code>")
    assert page.count("<svg") == page.count("</svg>") == 1
    assert "<?xml" not in page


@pytest.mark.parametrize(
    ("name", "units"),
    [
        ("motion", {"ax": "m/s²", "t": "s"}),
        ("response", {"msh": "m", "azimuth": "rad"}),
        ("plan", {"x": "m", "az": "m/s²"}),
        ("replay", {"3D-NL": "m", "stamp": "ns", "flags": "1"}),
        ("identification", {"value": "as in the column unit"}),
    ],
)
def test_tables_go_to_xarray_with_their_units(shown, name, units):
    value = shown[name]
    dataset, frame = value.to_xarray(), value.to_pandas()
    assert {name: dataset[name].attrs["units"] for name in units} == units
    assert set(dataset.data_vars) == set(frame)
    assert np.array_equal(dataset[frame.columns[0]], frame[frame.columns[0]])


def test_a_recordings_topic_is_a_table(shown):
    recording, name = shown["recording"], "free_surface"
    assert len(recording.to_pandas(name)) == recording.topics()[f"/slosh/{name}"].count
    with pytest.raises(ValueError, match="has no topic 'free_surfac'"):
        recording.to_pandas("free_surfac")
