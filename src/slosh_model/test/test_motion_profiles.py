"""Tests motion laws and the machine cycle."""

import math

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson

from slosh_model.errors import SloshModelError
from slosh_model.motion_profiles import EDGE, LAWS, PEAK, Cycle, modified_trapezoid

# The greatest acceleration of each law: a characteristic of it in VDI 2143 and in text books.
PEAKS = {
    "quintic": 10.0 / math.sqrt(3.0),
    "acceleration_pulse": 4.0 / (1.0 - 2.0 * EDGE),
    "modified_trapezoidal": 8.0 * math.pi / (2.0 + math.pi),
    "cycloidal": 2.0 * math.pi,
    "harmonic": 0.5 * math.pi**2,
}
VELOCITIES = {
    "quintic": 1.875,
    "acceleration_pulse": 2.0,
    "modified_trapezoidal": 2.0,
    "cycloidal": 2.0,
    "harmonic": 0.5 * math.pi,
}
JUMPS = {"harmonic": PEAKS["harmonic"]}
"""Accelerations with which a law begins; the others begin with none."""
SPEEDS = range(12, 61, 3)
"""Of TM20's experiments [1/min]."""


@pytest.mark.parametrize("name", LAWS)
def test_a_law_leads_from_rest_to_rest_and_is_the_integral_of_its_derivatives(name):
    u = np.linspace(0.0, 1.0, 4001)
    position, velocity, acceleration = LAWS[name](u)
    assert cumulative_simpson(acceleration, x=u, initial=0) == pytest.approx(velocity, abs=3e-6)
    assert cumulative_simpson(velocity, x=u, initial=0) == pytest.approx(position, abs=1e-7)
    assert (position[0], position[-1]) == (0.0, 1.0)
    assert (velocity[0], velocity[-1]) == (0.0, 0.0)
    jump = JUMPS.get(name, 0.0)
    assert (acceleration[0], acceleration[-1]) == pytest.approx((jump, -jump), abs=1e-12)
    assert np.gradient(position, u)[1:-1] == pytest.approx(velocity[1:-1], abs=1e-5)
    assert np.max(np.abs(np.diff(acceleration))) < 0.03  # continuous


@pytest.mark.parametrize("name", LAWS)
def test_peaks_are_those_of_the_text_books(name):
    u = np.linspace(0.0, 1.0, 20_001)
    _, velocity, acceleration = LAWS[name](u)
    assert acceleration.max() == pytest.approx(PEAKS[name], rel=1e-6)
    assert -acceleration.min() == pytest.approx(PEAKS[name], rel=1e-6)
    assert velocity.max() == pytest.approx(VELOCITIES[name], rel=1e-6)
    assert pytest.approx(8.0 * math.pi / (2.0 + math.pi)) == PEAK


def test_the_pulses_fill_the_motion_time_but_for_their_edges():
    u = np.linspace(0.0, 1.0, 10_001)
    _, _, acceleration = LAWS["acceleration_pulse"](u)
    full = np.abs(np.abs(acceleration) - PEAKS["acceleration_pulse"]) < 1e-9
    assert np.mean(full) == pytest.approx(1.0 - 4.0 * EDGE, abs=1e-3)


@pytest.mark.parametrize("speed", SPEEDS)
@pytest.mark.parametrize("law", ["acceleration_pulse", "quintic"])
def test_the_papers_cycles(law, speed):
    cycle = Cycle(law, speed, 0.1)
    assert cycle.cycle_time == pytest.approx(60.0 / speed)
    assert cycle.motion_time == pytest.approx(0.4 * 60.0 / speed)
    t = np.linspace(0.0, cycle.cycle_time, 20_001)
    position, velocity, acceleration = cycle.at(t)
    assert position[-1] == 0.1
    dwell = t > cycle.motion_time * 1.0001
    assert position[dwell] == pytest.approx(np.full(int(dwell.sum()), 0.1))
    assert not velocity[dwell].any()
    assert acceleration.max() == pytest.approx(PEAKS[law] * 0.1 / cycle.motion_time**2, rel=1e-4)
    assert cumulative_simpson(velocity, x=t, initial=0)[-1] == pytest.approx(0.1, abs=1e-7)


@pytest.mark.parametrize(
    ("change", "match"),
    [
        ({"law": "jump"}, "'jump' is not one of quintic, acceleration_pulse, modified"),
        ({"speed": 0.0}, r"speed = 0\.0 1/min must lie in"),
        ({"stroke": 100.0}, r"stroke = 100\.0 m must lie in \[-10, 10\] m"),
        ({"ratio": 1.2}, r"ratio = 1\.2 must lie in"),
        ({"speed": math.nan}, "speed = nan"),
    ],
)
def test_what_no_machine_does_is_refused(change, match):
    with pytest.raises(SloshModelError, match=match):
        Cycle(**{"law": "quintic", "speed": 30.0, "stroke": 0.1, **change})


def test_the_modified_trapezoid_keeps_to_its_six_segments():
    breaks = np.array([0.125, 0.375, 0.5, 0.625, 0.875])
    _, _, acceleration = modified_trapezoid(breaks)
    assert acceleration == pytest.approx([PEAK, PEAK, 0.0, -PEAK, -PEAK], abs=1e-9)
