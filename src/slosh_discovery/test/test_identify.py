"""Tests the identification on motions with known parameters."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_discovery.discover.colour import estimate_colour
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.identify import Strategy, identify
from slosh_discovery.identify.fitting import fit
from slosh_discovery.identify.parameters import fitted_model, free_parameters
from slosh_discovery.identify.problem import Problem
from slosh_discovery.identify.trials import make_trials, neighbours_of, operating_speed
from slosh_model.measure import measured_heights, predicted_heights
from slosh_model.model import Model
from slosh_model.motion_profiles import Cycle
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.shapes.rectangle import Rectangle
from slosh_model.simulate import Inputs, State, simulate

CUP = Cylinder(0.03, 0.067)
BASE = Model(CUP)
TRUTH = Model(CUP, damping_ratio=0.042, natural_frequency=24.0)
TRUE = {"natural_frequency": 24.0, "damping_ratio": 0.042, "accel_gain.gain": 1.0}
NAMES = ("natural_frequency", "damping_ratio")
SIDE = np.array([math.pi])
NOISE = 3e-4


def drive(speed, law="acceleration_pulse"):
    cycle = Cycle(law, speed, 0.1)
    t = np.arange(0.0, cycle.cycle_time, 1e-3)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = cycle.at(t)[2]
    return Inputs(t, acceleration)


def coloured(rng, count, correlation):
    noise = rng.normal(0.0, 1.0, count)
    for row in range(1, count):
        noise[row] = correlation * noise[row - 1] + math.sqrt(1 - correlation**2) * noise[row]
    return noise


def measured(rng, speed, repeats=1, *, truth=TRUTH, noise=NOISE, rho=0.0, outliers=0.0, gaps=0.0):
    """Returns repeated motions, with wall heights at -x sampled 250 times per cycle."""
    inputs = drive(speed)
    t = np.linspace(0.0, inputs.t[-1], 250)
    heights = predicted_heights(truth, inputs, t, SIDE)
    motions = []
    for number in range(repeats):
        eta = heights + noise * coloured(rng, len(t), rho)[:, np.newaxis]
        eta[rng.random(len(t)) < outliers] += 3e-3
        eta[rng.random(len(t)) < gaps] = np.nan
        name = f"n{speed}-{number}"
        motions.append(MeasuredMotion(name, inputs, t, eta=eta, eta_azimuth=SIDE))
    return motions


def problem_of(motions, names=NAMES, base=BASE):
    trials, _ = make_trials(motions, base, 0.4)
    return Problem(base, free_parameters(base, names), trials)


def values(result):
    return {entry.name: entry.value for entry in result.parameters}


def test_without_noise_it_finds_the_truth():
    motions = measured(np.random.default_rng(0), 48, noise=1e-9)
    names = (*NAMES, "p")
    found = identify(motions, BASE, names).overall
    assert values(found) == pytest.approx(TRUE, rel=1e-5)
    assert found.model.natural_frequency == values(found)["natural_frequency"]
    assert found.model.covariance.parameters == tuple(TRUE)
    (factor,) = [entry for entry in found.derived if entry.name == "p"]
    assert factor.value == pytest.approx(24.0**2 / 9.81, rel=1e-4)


@pytest.mark.long
def test_both_models_of_a_rectangle_by_the_slope_of_its_line():
    """Tests both models of TM20 for a rectangle, identified from the slope of the surface."""
    tank = Rectangle(0.06, 0.05, 0.067)
    truth = Model(tank, damping_ratio=0.042, natural_frequency=22.498)
    truth = truth.with_effect("accel_gain", gain=1.02)
    rng = np.random.default_rng(21)
    motions = []
    for speed in (30, 48):
        inputs = drive(speed)
        t = np.linspace(0.0, inputs.t[-1], 250)
        walls = np.array([0.0, math.pi])
        heights = predicted_heights(truth, inputs, t, walls)
        assert heights[:, 0] == pytest.approx(-heights[:, 1], abs=1e-12)
        for number in range(3):
            eta = heights + NOISE * rng.normal(size=heights.shape)
            name = f"n{speed}-{number}"
            motions.append(MeasuredMotion(name, inputs, t, eta=eta, eta_azimuth=walls))
    base = Model(tank)
    two = identify(motions, base, (*NAMES, "p")).overall
    found = {entry.name: entry for entry in (*two.parameters, *two.derived)}
    for name, true in (
        ("natural_frequency", 22.498),
        ("damping_ratio", 0.042),
        ("p", 1.02 * 22.498**2 / 9.81),
    ):
        assert abs(found[name].value - true) < 3.0 * found[name].error < 0.05 * true
    one = identify(motions, base).overall
    assert one.seoe > two.seoe
    assert one.seoe < 1.1 * two.seoe


def test_colour_is_told_through_gaps_and_outliers():
    rng = np.random.default_rng(3)
    problem = problem_of(measured(rng, 30, 8, rho=0.7, outliers=0.01, gaps=0.1), base=TRUTH)
    residual = problem.residuals([problem.starts])[:, 0]
    colour = estimate_colour(residual, neighbours_of(problem.trials), 0)
    assert colour.stddev == pytest.approx(NOISE, rel=0.08)
    assert colour.correlation == pytest.approx(0.7, abs=0.04)


def test_outliers_move_the_answer_by_less_than_its_error():
    rng = np.random.default_rng(5)
    clean = identify(measured(rng, 48, 3), BASE).overall
    rng = np.random.default_rng(5)
    spoilt = identify(measured(rng, 48, 3, outliers=0.03), BASE).overall
    assert spoilt.outliers > 0.02
    for one, other in zip(clean.parameters, spoilt.parameters, strict=True):
        assert abs(one.value - other.value) < 1.5 * one.error


def covered(runs, seed, names, repeats, **noise):
    """Returns the share of 95 % intervals that contain the true value, by parameter."""
    rng = np.random.default_rng(seed)
    hits = np.zeros(len(names))
    for _ in range(runs):
        problem = problem_of(measured(rng, 48, repeats, **noise), names)
        lower, upper = fit(problem, problem.start(problem.starts)).interval()
        true = np.array([TRUE[parameter.name] for parameter in problem.parameters])
        hits += (lower <= true) & (true <= upper)
    return hits / runs


ROUGH = {"rho": 0.7, "outliers": 0.01, "gaps": 0.1}


@pytest.mark.long
@pytest.mark.timeout(900)
def test_intervals_hold_the_truth_in_many_runs():
    white = covered(200, 31, (*NAMES, "p"), 1)
    assert np.all((white >= 0.90) & (white <= 0.99))
    rough = covered(200, 32, (*NAMES, "p"), 1, **ROUGH)
    assert np.all(rough >= 0.88)


@pytest.mark.long
def test_the_band_holds_the_true_heights():
    rng = np.random.default_rng(10)
    inside = []
    for _ in range(20):
        motions = measured(rng, 48, 1)
        (shown,) = identify(motions, BASE).motions
        true = predicted_heights(TRUTH, motions[0].inputs, shown.t, SIDE)
        inside.append(np.mean(np.abs(true - shown.after)[5:] <= shown.band[5:] + 1e-12))
    assert 0.85 < np.mean(inside) <= 1.0


@pytest.mark.long
def test_one_model_for_all_and_one_for_each_speed():
    rng = np.random.default_rng(11)
    motions = [one for speed in (30, 39, 48) for one in measured(rng, speed, 3)]
    found = identify(motions, BASE, strategy=Strategy.SOSM)
    assert [one.label for one in found.single] == ["30 1/min", "39 1/min", "48 1/min"]
    assert [point.repetitions for point in found.points] == [3, 3, 3]
    for point in found.points:
        assert point.sosm <= point.mosm * 1.001  # more parameters, less residual
        assert point.mosm < 1.05 * point.sosm
        assert point.mosm < 0.6 * point.before
    errors = [entry.error for entry in found.overall.parameters]
    for one in found.single:
        assert all(e > a for e, a in zip([p.error for p in one.parameters], errors, strict=True))
    assert identify(motions, BASE).single == ()


def test_held_out_motions_are_shown_and_not_fitted():
    rng = np.random.default_rng(12)
    found = identify(measured(rng, 48, 2), BASE, holdout=measured(rng, 36, 1))
    shown = found.motions[-1]
    assert (shown.role.value, shown.point) == ("holdout", "36 1/min")
    assert shown.seoe == pytest.approx(NOISE, rel=0.15)
    assert shown.seoe_before > 1.5 * shown.seoe
    assert [point.point.label for point in found.points] == ["48 1/min"]


def test_unrelated_clocks_and_an_unknown_level_are_fitted_with_the_parameters():
    (motion,) = measured(np.random.default_rng(22), 30, noise=1e-4)
    shifted = replace(
        motion, t=motion.t + 0.137, eta=motion.eta + 5e-4, same_clock=False, level_known=False
    )
    found = identify([shifted], BASE)
    assert found.motions[0].clock_offset == pytest.approx(0.137, abs=1e-3)
    assert found.motions[0].seoe == pytest.approx(1e-4, rel=0.1)
    for entry in found.overall.parameters:
        assert abs(entry.value - TRUE[entry.name]) < 3.0 * entry.error


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["msh", "line", "round"])
def test_free_decay_alone_is_enough(kind):
    rng = np.random.default_rng(13)
    t = np.arange(0.0, 6.0, 0.01)
    still = Inputs(np.array([0.0, 6.0]), np.zeros((2, 3)))
    begin = State(0.0, np.array([[0.01, 0.003, 0.02, 0.1]]), np.zeros(4))
    response, _ = simulate(TRUTH, Inputs(t, np.zeros((len(t), 3))), begin)
    azimuths = {"msh": None, "line": [0.3], "round": np.radians([0.0, 90.0, 180.0, 270.0])}[kind]
    heights = measured_heights(TRUTH, response, azimuths)
    heights = heights + 2e-4 * rng.normal(size=heights.shape)
    if azimuths is None:
        motion = MeasuredMotion(kind, still, t, msh=heights[:, 0])
    else:
        motion = MeasuredMotion(kind, still, t, eta=heights, eta_azimuth=np.array(azimuths))
    found = identify([motion], BASE)
    assert found.motions[0].free_decay
    assert found.motions[0].seoe == pytest.approx(2e-4, rel=0.1)
    for entry in found.overall.parameters:
        assert abs(entry.value - TRUE[entry.name]) < 3.0 * entry.error
        assert entry.error < 0.01 * TRUE[entry.name]


@pytest.mark.long
def test_a_gain_that_no_free_decay_tells_of_is_named_with_the_motion_that_would():
    t = np.arange(0.0, 4.0, 0.01)
    still = Inputs(np.array([0.0, 4.0]), np.zeros((2, 3)))
    begin = State(0.0, np.array([[0.01, 0.0, 0.0, 0.0]]), np.zeros(4))
    response, _ = simulate(TRUTH, Inputs(t, np.zeros((len(t), 3))), begin)
    eta = measured_heights(TRUTH, response, [0.0])
    eta = eta + 2e-4 * np.random.default_rng(14).normal(size=eta.shape)
    decay = MeasuredMotion("decay", still, t, eta=eta, eta_azimuth=np.array([0.0]))
    found = identify([decay], BASE, (*NAMES, "p")).overall
    (held,) = found.held
    assert held.name == "accel_gain.gain"
    assert held.help.startswith("back and forth along x")
    assert held.helped < 0.1
    assert set(values(found)) == set(NAMES)
    with pytest.raises(SloshDiscoveryError, match=r"do not determine accel_gain\.gain: add back"):
        identify([decay], BASE, ["p"])


def test_what_cannot_be_told_apart_is_named():
    motions = measured(np.random.default_rng(15), 48, 2)
    found = identify(motions, BASE, (*NAMES, "accel_gain.gain", "height_scale.gain")).overall
    (held,) = found.held
    assert (held.name, held.with_others) == ("height_scale.gain", ("accel_gain.gain",))
    assert held.help == ""  # while the liquid is linear, no motion tells them apart
    assert values(found)["accel_gain.gain"] == pytest.approx(1.0, abs=0.03)


def test_a_measured_frequency_leaves_nothing_for_the_fill_height_to_tell():
    motions = measured(np.random.default_rng(16), 48, 2)
    found = identify(motions, BASE, (*NAMES, "fill_height")).overall
    assert [(held.name, held.with_others) for held in found.held] == [
        ("container.fill_height", ())
    ]


def test_fill_height_from_the_frequency():
    shallow = Model(Cylinder(0.03, 0.022), damping_ratio=0.02)
    motions = measured(np.random.default_rng(17), 36, 3, truth=shallow)
    base = Model(Cylinder(0.03, 0.026))
    found = identify(motions, base, ("fill_height", "damping_ratio")).overall
    entry = found.parameters[0]
    assert entry.name == "container.fill_height"
    assert abs(entry.value - 0.022) < 3.0 * entry.error
    (frequency,) = [one for one in found.derived if one.name == "natural_frequency"]
    assert frequency.value == pytest.approx(shallow.mode_frequency(1), abs=3 * frequency.error)


def test_motions_that_differ_raise_the_errors_and_the_reader_is_told():
    rng = np.random.default_rng(18)
    motions = [
        one
        for damping in (0.03, 0.036, 0.042, 0.048, 0.054, 0.06)
        for one in measured(rng, 48, 1, truth=replace(TRUTH, damping_ratio=damping))
    ]
    found = identify(motions, BASE)
    assert found.overall.scatter > 1.5
    assert "differ by more than noise" in found.remarks[0]
    alike = identify(measured(rng, 48, 6), BASE)
    assert alike.overall.scatter == 1.0
    assert alike.remarks == ()


def test_a_model_that_lacks_something_is_told():
    rng = np.random.default_rng(19)
    truth = replace(TRUTH, damping_ratio=0.01).with_effect("second_mode", damping_ratio=0.01)
    found = identify(measured(rng, 48, 2, truth=truth, noise=1e-4), BASE)
    assert any("the model lacks something" in remark for remark in found.remarks)


def test_a_stroke_and_its_long_decay_have_no_operating_speed():
    """Tests that a short stroke with a long decay has no operating speed."""
    one = drive(155, "quintic")
    step = float(one.t[1] - one.t[0])
    t = np.arange(0.0, 6.0, step)
    for starts, speed in (((0.0,), math.nan), ((0.0, 60 / 155, 120 / 155), 155.0)):
        acceleration = np.zeros((len(t), 3))
        for start in starts:
            rows = round(start / step) + np.arange(len(one.t))
            acceleration[rows] += one.acceleration
        found = operating_speed(Inputs(t, acceleration), 0.4)
        assert found == pytest.approx(speed, rel=2e-2, nan_ok=True)


def test_a_robots_path_has_no_operating_speed():
    t = np.arange(0.0, 4.0, 2e-3)
    window = np.sin(np.pi * t / 4.0) ** 2
    there_and_back = np.column_stack([window * np.sin(9.0 * t), 0.0 * t, 0.0 * t])
    circle = np.column_stack([window * np.sin(9.0 * t), window * np.cos(9.0 * t), 0.0 * t])
    for acceleration in (there_and_back, circle, np.zeros((len(t), 3))):
        assert math.isnan(operating_speed(Inputs(t, acceleration), 0.4))


def test_repetitions_are_one_point_though_their_inputs_are_noisy():
    rng = np.random.default_rng(20)
    motions = []
    for number, speed in enumerate((30, 30, 48, 48)):
        (motion,) = measured(rng, speed, 1)
        noisy = motion.inputs.acceleration + 0.02 * rng.normal(size=(len(motion.inputs.t), 3))
        shifted = Inputs(motion.inputs.t + 0.1 * number, noisy)
        motions.append(replace(motion, inputs=shifted, t=motion.t + 0.1 * number))
    trials, points = make_trials(motions, BASE, 0.4)
    assert [trial.point for trial in trials] == [0, 0, 1, 1]
    assert [point.speed for point in points] == pytest.approx([30.0, 48.0], rel=0.05)


@pytest.mark.parametrize(
    ("names", "match"),
    [
        (("omega",), r"--fit 'omega': no such parameter \(known: p, fill_height, natural"),
        (("gravity_tilt.x",), "no such parameter"),
        (("p", "accel_gain.gain"), "names accel_gain.gain twice"),
        ((), "no parameter to fit"),
    ],
)
def test_parameters_that_are_none_are_refused(names, match):
    with pytest.raises(SloshDiscoveryError, match=match):
        free_parameters(BASE, names)


def test_impossible_values_give_no_model():
    assert fitted_model(BASE, {"damping_ratio": 1.5}) is None
    assert fitted_model(BASE, {"container.fill_height": 0.08}).container.fill_height == 0.08
    assert fitted_model(BASE, {"static_tilt.roll": 0.1}).has("static_tilt")


@pytest.mark.parametrize(
    ("height", "acceleration", "match"),
    [
        (0.0, 1.0, "all heights are 0 to a micrometre: nothing was measured"),
        (1e-300, 1.0, "all heights are 0 to a micrometre: nothing was measured"),
        (1e-9, 1.0, "nothing was measured, the column is empty, or its unit is not m"),
        (1e-3, 1e300, r"accelerations reach 1e\+300 m/s², more than any robot's"),
        (1e300, 1.0, "must be given in metres"),
    ],
)
def test_measurements_that_are_none_are_refused(height, acceleration, match):
    t = np.linspace(0.0, 1.0, 201)
    across = np.zeros((len(t), 3))
    across[:, 0] = acceleration * np.sin(9.0 * t)
    eta = height * np.cos(9.0 * t)[:, np.newaxis]

    def identified():
        motion = MeasuredMotion("run", Inputs(t, across), t, eta=eta, eta_azimuth=np.zeros(1))
        return identify([motion], BASE)

    with pytest.raises(SloshDiscoveryError, match=match):
        identified()


def test_without_motions_there_is_nothing_to_identify():
    with pytest.raises(SloshDiscoveryError, match="no motion with measured"):
        identify([], BASE)
