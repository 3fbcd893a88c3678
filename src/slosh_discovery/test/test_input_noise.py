"""Tests the estimated noise of accelerations and its effect on modelled heights."""

import numpy as np
import pytest
from example_motions import BASE, DURATION, inputs_of

from slosh_discovery.discover import MeasuredMotion, Verdict, discover
from slosh_discovery.discover.driven import answer_columns, answer_covariance
from slosh_discovery.discover.input_noise import estimate_input_noise
from slosh_discovery.discover.problem import prepare
from slosh_discovery.discover.rounds import driven_alike, with_noise
from slosh_model import Cylinder, Inputs, Model, Rectangle, predicted_heights
from slosh_model.interpolation import columns_at

CAMERA = 2e-5


def sampled(inputs, rate, noise, *, bias=0.0, quantum=0.0, seed=0, colour=0.0):
    """Returns noisy accelerometer samples of a motion that follows a second of rest."""
    random = np.random.default_rng(seed)
    t = np.arange(-1.0, inputs.t[-1], 1.0 / rate)
    fresh = random.normal(0.0, noise, (len(t), 3))
    for row in range(1, len(t)) if colour else ():
        fresh[row] += colour * fresh[row - 1]
    values = columns_at(t, inputs.t, inputs.acceleration) + fresh + [bias, 0.0, 0.0]
    return Inputs(t, quantum * np.round(values / quantum) if quantum else values)


def seen(truth, seed, rate=1000.0, noise=0.02, camera=CAMERA, **errors):
    """Returns a motion with true heights, but a noisy acceleration for the model."""
    inputs = inputs_of(seed)
    random = np.random.default_rng(500 + seed)
    t = np.arange(-0.9, DURATION - 0.1, 1.0 / 60.0)
    heights = predicted_heights(
        truth, Inputs([-1.0, *inputs.t], [[0.0] * 3, *inputs.acceleration]), t
    )
    heights = heights[:, 0] + camera * random.normal(size=len(t))
    given = sampled(inputs, rate, noise, seed=seed, **errors)
    return MeasuredMotion(f"motion {seed}", given, t, msh=heights, stddev=np.full(len(t), camera))


@pytest.mark.parametrize(("rate", "noise"), [(1000.0, 0.02), (250.0, 0.05), (125.0, 0.2)])
@pytest.mark.parametrize("bias", [0.0, 0.1])
def test_the_noise_is_estimated_at_rest(rate, noise, bias):
    found = estimate_input_noise(sampled(inputs_of(1), rate, noise, bias=bias))
    assert found.stddev == pytest.approx(noise, rel=0.1)
    assert found.density == pytest.approx(noise**2 / rate, rel=0.2)
    assert found.quantum == 0.0


def test_an_exact_input_has_none_and_a_rounded_one_its_rounding():
    assert estimate_input_noise(inputs_of(1)) is None
    found = estimate_input_noise(sampled(inputs_of(1), 250.0, 0.0, quantum=0.04))
    assert found.quantum == pytest.approx(0.04)
    assert found.stddev == pytest.approx(0.04 / np.sqrt(12.0), rel=0.3)


@pytest.mark.parametrize("quantum", [0.01, 0.04])
def test_rounding_moves_the_liquid_no_more_than_is_foretold(quantum):
    """Tests that rounded accelerations move the liquid no more than predicted."""
    mode, random = BASE.mode_constants()[0], np.random.default_rng(3)
    omega, zeta = mode.natural_frequency, mode.damping_ratio
    t, late = np.arange(0.0, 6.0, 1e-3), np.arange(2.0, 6.0, 0.02)
    columns = answer_columns(late - 1.0, omega, zeta, 1e-9)
    found, foretold, white = [], [], []
    for _ in range(20):
        exact = np.zeros((len(t), 3))
        for axis in (0, 1):
            phase = (t - 1.0) / random.uniform(0.4, 0.8)
            law = np.interp(phase, [0.0, 0.15, 0.35, 0.65, 0.85, 1.0], [0, 1, 1, -1, -1, 0], 0, 0)
            exact[:, axis] = random.uniform(0.5, 4.0) * law
        rounded = quantum * np.round(exact / quantum)
        noise = estimate_input_noise(Inputs(t, rounded))
        assert noise.quantum == pytest.approx(quantum)
        off = predicted_heights(BASE, Inputs(t, rounded - exact), late, [0.0])
        found.append(np.mean((off / BASE.height_gains()[0]) ** 2))
        foretold.append(noise.density * np.mean(np.sum(columns**2, axis=1)))
        white.append(quantum**2 / 12.0 * 1e-3 * np.mean(np.sum(columns**2, axis=1)))
    assert np.mean(white) < np.mean(found) < np.mean(foretold) < 6.0 * np.mean(found)


