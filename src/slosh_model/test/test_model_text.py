"""Tests which model files are read and which are refused."""

import math
import os
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_model.containers import SHAPES
from slosh_model.covariance import covariance_of
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import ModelFileError, SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid
from slosh_model.model import EffectUse, Model
from slosh_model.model_text import format_model, parse_model, read_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle

TEXT = """\
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
liquid: {density: 998.2, kinematic_viscosity: 1e-6}
damping_ratio: auto
effects:
  - name: vertical_acceleration
  - name: surface_nonlinearity
    alpha: 0.6
"""

# Each line's list holds the one before twice: written out, 2^40 entries.
ALIASES = "container:\n  - &a0 [1, 1]\n" + "".join(
    f"  - &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 40)
)


def test_reads_the_documented_example():
    model = parse_model(TEXT)
    assert model.name == "3D-NL"
    assert model.container == Cylinder(0.05, 0.07)
    assert model.liquid.kinematic_viscosity == 1e-6
    assert model.damping_ratio is None
    assert dict(model.effects[1].parameters) == {"alpha": 0.6}


@pytest.mark.parametrize(
    ("written", "value"),
    [("1e-6", 1e-6), ("1.E-6", 1e-6), ("+.5e0", 0.5), ("1", 1.0), ("0010e-2", 0.1), ("0.50", 0.5)],
)
def test_numbers_are_numbers_however_they_are_written(written, value):
    head = "container: {radius: 0.05, fill_height: 0.07}\n"
    model = parse_model(f"{head}liquid: {{kinematic_viscosity: {written}}}\ndamping_ratio: 0.1")
    assert model.liquid.kinematic_viscosity == value


RECTANGLE = "container: {shape: rectangle, width: 0.06, depth: 0.04, fill_height: 0.067}\n"


@pytest.mark.parametrize(
    ("text", "refusal"),
    [
        ("container: {shape: rectangle, width: 0.06, fill_height: 0.067}", "'container.depth' is"),
        (
            "container: {shape: rectangle, radius: 0.06, width: 1, depth: 1, fill_height: 1}",
            r"unknown key 'container.radius' \(known: shape, width, depth, fill_height, rim",
        ),
        ("container: {shape: oval}", r"container.shape = 'oval' \(known: cylinder, "),
        (
            "container: {shape: [1], radius: 1}",
            r"container.shape = .*\(known: cylinder, ",
        ),
        (
            RECTANGLE + "effects:\n  - name: surface_nonlinearity",
            "cup.yaml:3: effect 'surface_nonlinearity' is not for a rectangle",
        ),
        (RECTANGLE.replace("0.04", "40"), "container.depth = 40.0 m must lie in"),
    ],
)
def test_a_rectangle_that_cannot_be_is_refused_with_the_key(text, refusal):
    with pytest.raises(SloshModelError, match=refusal):
        parse_model(text, "cup.yaml")


def test_no_effect_is_the_planar_linear_model():
    assert parse_model("container: {radius: 0.05, fill_height: 0.07}").name == "2D-L"


@st.composite
def effect_uses(draw, shape):
    """Hypothesis strategy for the effects of a container and their parameters."""
    uses = []
    fitting = [name for name, effect in EFFECTS.items() if effect.fits(SHAPES[shape].section)]
    for name in draw(st.lists(st.sampled_from(fitting), unique=True)):
        values = {
            parameter.name: draw(
                st.sampled_from(parameter.choices)
                if parameter.choices
                else st.floats(parameter.lower, parameter.upper)
            )
            for parameter in EFFECTS[name].parameters
        }
        if name != "fill_level" or values["delta"] >= 0.0:  # it must leave some liquid
            uses.append(EffectUse(name, values))
    return tuple(uses)


length, side = st.floats(1e-3, 5.0), st.floats(0.02, 5.0)  # no gap that viscosity fills
rim = st.one_of(st.none(), st.floats(5.1, 9.0))
containers = st.one_of(
    st.builds(Cylinder, length, length, rim), st.builds(Rectangle, side, side, side, rim)
)
models = containers.flatmap(lambda container: models_of(container))


