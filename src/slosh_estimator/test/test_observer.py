"""Tests the observer, which corrects a model by heights from a camera."""

import math
from dataclasses import replace

import numpy as np
import pytest

from slosh_estimator.observer import observer as observer_module
from slosh_estimator.observer.calm import CalmWatch
from slosh_estimator.observer.observer import Observer
from slosh_estimator.observer.states import Outcome, WallHeights
from slosh_estimator.observer.surface_heights import SurfaceHeights, wall_heights
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_model import Cylinder, Inputs, Model, Rectangle, State, simulate
from slosh_motion.inputs.sampling import Sample

CUP = Model(Cylinder(0.05, 0.07)).with_effect("vertical_acceleration").nonlinear()
BOX = Model(Rectangle(0.1, 0.08, 0.07))
STEP_NS, START = 2_000_000, 1_000_000_000
AZIMUTHS = np.linspace(-np.pi, np.pi, 8, endpoint=False)
SIGMA = 2e-4
NAN = math.nan


def motion(seconds, *, model=CUP, start=None, push=1.5):
    """Returns inputs with one move, and the wall heights (N, 2) [m] that follow."""
    t = np.arange(0.0, seconds, 0.002)
    a = np.zeros((len(t), 3))
    a[:, 0] = np.where(t < 0.6, push * np.sin(2.0 * np.pi * t / 0.6), 0.0)
    a[:, 1] = 0.5 * a[:, 0]
    state = State(-1e-6, np.array([start or [0.0] * 4]), np.zeros(4))
    wall = simulate(model, Inputs(t, a), state, max_step=0.002)[0]
    return t, a, np.column_stack([wall.sh_x, wall.sh_y])


def stamp(t):
    return START + round(t * 1e9)


def heights(t, values, azimuths=AZIMUTHS):
    columns = [azimuths, values, np.full(len(azimuths), SIGMA)]
    return WallHeights(stamp(t), np.column_stack(columns))


def image(t, t_wall, wall, azimuths=AZIMUTHS):
    x, y = (np.interp(t, t_wall, wall[:, k]) for k in range(2))
    return heights(t, x * np.cos(azimuths) + y * np.sin(azimuths), azimuths)


def run(t, a, images=(), *, model=CUP, flags=0):
    """Returns the observer and its states after given images."""
    observer, states, waiting = Observer(model), [], sorted(images, key=lambda one: one[0])
    for i, moment in enumerate(t):
        while waiting and waiting[0][0] <= moment:
            observer.take(waiting.pop(0)[1])
        sample = Sample(stamp(moment), *a[i].tolist(), restarted=i == 0)
        states.append(observer.follow(sample, flags if i == 0 else 0))
    return observer, [state for state in states if state is not None]


def images_of(t, wall, *, late=0.04, rate=60.0, begin=0.0, end=math.inf, **other):
    moments = np.arange(max(begin, 0.01), min(end, t[-1]), 1.0 / rate)
    return [(moment + late, image(moment, t, wall, **other)) for moment in moments]


def errors(states, t, wall):
    at = np.array([(state.stamp_ns - START) * 1e-9 for state in states])
    truth = np.column_stack([np.interp(at, t, wall[:, k]) for k in range(2)])
    return at, np.array([[state.sh_x, state.sh_y] for state in states]) - truth


def test_without_measurements_it_is_the_open_loop_model():
    t, a, wall = motion(2.0)
    observer, states = run(t, a)
    assert np.abs(errors(states, t, wall)[1]).max() < 1e-8
    assert states[-1].corrected_ns is None
    assert math.isinf(states[-1].uncorrected)
    assert not states[-1].trusted
    assert observer.counts == dict.fromkeys(Outcome, 0)


def test_states_are_given_a_hundred_times_a_second():
    t, a, _ = motion(1.0)
    gaps = np.diff([state.stamp_ns for state in run(t, a)[1]])
    assert set(gaps.tolist()) == {10_000_000}


def test_a_wave_that_was_there_at_the_start_is_known_within_a_period():
    t, a, wall = motion(1.5, start=[0.008, -0.006, 0.05, 0.1], push=0.0)
    at, error = errors(run(t, a, images_of(t, wall))[1], t, wall)
    assert np.hypot(*wall.T).max() > 0.015
    assert np.abs(error[at > 0.35]).max() < 1e-3
    assert np.abs(error[at > 1.0]).max() < 4e-4


