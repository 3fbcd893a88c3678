"""Tests with random trays that the predicted worst container is the worst."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_model import Cylinder, Model
from slosh_model.tray import Tray, TrayContainer
from slosh_plan import Trajectory
from slosh_plan.planning.time_law import PlannedMotion
from slosh_plan.tray import predict_tray
from slosh_testing.planned_equations import planned_heights

CUPS = 4
AGREE = 2e-3
"""By how much of a height the two may differ; the prediction joins poses by splines."""
CLOSE = 0.01
"""Two containers whose shares of their limits differ by less are equally bad."""


def eased(t, duration):
    """Returns the quintic from 0 to 1."""
    u = np.clip(t / duration, 0.0, 1.0)
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)


def drawn(seed):
    """Draws a tray of cups with limits, and a motion of it that turns about the vertical."""
    rng = np.random.default_rng(seed)
    containers = []
    for number in range(CUPS):
        cup = Cylinder(rng.uniform(0.025, 0.06), rng.uniform(0.03, 0.09))
        place = (*rng.uniform(-0.25, 0.25, 2).tolist(), 0.0)
        model = Model(cup).spatial().nonlinear()
        limit = float(rng.uniform(0.005, 0.03))
        containers.append(TrayContainer(f"cup_{number}", model, place, limit))
    duration = rng.uniform(0.6, 1.5)
    t = np.arange(round(duration * 1000) + 1) / 1000
    position = np.outer(eased(t, t[-1]), [*rng.uniform(-0.4, 0.4, 2), rng.uniform(-0.1, 0.1)])
    yaw = rng.uniform(-1.5, 1.5) * eased(t, t[-1])
    return Tray(tuple(containers)), t, position, Rotation.from_euler("z", yaw[:, None])


def share_of(one, t, position, turned):
    """Returns a container's peak height divided by its limit, computed from its own path."""
    fine = np.vstack([position[:1], position, position[-1:]])
    way = fine + Rotation.concatenate([turned[:1], turned, turned[-1:]]).apply(one.place)
    acceleration = (way[2:] - 2.0 * way[1:-1] + way[:-2]) * 1e6
    motion = PlannedMotion(t, way[1:-1], acceleration, np.zeros(len(t)))
    return planned_heights(one.model.container, motion).max() / one.limit


def check(seed):
    tray, t, position, turned = drawn(seed)
    motion = Trajectory.from_poses(t, position, turned.as_quat())
    (found,) = predict_tray(tray, [motion])
    shares = {one.name: share_of(one, t, position, turned) for one in tray.containers}
    for one in tray.containers:
        told = found.containers[one.name].nonlinear.peak / one.limit
        assert told == pytest.approx(shares[one.name], rel=AGREE)
    assert shares[found.worst] >= (1.0 - CLOSE) * max(shares.values())


def test_the_worst_of_a_random_tray_is_named():
    check(1000)


@pytest.mark.long
def test_the_worst_of_a_hundred_random_trays_is_named():
    for seed in range(100):
        check(seed)