def models_of(container):
    """Hypothesis strategy for models with a given container."""
    return st.builds(
        Model,
        container=st.just(container),
        liquid=st.builds(Liquid, st.floats(1.0, 2e4), st.floats(1e-8, 1e-5)),
        damping_ratio=st.one_of(st.none(), st.floats(0.0, 0.99)),
        effects=effect_uses(container.shape),
        modes=st.integers(1, 5),
        limits=st.builds(ValidityLimits, st.floats(0.1, 900.0)),
        natural_frequency=st.one_of(st.none(), st.floats(1e-2, 1e3)),
        covariance=st.one_of(
            st.none(),
            st.builds(
                lambda root: covariance_of(
                    ("natural_frequency", "damping_ratio"), np.array(root) @ np.transpose(root)
                ),
                st.lists(
                    st.lists(st.integers(-9, 9), min_size=2, max_size=2), min_size=2, max_size=2
                ),
            ),
        ),
    )


@settings(max_examples=50, deadline=None)
@given(models)
def test_round_trip(model):
    assert parse_model(format_model(model)) == model


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ("radius: 0.05", r"unknown key 'radius' \(known: container, liquid"),
        ("container: {radius: 0.05, fill_height: 0.07, radios: 1}", "container.radios"),
        ("container: {radius: 0.05}", "'container.fill_height' is missing"),
        ("container: {radius: wide, fill_height: 0.07}", "container.radius = 'wide'"),
        ("container: {radius: true, fill_height: 0.07}", "container.radius = True"),
        (
            "container: {radius: '0.05', fill_height: 0.07}",
            "container.radius = '0.05' must be a n",
        ),
        ("container: {radius: 0:05.5, fill_height: 0.07}", "container.radius = '0:05.5'"),
        ("container: {radius: 1_0.0, fill_height: 0.07}", "container.radius = '1_0.0'"),
        ("container: {radius: -.inf, fill_height: 0.07}", "container.radius = -inf must be a fin"),
        ("container: {radius: 1e999, fill_height: 0.07}", "container.radius = inf must be a fin"),
        ("container: {radius: 0.05, fill_height: 0.07, rim_height: 0.07}", "rim_height = 0.07 m"),
        ("container: {radius: !!bool 5, fill_height: 0.07}", "not YAML: '5'"),
        ("container: {radius: !!float '', fill_height: 0.07}", "not YAML"),
        ("container: {radius: !!timestamp x, fill_height: 0.07}", "not YAML"),
        ("container: {radius: !!python/name:os.system , fill_height: 1}", "not YAML"),
        (f"container: {{radius: {'9' * 400}, fill_height: 1}}", "must be a finite number"),
        (f"container: {{radius: {'9' * 9000}, fill_height: 1}}", "not YAML"),
        (ALIASES, r"cup\.yaml:17: not YAML: it stands for more than 200000 values"),
        (TEXT.replace("auto", "yes"), "damping_ratio = True must be a number"),
        ("container: {radius: .nan, fill_height: 0.07}", "finite"),
        ("container: {radius: -1, fill_height: 0.07}", "container.radius = -1"),
        ("container: {shape: urn, radius: 1, fill_height: 1}", "container.shape = 'urn'"),
        (
            "container: {radius: 1, radius: 2, fill_height: 1}",
            r"cup\.yaml:1: container\.radius: given twice",
        ),
        ("container: 5", "container must be a mapping"),
        ("", "is empty"),
        ("[1, 2]", "must be a mapping"),
        ("container: {radius: [", "not YAML"),
        (TEXT + "  - name: vertical_acceleration\n", r"cup\.yaml:8: .*listed twice"),
        (TEXT.replace("alpha", "beta"), r"cup\.yaml:7: .*unknown parameter 'beta'"),
        (TEXT.replace("0.6", "-3"), r"cup\.yaml:7: .*nonlinearity.alpha = -3"),
        (TEXT.replace("auto", "1.5"), r"cup\.yaml:3: damping_ratio = 1\.5"),
        (TEXT.replace("auto", "low"), r"cup\.yaml:3: damping_ratio = 'low'"),
        (TEXT + "modes: 0\n", r"cup\.yaml:8: modes = 0"),
        (TEXT + "modes: 9999999999999\n", "modes = 9999999999999"),
        (TEXT + "effects: {}\n", r"cup\.yaml:8: effects: given twice"),
        (TEXT + "liquid: null\n", r"cup\.yaml:8: liquid: given twice"),
        (TEXT + "limits: null\n", "limits must be a mapping"),
        (TEXT + "limits: {jerk: 0}\n", "limits.jerk = 0"),
        (TEXT + "1.5: 2\n", r"unknown key '1\.5' "),
        (TEXT + "modes: 1.5\n", "modes = 1.5"),
        (TEXT + "limits: {jerks: 1}\n", "limits.jerks"),
        (TEXT + "natural_frequency: 0\n", r"cup\.yaml:8: natural_frequency = 0\.0 rad/s must lie"),
        (TEXT + "natural_frequency: high\n", "natural_frequency = 'high' must be a number"),
        (TEXT + "covariance: 3\n", "covariance must be a mapping"),
        (TEXT + "covariance: {parameters: [a]}\n", "covariance.matrix must be a list, not None"),
        (
            TEXT + "covariance: {parameters: [a, b], matrix: [[1, 0]]}\n",
            r"cup\.yaml:8: covariance of 2 parameters needs a matrix of 2 by 2",
        ),
        (
            TEXT + "covariance: {parameters: [a, a], matrix: [[1, 0], [0, 1]]}\n",
            "covariance names 'a' twice",
        ),
        (
            TEXT + "covariance: {parameters: [a, b], matrix: [[1, 2], [2, 1]]}\n",
            "covariance has a negative eigenvalue",
        ),
        (
            TEXT + "covariance: {parameters: [a, b], matrix: [[1, 0.5], [0.2, 1]]}\n",
            "covariance is not symmetric",
        ),
        (TEXT + "covariance: {parameters: [a], matrix: [[-1]]}\n", "a negative variance"),
    ],
)
def test_refuses_with_the_source_and_the_key(change, match):
    with pytest.raises(SloshModelError, match=match) as caught:
        parse_model(change, "cup.yaml")
    assert re.match(r"cup\.yaml(:\d+)?: ", str(caught.value))
    assert "\n" not in str(caught.value)