def test_wrong_frequency_and_damping_are_found():
    true = CUP.with_effect("frequency_mismatch", factor=0.97)
    true = true.with_effect("damping_mismatch", factor=3.0)
    t, a, wall = motion(6.0, model=true, push=2.5)
    states = run(t, a, images_of(t, wall))[1]
    at, error = errors(states, t, wall)
    opened = errors(run(t, a)[1], t, wall)[1]
    late = at > 1.0
    assert np.std(error[late]) < 0.1 * np.std(opened[late])
    assert states[-1].frequency_factor == pytest.approx(0.97, abs=0.003)
    assert states[-1].damping_factor == pytest.approx(3.0, rel=0.15)


def test_its_standard_deviation_by_the_frequency_is_the_models_own_derivative(monkeypatch):
    small = replace(
        TUNING, rest_wave=0.0, noise_floor=0.0, noise_share=0.0, noise_wave=0.0,
        frequency_walk=0.0, damping_walk=0.0, frequency_spread=1e-3, damping_spread=0.0,
    )  # fmt: skip
    monkeypatch.setattr(observer_module, "TUNING", small)
    t, a, wall = motion(1.0, push=0.3)
    states = run(t, a)[1]
    other = motion(1.0, model=CUP.with_effect("frequency_mismatch", factor=1.0001), push=0.3)[2]
    derivative = (other - wall) / 1e-4
    expected = 1e-3 * np.abs(derivative)
    found = np.array([(state.sh_x_stddev, state.sh_y_stddev) for state in states])
    assert np.abs(found - expected[::5]).max() < 0.02 * expected.max()


def test_a_late_measurement_tells_the_same_as_a_prompt_one():
    t, a, wall = motion(2.0, start=[0.002, 0.001, 0.0, 0.0], push=0.2)
    last = [
        run(t, a, images_of(t, wall, late=late, end=1.5))[1][-1] for late in (0.001, 0.06, 0.2)
    ]
    for state in last[1:]:
        assert state.msh == pytest.approx(last[0].msh, abs=2e-5)
        assert state.corrected_ns == last[0].corrected_ns


def test_an_outlier_is_rejected_and_a_push_is_taken_up():
    t, a, wall = motion(3.0)
    honest = images_of(t, wall)
    lie = heights(1.5, 0.02 * np.cos(AZIMUTHS))
    observer, states = run(t, a, [*honest, (1.54, lie)])
    assert observer.counts[Outcome.REJECTED] == 1
    assert np.abs(errors(states, t, wall)[1]).max() < 5e-4

    pushed = simulate(
        CUP, Inputs(t, a), State(-1e-6, np.array([[0.0, 0.006, 0.1, 0.0]]), np.zeros(4))
    )[0]
    after = np.column_stack([pushed.sh_x, pushed.sh_y])
    both = [*images_of(t, wall, end=1.5), *images_of(t, after, begin=1.5)]
    observer, states = run(t, a, both)
    at, error = errors(states, t, after)
    assert np.abs(error[at > 1.9]).max() < 1e-3
    assert observer.counts[Outcome.REJECTED] <= 3


def test_points_that_are_no_wave_are_not_taken_up():
    t, a, wall = motion(2.0)
    rng = np.random.default_rng(1)
    noise = [
        (m + 0.01, heights(m, rng.normal(0.0, 0.01, len(AZIMUTHS))))
        for m in np.arange(1.0, 1.5, 1.0 / 60.0)
    ]
    observer, states = run(t, a, [*images_of(t, wall, end=1.0), *noise])
    assert observer.counts[Outcome.REJECTED] == len(noise)
    assert np.abs(errors(states, t, wall)[1]).max() < 5e-4


def test_without_a_camera_it_says_how_wrong_it_may_be():
    true = CUP.with_effect("frequency_mismatch", factor=1.01)
    t, a, wall = motion(8.0, model=true, push=2.0)
    states = run(t, a, images_of(t, wall, end=2.0))[1]
    at, error = errors(states, t, wall)
    claimed = np.array([(state.sh_x_stddev, state.sh_y_stddev) for state in states])
    blind = at > 2.0
    assert np.mean(np.abs(error[blind]) <= 2.0 * claimed[blind]) > 0.9
    assert states[-1].uncorrected == pytest.approx(6.0, abs=0.1)


def test_the_clock_of_the_measurement_is_found():
    t, a, wall = motion(4.0, push=2.0)
    a[:, 0] += np.where((t > 1.2) & (t < 1.8), 2.0 * np.sin(2 * np.pi * (t - 1.2) / 0.6), 0.0)
    response = simulate(CUP, Inputs(t, a), max_step=0.002)[0]
    wall = np.column_stack([response.sh_x, response.sh_y])
    shown = [
        (moment, WallHeights(one.stamp_ns + 4_000_000, one.points))
        for moment, one in images_of(t, wall)
    ]
    assert run(t, a, shown)[1][-1].clock_offset == pytest.approx(4e-3, abs=1.5e-3)


