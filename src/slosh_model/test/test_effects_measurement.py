"""Tests effects on the measurement against what a sensor would read."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_model.measure import measured_heights, predicted_heights
from slosh_model.model import Model
from slosh_model.response import Response
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, State, simulate

RADIUS = 0.05
PLAIN = Model(Cylinder(RADIUS, 0.07), damping_ratio=0.02)
AZIMUTHS = np.array([0.0, 0.9, math.pi, -2.0])
T = np.arange(0.0, 2.0, 0.002)
PUSH = np.stack(
    [2.0 * np.sin(11.0 * T), 1.5 * np.cos(7.0 * T), np.sin(9.0 * T)], axis=1
) * np.minimum(T, 1.0).reshape(-1, 1)
INPUTS = Inputs(T, PUSH)
TIMES = np.arange(0.0, 2.0, 1.0 / 60.0)
MSH = predicted_heights(PLAIN, INPUTS, TIMES)
WALL = predicted_heights(PLAIN, INPUTS, TIMES, AZIMUTHS)


def read(name, **parameters):
    """Returns maximum heights and heights by azimuth with an effect."""
    model = PLAIN.with_effect(name, **parameters)
    return (
        predicted_heights(model, INPUTS, TIMES),
        predicted_heights(model, INPUTS, TIMES, AZIMUTHS),
    )


def response(sh_x, sh_y, t=T):
    """Returns a response made of given heights."""
    return Response(t, sh_x, sh_y, np.zeros((len(t), 1, 4)))


# height_scale, height_offset, frame_saturation


@pytest.mark.parametrize("gain", [0.2, 1.3])
def test_height_scale_multiplies(gain):
    msh, wall = read("height_scale", gain=gain)
    assert msh == pytest.approx(gain * MSH, rel=1e-12)
    assert wall == pytest.approx(gain * WALL, rel=1e-12)


@pytest.mark.parametrize("offset", [-0.004, 0.003])
def test_height_offset_adds(offset):
    msh, wall = read("height_offset", offset=offset)
    assert msh == pytest.approx(MSH + offset, abs=1e-12)
    assert wall == pytest.approx(WALL + offset, abs=1e-12)


def test_frame_saturation_cuts_crests_and_no_troughs():
    cap = 0.006
    msh, wall = read("frame_saturation", cap=cap)
    assert np.array_equal(msh, np.minimum(MSH, cap))
    assert np.array_equal(wall, np.minimum(WALL, cap))
    assert msh.max() == cap
    assert wall.min() < -cap


# crest_asymmetry


@pytest.mark.parametrize("kappa", [-0.5, 0.8])
def test_crest_asymmetry_lifts_crests_and_fills_troughs(kappa):
    msh, wall = read("crest_asymmetry", kappa=kappa)
    assert msh == pytest.approx(MSH + kappa * MSH**2 / RADIUS, abs=1e-12)
    assert wall == pytest.approx(WALL + kappa * WALL**2 / RADIUS, abs=1e-12)
    # Of both sides together twice the second order is left.
    assert wall[:, 0] + wall[:, 2] == pytest.approx(2.0 * kappa * WALL[:, 0] ** 2 / RADIUS)


# visible_arc


@settings(max_examples=20, deadline=None)
@given(
    st.floats(-3.2, 3.2),
    st.floats(0.0, 2.0 * math.pi),
    st.lists(st.tuples(st.floats(-0.03, 0.03), st.floats(-0.03, 0.03)), min_size=1, max_size=8),
)
def test_visible_arc_shows_the_maximum_over_its_azimuths(centre, width, waves):
    sh_x, sh_y = np.array(waves).T
    fine = centre + width * np.linspace(-0.5, 0.5, 2001)
    wall = np.outer(sh_x, np.cos(fine)) + np.outer(sh_y, np.sin(fine))
    model = PLAIN.with_effect("visible_arc", centre=centre, width=width)
    found = measured_heights(model, response(sh_x, sh_y, np.arange(float(len(waves)))))
    # Between two azimuths of the grid a crest is at most 1 - cos(step / 2) higher.
    assert found[:, 0] == pytest.approx(wall.max(axis=1), abs=1e-7)


# sensor_tilt


def test_sensor_tilt_reads_a_crest_by_where_it_is():
    """Tests sensor_tilt: the error at the crest depends on its azimuth."""
    crest, height = np.linspace(-3.0, 3.0, 25), 0.012
    model = PLAIN.with_effect("sensor_tilt", e_x=0.03, e_y=-0.05)
    turning = response(height * np.cos(crest), height * np.sin(crest), np.arange(25.0))
    found = measured_heights(model, turning)[:, 0]
    lean = RADIUS * (0.03 * np.cos(crest) - 0.05 * np.sin(crest))
    assert found == pytest.approx(height + lean, abs=1e-12)
    places = np.array([0.0, 0.5 * math.pi, math.pi])
    wall = measured_heights(model, turning, places) - measured_heights(PLAIN, turning, places)
    assert wall == pytest.approx(np.tile(RADIUS * np.array([0.03, -0.05, -0.03]), (25, 1)))


# draining_film


def test_draining_film_hides_how_fast_a_crest_decays():
    """Tests draining_film: a falling surface is read too high."""
    speed, height, rate = 0.02, 0.01, 4.0
    decay = height * np.exp(-rate * T)
    model = PLAIN.with_effect("draining_film", speed=speed)
    found = measured_heights(model, response(decay, np.zeros_like(T)))[:, 0]
    film = height - speed * T
    assert found == pytest.approx(np.maximum(film, decay), abs=1e-12)
    assert np.count_nonzero(film > decay + 1e-6) > 100
    assert np.count_nonzero(decay > film + 1e-6) > 100
    # No film above what was never wet.
    trough = measured_heights(model, response(-decay, np.zeros_like(T)), [0.0])[:, 0]
    assert np.array_equal(trough, -decay)
    # A film that is faster than the surface shows it.
    quick = PLAIN.with_effect("draining_film", speed=1.01 * rate * height)
    assert np.array_equal(measured_heights(quick, response(decay, 0.0 * T))[:, 0], decay)


# sensor_lag


def test_sensor_lag_reads_a_harmonic_by_its_transfer_function():
    """Tests sensor_lag by its transfer function 1 / (1 + iωT)."""
    time, omega, size = 0.03, 18.0, 0.01
    t = np.arange(0.0, 1.0, 0.0005)
    model = PLAIN.with_effect("sensor_lag", time=time)
    liquid = response(size * np.cos(omega * t), size * np.sin(omega * t), t)
    found = measured_heights(model, liquid, AZIMUTHS)
    for azimuth, row in zip(AZIMUTHS, found.T, strict=True):
        expected = np.real(size * np.exp(1j * (omega * t - azimuth)) / (1.0 + 1j * omega * time))
        late = t > 20.0 * time
        assert row[late] == pytest.approx(expected[late], abs=1e-6)
    # A wave that goes round has one height: nothing is late of it.
    assert measured_heights(model, liquid)[:, 0] == pytest.approx(np.full(len(t), size), abs=1e-12)


# time_offset


@pytest.mark.parametrize("tau", [-0.3, -0.0123, 0.05, 0.3])
def test_time_offset_reads_an_earlier_or_a_later_liquid(tau):
    msh, wall = read("time_offset", tau=tau)
    assert msh == pytest.approx(predicted_heights(PLAIN, INPUTS, TIMES - tau), abs=1e-9)
    assert wall == pytest.approx(predicted_heights(PLAIN, INPUTS, TIMES - tau, AZIMUTHS), abs=1e-9)
    late, early = np.argmax(msh[:, 0]), np.argmax(MSH[:, 0])
    if abs(tau) > 0.03:
        assert abs(TIMES[late] - TIMES[early] - tau) < 0.02


# clock_drift


@pytest.mark.parametrize(("rate", "offset"), [(0.015, 0.0), (-0.03, 0.1), (0.05, -0.2)])
def test_clock_drift_reads_the_liquid_of_the_moment_that_was_stamped(rate, offset):
    """Tests clock_drift: the liquid at time u has the stamp u + offset + rate u."""
    later = Inputs(T + 100.0, PUSH)
    for inputs in (INPUTS, later):
        start = inputs.t[0]
        stamps = start + TIMES + offset + rate * TIMES
        drifting = PLAIN.with_effect("clock_drift", rate=rate, offset=offset)
        found = predicted_heights(drifting, inputs, stamps, AZIMUTHS)
        exact = predicted_heights(PLAIN, inputs, start + TIMES, AZIMUTHS)
        assert found == pytest.approx(exact, abs=1e-9)


# fill_loss, as a reading


def test_a_falling_level_counts_where_the_zero_is_fixed():
    rate = 0.004
    moving = PLAIN.with_effect("fill_loss", rate=rate)
    fixed = PLAIN.with_effect("fill_loss", rate=rate, fixed_zero=1.0)
    for azimuths in (None, AZIMUTHS):
        found = predicted_heights(fixed, INPUTS, TIMES, azimuths)
        own = predicted_heights(moving, INPUTS, TIMES, azimuths)
        assert found == pytest.approx(own - rate * TIMES[:, np.newaxis], abs=1e-12)
    # From a motion's first sample, whatever its clock.
    later = Inputs(T + 100.0, PUSH)
    assert predicted_heights(fixed, later, TIMES + 100.0) == pytest.approx(
        predicted_heights(fixed, INPUTS, TIMES), abs=1e-9
    )


# All of them in their order


def test_what_a_sensor_does_comes_in_the_lights_order():
    """Tests the order of measurement effects: arc, crest, tilt, scale, offset, film, frame."""
    uses = {
        "visible_arc": {"centre": 0.0, "width": 1.0},
        "crest_asymmetry": {"kappa": 0.8},
        "sensor_tilt": {"e_x": 0.02, "e_y": 0.01},
        "height_scale": {"gain": 1.2},
        "height_offset": {"offset": 0.001},
        "draining_film": {"speed": 0.05},
        "frame_saturation": {"cap": 0.006},
    }
    model = PLAIN
    for name in reversed(uses):
        model = model.with_effect(name, **uses[name])
    liquid = simulate(
        PLAIN, INPUTS, State(-0.1, np.array([[0.003, 0.002, 0.0, 0.0]]), np.zeros(4))
    )
    eta = measured_heights(PLAIN.with_effect("visible_arc", **uses["visible_arc"]), liquid[0])[
        :, 0
    ]
    size = np.hypot(liquid[0].sh_x, liquid[0].sh_y)
    lean = RADIUS * (0.02 * liquid[0].sh_x + 0.01 * liquid[0].sh_y) / size
    eta = 1.2 * (eta + 0.8 * eta**2 / RADIUS + lean) + 0.001
    eta = np.maximum.accumulate(eta + 0.05 * T) - 0.05 * T
    expected = np.minimum(eta, 0.006)
    assert expected.max() == 0.006
    assert measured_heights(model, liquid[0])[:, 0] == pytest.approx(expected, abs=1e-12)


# Heights between the motion's samples


@pytest.mark.parametrize("rates", [True, False])
@pytest.mark.parametrize("shift", [0.0, 1e-16, 3e-5])
def test_heights_between_samples_of_a_turning_container(motion, rates, shift):
    """Tests heights between the samples of a turning container."""
    full = motion(tilt=0.3).inputs()
    attitude = (
        full.attitude[::10] * np.where(np.arange(len(full.t[::10])) < 500, 1.0, -1.0)[:, None]
    )
    given = full.angular_velocity[::10] if rates else None
    turning = Inputs(full.t[::10], full.acceleration[::10], attitude, given)
    model = PLAIN.with_effect("gravity_tilt").with_effect("lever_arm", x=0.2, y=0.1, z=0.3)
    liquid = simulate(model, turning)[0]
    times = np.arange(0.0, 1.9, 1.0 / 60.0) + shift
    found = predicted_heights(model, turning, times)[:, 0]
    assert found == pytest.approx(np.interp(times, liquid.t, liquid.msh), abs=5e-5)
