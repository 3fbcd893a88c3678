"""Tests that a motion that tilts the container is not treated as upright."""

import math

import numpy as np
import pytest

from slosh_model import Cylinder, Model
from slosh_model.tilt import TILT_THRESHOLD, added_text, ignored_text, largest_tilt, with_tilt
from slosh_plan import HeightLimits, Trajectory, predict, safe_scales

CUP = Model(Cylinder(0.05, 0.07)).nonlinear().spatial()


def tilting(degrees, name="tilt"):
    """Returns a motion that tilts the container about y and back within a second."""
    t = np.linspace(0.0, 1.0, 501)
    half = 0.25 * math.radians(degrees) * (1.0 - np.cos(2.0 * np.pi * t))
    zero = np.zeros_like(t)
    attitude = np.column_stack([zero, np.sin(half), zero, np.cos(half)])
    return Trajectory(t, np.zeros((len(t), 3)), attitude, name=name)


def test_the_largest_tilt_is_that_of_the_containers_axis():
    assert largest_tilt(None) == 0.0
    for angle in (1e-9, 0.3, 3.0):
        tip = np.array([[0.0, math.sin(angle / 2), 0.0, math.cos(angle / 2)]])
        yaw = np.array([[0.0, 0.0, math.sin(0.4), math.cos(0.4)]])
        assert largest_tilt(2.0 * tip) == pytest.approx(angle, rel=1e-12)
        assert largest_tilt(np.concatenate([yaw, tip])) == pytest.approx(angle, rel=1e-12)
        assert largest_tilt(yaw) == 0.0


@pytest.mark.parametrize("degrees", [0.4, 0.6, 30.0])
def test_gravity_is_felt_where_a_motion_tilts(degrees):
    motion = tilting(degrees)
    tilts = math.radians(degrees) > TILT_THRESHOLD
    assert with_tilt(CUP, motion.attitude) == (CUP.with_gravity_tilt() if tilts else CUP)
    assert bool(added_text(CUP, motion.attitude)) == tilts
    assert bool(ignored_text(CUP, motion.attitude)) == tilts
    assert added_text(CUP.with_gravity_tilt(), motion.attitude) == ""
    (found,) = predict(CUP, motion)
    (right,) = predict(CUP.with_gravity_tilt(), motion)
    assert found.nonlinear.peak == (right.nonlinear.peak if tilts else 0.0)
    assert found.nonlinear.model == ("3D-NL+gravity_tilt" if tilts else "3D-NL")


def test_no_time_scale_of_a_large_tilt_is_safe():
    """Tests that no time scale is safe for a tilt at which the wall falls below the surface."""
    scales = safe_scales(CUP, tilting(60.0), HeightLimits(0.02))
    assert math.isnan(scales.safe_from)