def test_a_gap_and_an_unknown_start_are_unsure():
    t, a, wall = motion(1.0, push=0.0)
    known, unknown = (
        run(t, a, flags=flags)[1][5].msh_stddev for flags in (0, int(EstimateFlag.SETTLING))
    )
    assert known < 1e-3 < 5e-3 < unknown
    observer, _ = run(t, a, images_of(t, wall))
    state = observer.follow(
        Sample(stamp(3.0), 0.0, 0.0, 0.0, restarted=True), int(EstimateFlag.AFTER_GAP)
    )
    assert state.msh_stddev > 5e-3
    assert state.corrected_ns is None


def test_without_any_measurement_for_long_nothing_grows():
    observer = Observer(CUP)
    for i in range(4000):
        state = observer.follow(Sample(START + i * STEP_NS, 0.0, 0.0, 0.0, restarted=i == 0))
    assert state is None or 0.0 < state.msh_stddev < 0.02


def test_measurements_out_of_order_late_and_ahead_are_counted():
    t, a, wall = motion(1.0)
    early, late = image(0.2, t, wall), image(0.4, t, wall)
    ahead = WallHeights(stamp(60.0), late.points)
    empty = WallHeights(stamp(0.45), np.empty((0, 3)))
    observer, _ = run(t, a, [(0.42, late), (0.5, early), (0.6, ahead), (0.7, empty)])
    counts = observer.counts
    expected = {Outcome.USED: 1, Outcome.REJECTED: 0, Outcome.LATE: 2, Outcome.EMPTY: 1}
    assert counts == expected
    assert observer.taken == 4


def test_the_same_input_gives_the_same_bits():
    t, a, wall = motion(2.0)
    images = images_of(t, wall)
    assert run(t, a, images)[1] == run(t, a, images)[1]


@pytest.mark.parametrize("model", [BOX, CUP.with_effect("second_mode")])
def test_a_rectangle_and_more_modes_are_corrected(model):
    modes = len(model.mode_constants())
    t = np.arange(0.0, 2.0, 0.002)
    a = np.zeros((len(t), 3))
    first = np.zeros((modes, 4))
    first[0] = [0.003, -0.002, 0.05, 0.05]
    wall = simulate(model, Inputs(t, a), State(-1e-6, first, np.zeros(4)), max_step=0.002)[0]
    truth = np.column_stack([wall.sh_x, wall.sh_y])
    places = np.array([0.0, 0.5, 1.0, 1.5]) * np.pi  # middles of the sides
    images = images_of(t, truth, azimuths=places)
    at, error = errors(run(t, a, images, model=model)[1], t, truth)
    assert np.abs(error[at > 1.0]).max() < 5e-4


SURFACE = SurfaceHeights(
    0.01, 1e-4, 0.3, 0.0098, 1e-4, 0.31, 0.002, -0.004, 1.2, -1.9, NAN, 0
)  # fmt: skip


def test_a_surface_gives_its_edges_its_maximum_and_the_zero_line():
    points = wall_heights(5, SURFACE).points
    assert points[:, 0] == pytest.approx([1.2, -1.9, 0.3, 0.31 - np.pi / 2, 0.31 + np.pi / 2])
    assert points[:, 1].tolist() == [0.002, -0.004, 0.01, 0.0, 0.0]
    side = wall_heights(5, SURFACE._replace(slope_angle=0.1, azimuth=NAN))
    assert side.points[:, 1].tolist() == [0.002, -0.004]


def test_what_is_no_height_gives_no_points():
    for flag in (1, 32, 64, 128, 256, 512):
        assert len(wall_heights(5, SURFACE._replace(flags=flag)).points) == 0
    lost = SurfaceHeights(*(NAN,) * 11, 0)
    assert len(wall_heights(5, lost).points) == 0
    alone = wall_heights(5, lost._replace(msh=0.003)).points
    assert alone.shape == (1, 3)
    assert math.isnan(alone[0, 0])
    assert alone[0, 2] == 5e-4


@pytest.mark.parametrize("moves", [True, False])
def test_calm_is_told_after_time_was_set_back(moves):
    observer, watch = Observer(Model(Cylinder(0.05, 0.07), damping_ratio=0.05)), CalmWatch(1e-3)
    calm = None
    for begin, count in ((1000, 400), (500, 3000)):
        for k in range(count):
            push = 3.0 * math.sin(math.tau * k / 200) if moves and begin == 1000 else 0.0
            stamp_ns = begin * 1_000_000_000 + k * 5_000_000
            state = observer.follow(Sample(stamp_ns, push, 0.0, 0.0, restarted=calm is None))
            calm = watch.update(state) if state is not None else calm
    assert calm.calm, calm