@settings(max_examples=200, deadline=None)
@given(st.text(max_size=60))
def test_any_text_gives_a_model_or_one_clear_error(text):
    try:
        parse_model(text)
    except SloshModelError as error:
        assert "\n" not in str(error)


def test_numbers_keep_every_bit():
    alpha = math.nextafter(0.58, 1.0)
    model = Model(Cylinder(0.05, 0.07)).with_effect("surface_nonlinearity", alpha=alpha)
    assert parse_model(format_model(model)).effects[0].parameters["alpha"] == alpha


# A model's file: what cannot be read is told with the file's name.


def test_model_files_are_named_in_every_error(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match="no file given"):
        read_model("")
    with pytest.raises(ModelFileError, match=r"absent\.yaml"):
        read_model(tmp_path / "absent.yaml")
    binary = tmp_path / "binary.yaml"
    binary.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ModelFileError, match=r"binary\.yaml"):
        read_model(binary)
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path, tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(ModelFileError, match=r"regular file|directory"):
            read_model(place)
    with pytest.raises(ModelFileError, match="null byte"):
        read_model("a\0b")
    (tmp_path / "large").write_bytes(b"#" * 100_000)
    with pytest.raises(ModelFileError, match="too large, more than 64000 bytes"):
        read_model(tmp_path / "large")
    wrong = tmp_path / "wrong.yaml"
    wrong.write_text("container: {shape: cylinder, radius: 0.05, fill_height: 0.07, colour: 1}")
    with pytest.raises(SloshModelError, match=r"wrong\.yaml.*colour"):
        read_model(wrong)
