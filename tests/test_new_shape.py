"""Tests a new container shape, added by one file, from the model to `slosh simulate`."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_base.files.nanoseconds import SECOND
from slosh_bringup.cli.main import main
from slosh_estimator.estimator import Estimator
from slosh_model.containers import _SHAPES
from slosh_model.model_text import format_model, parse_model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion import MotionTable, write_motion_table
from slosh_motion.inputs.sampling import Sample
from slosh_replay.replay import replay_table

TEXT = "container: {shape: tub, diameter: 0.1, fill_height: 0.07}\n"
T = np.arange(0.0, 3.0, 0.004)
PUSH = np.where(T < 0.5, 2.0 * np.sin(2.0 * np.pi * T / 0.5), 0.0)
ACCELERATION = np.column_stack([PUSH, 0.5 * PUSH, np.zeros_like(T)])


@pytest.fixture
def model():
    # Its definition makes the shape known; so not before these tests.
    from tests import new_shape

    _SHAPES[new_shape.Tub.shape] = new_shape.Tub
    yield parse_model(TEXT)
    del _SHAPES[new_shape.Tub.shape]


@pytest.fixture
def same(model):
    return replace(model, container=Cylinder(0.05, 0.07))


def test_a_model_file_names_it(model):
    assert model.container.size_name == "diameter"
    assert parse_model(format_model(model)) == model


def test_the_liquid_in_it_moves_as_theory_says(model, same):
    inputs = Inputs(T, ACCELERATION)
    found, _ = simulate(model.nonlinear(), inputs)
    expected, _ = simulate(same.nonlinear(), inputs)
    assert np.array_equal(found.msh, expected.msh)
    assert np.array_equal(found.azimuth, expected.azimuth)


def test_the_estimator_takes_it(model):
    estimator = Estimator(model)
    heights = [
        estimator.update(Sample(int(t * SECOND), *row)).nonlinear.msh
        for t, row in zip(T + 1.0, ACCELERATION.tolist(), strict=True)
    ]
    response, _ = simulate(model.nonlinear(), Inputs(T, ACCELERATION))
    assert max(heights) == pytest.approx(response.msh.max(), rel=0.02)


def test_a_table_is_replayed_with_it(model):
    response, _ = simulate(model.nonlinear(), Inputs(T, ACCELERATION))
    result = replay_table("tub", MotionTable(T, ACCELERATION, msh=response.msh), model)
    assert min(row.sigma for row in result.accuracy if "NL" in row.name) < 1e-4


def test_slosh_simulate_takes_it(model, tmp_path, capsys):
    (tmp_path / "model.yaml").write_text(TEXT)
    table = tmp_path / "motion.csv"
    write_motion_table(table, MotionTable(T, ACCELERATION))
    code = main(
        ["simulate", str(tmp_path / "model.yaml"), str(table), "-o", str(tmp_path / "out.csv")]
    )
    assert code == 0, capsys.readouterr()
    assert "mm" in capsys.readouterr().out
