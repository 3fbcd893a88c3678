"""Tests the governor of trays: heights of all cups, and loosely standing cups stay."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_governor.core import Command, Governor
from slosh_model import Cylinder, Inputs, Model, Rectangle, simulate
from slosh_model.standing import Standing
from slosh_model.standing_use import standing_use
from slosh_model.tray import Tray, TrayContainer
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning.limits import PlanLimits

PERIOD = 0.01
LIMITS = PlanLimits(math.inf, acceleration=6.0, jerk=74.0)
LOOSE = Standing(mass=0.15, centre_height=0.045, base_radius=0.03, friction=0.1)


def liquid(container):
    return Model(container).with_effect("vertical_acceleration").nonlinear()


WIDE, SLIM, BOX = (
    liquid(one) for one in (Cylinder(0.05, 0.07), Cylinder(0.03, 0.08), Rectangle(0.1, 0.07, 0.08))
)
CUPS = (
    TrayContainer("wide", WIDE, (0.1, 0.1, 0.0), 0.018),
    TrayContainer("slim", SLIM, (-0.1, 0.1, 0.0), 0.020, standing=LOOSE),
    TrayContainer("box", BOX, (0.1, -0.1, 0.0), 0.020),
    TrayContainer("tall", liquid(Cylinder(0.04, 0.12)), (-0.1, -0.1, 0.0), 0.025,
                  standing=replace(LOOSE, base_radius=0.011, friction=0.6)),
)  # fmt: skip


def run(governor, seed, count=150):
    """Returns the governed steps for random velocities with jumps, and for the stop."""
    rng = np.random.default_rng(seed)
    row, moved = np.zeros(3), []
    for step in range(1, count + 1):
        if rng.random() < 0.04:
            row = rng.normal(size=3) * [0.5, 0.5, 0.2] * (rng.random() < 0.8)
        now = round(step * PERIOD * 1e9)
        governor.take(Command(now, tuple(row.tolist())))
        moved.append(governor.step(now))
    return moved + governor.stopped()


def inputs_of(moved):
    rows = np.array([(0.0, 0.0, 0.0), *(one.acceleration for one in moved)])
    t = PERIOD * np.arange(len(rows))
    return Inputs(t, rows).resampled(np.arange(0.0, t[-1], 0.002))


@settings(max_examples=4, deadline=None)
@given(seed=st.integers(0, 10_000), frequency=st.floats(-0.03, 0.03), damping=st.floats(-1.0, 1.0))
def test_every_cup_keeps_its_height_and_stands(seed, frequency, damping):
    moved = run(Governor(Tray(CUPS), LIMITS, at_rest=True), seed)
    assert all(one.safe for one in moved)
    inputs = inputs_of(moved)
    for cup in CUPS:
        first = cup.model.mode_constants()[0]
        other = Model(
            cup.model.container, damping_ratio=first.damping_ratio * 2.0**damping,
            natural_frequency=first.natural_frequency * (1.0 + frequency),
            effects=cup.model.effects,
        )  # fmt: skip
        assert simulate(other, inputs)[0].msh.max() <= cup.limit
        if cup.standing is not None:
            assert standing_use(other, cup.standing, inputs).stands


def test_without_what_holds_them_cups_would_slide_or_tip():
    held = tuple(replace(cup, standing=None) for cup in CUPS)
    moved = run(Governor(Tray(held), LIMITS, at_rest=True), 7)
    uses = [
        standing_use(cup.model, cup.standing, inputs_of(moved)) for cup in CUPS if cup.standing
    ]
    assert max(use.friction for use in uses) > 1.1
    assert max(use.tipping for use in uses) > 1.1
    assert math.isnan(moved[0].friction)


def test_the_answer_names_the_worst_and_says_how_much_is_used():
    moved = run(Governor(Tray(CUPS), LIMITS, at_rest=True), 7)
    by_name = {cup.name: cup for cup in CUPS}
    assert len({one.worst for one in moved}) > 1
    for one in moved:
        assert one.limit == by_name[one.worst].limit
        assert one.peak <= one.limit * (1.0 + 1e-9)
    assert 0.7 < max(max(one.friction, one.tipping) for one in moved) <= 1.0


def test_one_cup_on_a_tray_is_governed_as_by_itself_and_equal_ones_as_one():
    alone = run(Governor(WIDE, replace(LIMITS, height=0.018, residual=0.018), at_rest=True), 2, 60)
    for count in (1, 4):
        cups = [replace(CUPS[0], name=str(number)) for number in range(count)]
        tray = run(Governor(Tray(tuple(cups)), LIMITS, at_rest=True), 2, 60)
        assert [one.acceleration for one in tray] == [one.acceleration for one in alone]


def test_a_smaller_share_of_friction_is_slower():
    half = run(Governor(Tray(CUPS), replace(LIMITS, friction=0.5, tipping=0.5), at_rest=True), 7)
    full = run(Governor(Tray(CUPS), LIMITS, at_rest=True), 7)
    fastest = [max(np.linalg.norm(one.acceleration) for one in moved) for moved in (half, full)]
    assert fastest[0] < 0.8 * fastest[1]


def test_what_cannot_be_kept_is_named():
    twice = CUPS[1].model.with_effect("second_mode")
    tray = Tray((CUPS[0], replace(CUPS[1], model=twice)))
    with pytest.raises(SloshPlanError, match=r"slim: stands loosely: .* one mode"):
        Governor(tray, LIMITS, at_rest=True)
    with pytest.raises(SloshPlanError, match="wide: the governor needs a limit"):
        Governor(Tray((replace(CUPS[0], limit=math.nan),)), LIMITS, at_rest=True)
    with pytest.raises(SloshPlanError, match="tray is empty"):
        Governor(Tray((replace(CUPS[0], empty=True),)), LIMITS, at_rest=True)
