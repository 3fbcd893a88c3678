"""Tests a tray: each container is driven by the acceleration at its own place."""

import math

import numpy as np
import pytest

from slosh_estimator.estimator import Estimator
from slosh_estimator.tray_estimator import TrayEstimator
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.tray import Tray, TrayContainer
from slosh_motion.inputs.sampling import Sample, Samples

MS = 1_000_000
CUP = Model(Cylinder(0.04, 0.06), damping_ratio=0.1)
PLACES = {"middle": (0.0, 0.0, 0.0), "left": (0.0, 0.1, 0.0), "right": (0.0, -0.2, 0.0)}
TRAY = Tray(tuple(TrayContainer(name, CUP, place, 0.01) for name, place in PLACES.items()))
UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def run(samples, tray=TRAY):
    """Returns the last estimates of the tray's containers."""
    first, others = Estimator(tray.first.placed), TrayEstimator(tray)
    for sample in samples:
        found = others.update(sample, first.update(sample))
    return found


def test_a_tray_that_turns_drives_each_by_the_square_of_its_rate_and_its_place():
    """Tests that containers of a turning tray feel the centripetal acceleration -ω² r."""
    rate = 2.0

    def turned(k):
        half = 0.5 * rate * k * 1e-3
        pose = (0.0, 0.0, math.sin(half), math.cos(half), 0.0, 0.0, rate, 0.0, 0.0, 0.0)
        return Sample(k * MS, 0.0, 0.0, 0.0, 2.0 * half, pose=pose)

    found = run([turned(k) for k in range(3000)])
    for name, msh in zip(PLACES, found.msh, strict=True):
        alone = Estimator(CUP)
        for k in range(3000):
            angle, pull = rate * k * 1e-3, -(rate**2) * PLACES[name][1]
            ax, ay = -pull * math.sin(angle), pull * math.cos(angle)
            expected = alone.update(Sample(k * MS, ax, ay, 0.0, angle)).nonlinear.msh
        assert msh == pytest.approx(expected, abs=1e-12)
    assert found.msh[0] == 0.0
    assert list(PLACES)[found.worst] == "right"


def test_without_rotation_all_places_move_alike_and_the_lowest_limit_is_the_worst():
    tray = Tray(
        (
            TRAY.containers[0],
            TrayContainer("low", CUP, (0.3, 0.0, 0.0), 0.005),
            *TRAY.containers[1:],
        )
    )
    pose = (*UPRIGHT, *[0.0] * 6)
    found = run([Sample(k * MS, 1.0, 0.5, 0.0, 0.0, pose=pose) for k in range(200)], tray)
    assert found.msh == pytest.approx([found.msh[0]] * 4)
    assert tray.names[found.worst] == "low"


def test_one_by_one_and_together_give_the_same_bits():
    random = np.random.default_rng(5)
    count = 400
    t = np.arange(count) * 1e-3
    rates = np.column_stack((np.sin(9 * t), np.cos(7 * t), 2 * np.sin(5 * t)))
    poses = np.column_stack((np.tile(UPRIGHT, (count, 1)), rates, random.normal(size=(count, 3))))
    stamps = np.arange(count, dtype=np.int64) * MS
    a = random.normal(size=(count, 3))
    restarted = np.zeros(count, dtype=bool)
    restarted[250] = True
    samples = Samples(stamps, a, np.zeros(count), restarted, poses)
    first, others = Estimator(TRAY.first.placed), TrayEstimator(TRAY)
    many = others.update_many(samples, first.update_many(samples))
    first, others = Estimator(TRAY.first.placed), TrayEstimator(TRAY)
    for k in range(count):
        sample = samples.one(k)
        one = others.update(sample, first.update(sample))
        assert one.msh == many.msh[k].tolist()
        assert one.azimuth == many.azimuth[k].tolist()
        assert one.flags == many.flags[k].tolist()
        assert one.worst == many.worst[k]
