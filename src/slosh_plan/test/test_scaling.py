"""Tests safe time scales of motions for which slower is not always safer."""

from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Model
from slosh_plan import (
    HeightLimits,
    SloshPlanError,
    Trajectory,
    predict,
    safe_scales,
    scaling,
)
from slosh_plan.tuning import TUNING


def safe_at(model, motion, limits, scales):
    """Returns whether each time scale is safe, by full simulation."""
    motions = [motion.scaled(scale) for scale in scales]
    return np.array([found.kept for found in predict(model, motions, limits=limits)])


def inside(found, scales):
    return np.any([(low <= scales) & (scales <= high) for low, high in found.intervals], axis=0)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("limits", "islands"),
    [
        (HeightLimits(0.015), 0),
        (HeightLimits(0.015, 0.002), 1),
        (HeightLimits(0.005, 0.0005), 3),
    ],
)
def test_safe_scales_and_islands_are_those_of_single_predictions(cup, line, limits, islands):
    motion = line(1.0)
    found = safe_scales(cup, motion, limits)
    assert len(found.islands) == islands
    edges = np.array(found.intervals).ravel()
    scales = np.linspace(found.fastest, found.slowest, 701)
    scales = scales[np.abs(scales[:, np.newaxis] - edges).min(axis=1) > 2e-5]
    assert np.array_equal(inside(found, scales), safe_at(cup, motion, limits, scales))
    slower = found.slowest * np.array([1.0, 1.3, 2.0, 4.0])
    assert found.proven
    assert safe_at(cup, motion, limits, slower).all()


def test_edges_are_on_the_safe_side_and_sharp(cup, line):
    motion, limits = line(1.0), HeightLimits(0.015, 0.002)
    found = safe_scales(cup, motion, limits)
    for low, high in found.intervals:
        assert safe_at(cup, motion, limits, [low * 1.0000001, high]).all()
        assert not safe_at(cup, motion, limits, [low * (1.0 - 2e-4)]).any()
    island = found.islands[0]
    assert not safe_at(cup, motion, limits, [island[1] * (1.0 + 2e-4)]).any()


def test_what_is_no_limit_is_refused(cup, line):
    with pytest.raises(SloshPlanError, match="no limit given"):
        safe_scales(cup, line(), HeightLimits())
    assert safe_scales(cup, line(), HeightLimits(0.015), margin=0.02).intervals == ()


MODEL = Model(Cylinder(0.05, 0.07)).spatial()


@pytest.mark.parametrize("turns", [False, True])
def test_parts_of_the_scales_give_the_same_answer(monkeypatch, turns):
    t = np.linspace(0.0, 2.0, 201)
    acceleration = np.zeros((len(t), 3))
    acceleration[:, 0] = 2.0 * np.sin(np.pi * t)
    attitude = np.tile([0.0, 0.0, 0.0, 1.0], (len(t), 1)) if turns else None
    motion, limits = Trajectory(t, acceleration, attitude), HeightLimits(0.01, 0.002)
    whole = safe_scales(MODEL, motion, limits, count=50)
    monkeypatch.setattr(scaling, "TUNING", replace(TUNING, batch=3000))
    assert safe_scales(MODEL, motion, limits, count=50) == whole
