"""Tests that batch simulations give exactly the results of single ones."""

from functools import cache

import numpy as np
import pytest
from example_effects import STRENGTHS, in_fitting_container
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_model.batch import wall_heights
from slosh_model.effects.registry import EFFECTS
from slosh_model.errors import SloshModelError
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate

CUP = Cylinder(0.05, 0.07)
PLAIN = Model(CUP, damping_ratio=0.02)
ALONE = [
    in_fitting_container(PLAIN, name).with_effect(name, **STRENGTHS[name]) for name in EFFECTS
]


@cache
def motion(samples: int, seed: int, *, turning: bool = False, spacing: float = 0.004) -> Inputs:
    """Returns a motion with uneven time steps, upright or with tilt and rotation.

    The same object for the same arguments: simulations may share motions.
    """
    random = np.random.default_rng(seed)
    t = np.cumsum(random.uniform(0.1 * spacing, spacing, samples))
    waves = [3.0 * np.sin(random.uniform(8.0, 20.0) * t + seed) for _ in range(3)]
    attitude = np.column_stack(
        [0.1 * np.sin(9 * t), 0.1 * np.cos(8 * t), np.sin(5 * t), np.cos(5 * t)]
    )
    return Inputs(t, np.column_stack(waves), attitude if turning else None)


def alone(model: Model, inputs: Inputs, max_step: float = 0.002) -> np.ndarray:
    """Returns wall heights (N, 2) that `simulate` computes."""
    response, _ = simulate(model, inputs, max_step=max_step)
    return np.column_stack([response.sh_x, response.sh_y])


@pytest.mark.parametrize("turning", [False, True])
def test_every_effect(turning: bool) -> None:
    inputs = motion(150, 1, turning=turning)
    models = [model for model in ALONE for _ in range(5)]  # enough to go through as vectors
    for model, heights in zip(models, wall_heights(models, inputs), strict=True):
        assert heights.tobytes() == alone(model, inputs).tobytes(), model.name


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(1, 90), st.integers(0, 5), st.sampled_from(ALONE), st.booleans()),
        min_size=1,
        max_size=50,
    ),
    st.sampled_from([0.0005, 0.002, 0.01]),
)
def test_any_mixture_of_models_and_lengths(
    simulations: list[tuple[int, int, Model, bool]], max_step: float
) -> None:
    models = [model for _, _, model, _ in simulations]
    inputs = [motion(count, seed, turning=turns) for count, seed, _, turns in simulations]
    together = wall_heights(models, inputs, max_step=max_step)
    for model, one, heights in zip(models, inputs, together, strict=True):
        assert heights.tobytes() == alone(model, one, max_step).tobytes()


def test_a_solution_that_leaves_the_finite_numbers_leaves_the_others_alone() -> None:
    wild = Inputs(
        np.array([0.0, 0.01, 0.02]), np.array([[0.0, 0, 0], [1e200, 0, 0], [1e308, 0, 0]])
    )
    calm = motion(3, 5)
    model = Model(CUP).nonlinear()
    heights = wall_heights(model, [calm, wild, calm, calm, calm])
    assert not np.isfinite(heights[1]).all()
    for k in (0, 2, 3, 4):
        assert heights[k].tobytes() == alone(model, calm).tobytes()


def test_numbers_of_models_and_motions_that_do_not_fit_are_refused() -> None:
    with pytest.raises(SloshModelError, match="2 models for 3 simulations"):
        wall_heights([Model(CUP)] * 2, [motion(3, seed) for seed in range(3)])
    with pytest.raises(SloshModelError, match="0 inputs"):
        wall_heights(Model(CUP), [])


@pytest.mark.parametrize("name", ["surface_nonlinearity", "gravity_tilt"])
def test_all_start_from_one_state(name: str) -> None:
    model = PLAIN.with_effect(name)
    _, state = simulate(model, motion(50, 1))
    rest = [one.resampled(one.t - one.t[0] + state.t) for one in (motion(90, k) for k in range(9))]
    for inputs, heights in zip(rest, wall_heights(model, rest, state=state), strict=True):
        response, _ = simulate(model, inputs, state)
        assert heights.tobytes() == np.column_stack([response.sh_x, response.sh_y]).tobytes()
    with pytest.raises(SloshModelError, match=r"a motion starts at .* the state is of"):
        wall_heights(model, [motion(90, 3)], state=state)