def test_the_answer_s_covariance_is_that_of_many_simulations():
    mode, count = BASE.mode_constants()[0], 300
    rate, t = 250.0, np.linspace(0.5, 4.0, 30)
    random = np.random.default_rng(2)
    grid = np.arange(0.0, 4.2, 1.0 / rate)
    found = []
    for _ in range(count):
        force = np.zeros((len(grid), 3))
        force[:, 0] = random.normal(0.0, 1.0, len(grid))
        found.append(predicted_heights(BASE, Inputs(grid, force), t, [0.0])[:, 0])
    gain = BASE.height_gains()[0]
    simulated = np.cov(np.array(found).T) * rate / gain**2
    omega, zeta = mode.natural_frequency, mode.damping_ratio
    exact = np.column_stack([answer_covariance(t, moment, omega, zeta) for moment in t])
    assert simulated == pytest.approx(exact, abs=0.25 * exact.max())
    assert np.trace(simulated) == pytest.approx(np.trace(exact), rel=0.1)
    tolerated = 1e-3 * exact.max()
    columns = answer_columns(t, omega, zeta, tolerated)
    assert columns @ columns.T == pytest.approx(exact, abs=2.0 * tolerated)
    assert np.all(np.diag(exact - columns @ columns.T) <= 1.01 * tolerated)


@pytest.mark.parametrize(("rate", "noise", "errors"), [
    pytest.param(1000.0, 0.02, {}, marks=pytest.mark.long),
    pytest.param(250.0, 0.05, {}, marks=pytest.mark.long),
    (125.0, 0.02, {"quantum": 0.04}),
    pytest.param(250.0, 0.02, {"bias": 0.05}, marks=pytest.mark.long),
    pytest.param(250.0, 0.0, {"bias": 0.05}, marks=pytest.mark.long),
])  # fmt: skip
def test_nothing_is_named_where_only_the_input_is_noisy(rate, noise, errors):
    motions = [seen(BASE, seed, rate, noise, **errors) for seed in range(3)]
    finding = discover(motions, BASE)
    assert (finding.verdict, finding.effects) == (Verdict.NONE, ())
    assert finding.gap.fit_before > 2.0 * CAMERA
    assert finding.gap.noise == pytest.approx(finding.gap.fit_before, rel=1.0)


@pytest.mark.long
def test_what_is_missing_is_named_beside_the_input_s_noise():
    truth = BASE.with_effect("quadratic_damping", beta=0.2)
    finding = discover([seen(truth, seed) for seed in range(3)], BASE)
    (effect,) = finding.effects
    assert (effect.name, finding.verdict) == ("quadratic_damping", Verdict.NAMED)
    error = effect.standard_errors["beta"]
    # What drives the residual drives its slopes, too: a bias of a few errors is left.
    assert error < 0.005
    assert effect.parameters["beta"] == pytest.approx(0.2, rel=0.1)


@pytest.mark.long
def test_nothing_is_proposed_that_the_camera_itself_says_it_cannot_see():
    """Tests that no effect is proposed that is smaller than the camera's stated noise."""
    truth = BASE.with_effect("height_offset", offset=4e-5)
    motions = [seen(truth, seed, noise=0.0, camera=1e-5) for seed in range(2)]
    finding = discover(motions, BASE)
    assert {effect.name for effect in finding.effects} == {"height_offset"}
    claiming = [
        MeasuredMotion(m.name, m.inputs, m.t, msh=m.msh, stddev=np.full(len(m.t), 8e-5))
        for m in motions
    ]
    finding = discover(claiming, BASE)
    assert (finding.verdict, finding.effects) == (Verdict.NONE, ())


@pytest.mark.long
@pytest.mark.parametrize(
    "base", [Model(Rectangle(0.16, 0.12, 0.07)), Model(Cylinder(0.1, 0.07))], ids=["box", "cup"]
)
def test_another_container_is_asked_for_and_no_effect_is_named(base):
    finding = discover([seen(BASE, seed) for seed in range(2)], base)
    assert (finding.verdict, finding.effects) == (Verdict.UNEXPLAINED, ())
    (remark,) = finding.remarks
    assert remark.startswith("Is this the right container? The liquid oscillates at ")
    seen_hz = float(remark.split(" oscillates at ")[1].split(" Hz")[0])
    truth = BASE.mode_constants()[0].natural_frequency / (2.0 * np.pi)
    assert seen_hz == pytest.approx(truth, rel=0.03)
    assert finding.proposal is None


def test_a_bias_is_carried_through_a_frequency_that_changes():
    """Tests the propagation of a bias if the vertical acceleration changes the frequency."""
    model, bias = BASE.with_effect("vertical_acceleration"), np.array([0.02, 0.0, 0.0])
    t = np.arange(-1.0, 6.0, 2e-3)
    rhythm = np.sin(2.0 * BASE.mode_constants()[0].natural_frequency * t)
    given = Inputs(t, np.outer(np.clip(t, 0.0, 1.0) * rhythm, [0.0, 0.0, 3.0]) + bias)
    times = np.arange(-0.9, 5.9, 1.0 / 60.0)
    moved = predicted_heights(model, given, times)[:, 0]
    assert np.max(moved) > 5.0 * bias[0] / 9.81 * BASE.container.size
    motion = MeasuredMotion("up and down", given, times, msh=np.zeros(len(times)))
    driven = with_noise(prepare(motion, noise=CAMERA), model, 0.0, None).driven
    foretold = np.sqrt(np.sum(driven[:, 0] ** 2, axis=1))
    assert foretold == pytest.approx(moved, abs=0.02 * moved.max())


def test_models_that_move_the_liquid_elsewhere_are_notdriven_alike():
    """Tests that models with equal modes but other directions of response are told apart."""
    one = prepare(seen(BASE, 1))
    assert driven_alike(one, BASE, BASE.with_effect("time_offset", tau=0.01))
    assert not driven_alike(one, BASE, BASE.with_effect("accel_gain", gain=2.0))
