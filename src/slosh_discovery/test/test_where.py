"""Tests the residual by parts of the data: sums, and a known error in its place."""

import math

import numpy as np
import pytest

from slosh_discovery.discover.finding import Agreement, MotionFinding, Role
from slosh_discovery.discover.input_series import (
    InputSeries,
    motion_span,
    still_until,
)
from slosh_discovery.discover.motion import MeasuredMotion
from slosh_discovery.discover.where import where, worst_moments
from slosh_model import Cylinder, Inputs, Model, simulate

MODEL = Model(Cylinder(0.05, 0.07))
T = np.arange(0.0, 8.0, 1.0 / 60.0)
AGREEMENT = Agreement(0.0, 0.0, 0.0, 0.0)
PARTITIONS = ("time", "phase", "amplitude", "direction", "frequency")


def swirling():
    """Returns two seconds of swirling motion between still parts, with heave and yaw."""
    t = np.arange(0.0, 8.0, 0.005)
    envelope = np.where((t > 1.0) & (t < 5.0), np.sin(0.25 * np.pi * (t - 1.0)) ** 2, 0.0)
    a = np.stack([np.sin(16.0 * t), np.cos(16.0 * t), 0.3 * np.sin(9.0 * t)], axis=1)
    yaw = np.cumsum(envelope) * 0.005
    attitude = np.stack([0.0 * t, 0.0 * t, np.sin(0.5 * yaw), np.cos(0.5 * yaw)], axis=1)
    return Inputs(t, 2.0 * envelope[:, np.newaxis] * a, attitude)


INPUTS = swirling()
HEIGHTS = np.interp(T, INPUTS.t, simulate(MODEL, INPUTS)[0].msh)


def finding(residual, after=None, name="swirl", clock_offset=0.0, rows=None):
    """Returns a motion whose base model has a given residual, (M,) or (M, K)."""
    residual = np.asarray(residual)
    columns = residual if residual.ndim == 2 else residual[:, np.newaxis]
    base = np.broadcast_to(HEIGHTS[:, np.newaxis], columns.shape)
    t = T + clock_offset
    if residual.ndim == 2:
        azimuth = np.linspace(0.0, 2.0 * np.pi, residual.shape[1], endpoint=False)
        motion = MeasuredMotion(name, INPUTS, t, eta_azimuth=azimuth, eta=base + residual)
    else:
        motion = MeasuredMotion(name, INPUTS, t, HEIGHTS + residual)
    after = columns if after is None else np.asarray(after)[:, np.newaxis]
    return MotionFinding(
        motion, Role.FIT, 1e-4, clock_offset, 0.0,
        motion.heights - columns, motion.heights - after, AGREEMENT, AGREEMENT,
    )  # fmt: skip


def rows_of(findings, by):
    return {row.label: row for row in where(findings, MODEL) if row.by == by}


@pytest.mark.parametrize("columns", [None, 12])
def test_every_partition_adds_up(columns):
    rng = np.random.default_rng(0)
    residual = 1e-3 * rng.normal(size=len(T) if columns is None else (len(T), columns))
    residual[rng.random(len(T)) < 0.1] = np.nan
    after = None if columns else 0.5 * residual
    findings = [finding(residual, after), finding(2.0 * residual, name="again")]
    total = sum(
        np.nansum(np.square(each.motion.heights - each.before_heights)) for each in findings
    )
    count = sum(np.isfinite(each.motion.heights).sum() for each in findings)
    for by in PARTITIONS:
        rows = rows_of(findings, by).values()
        assert sum(row.share for row in rows) == pytest.approx(1.0)
        if by == "frequency":
            assert sum(row.before**2 for row in rows) == pytest.approx(total / count)
        else:
            assert (
                sum(row.samples for row in rows)
                == np.isfinite(
                    np.concatenate([each.motion.heights[:, 0] for each in findings])
                ).sum()
            )


def test_a_disagreement_in_the_dwell():
    start, end = motion_span(INPUTS)
    # Between 1 and 5 s, where the swelling acceleration exceeds 0.15 m/s².
    assert (start, end) == pytest.approx((1.35, 4.65), abs=0.06)
    residual = np.where(T > 5.2, 1e-3, 1e-5)
    phase = rows_of([finding(residual)], "phase")
    assert list(phase) == ["before the motion", "motion", "dwell"]
    assert phase["dwell"].share > 0.98
    assert rows_of([finding(residual)], "time")["last quarter"].share > 0.6


def test_a_disagreement_in_one_direction():
    response, _ = simulate(MODEL, INPUTS)
    x, y = (np.interp(T, INPUTS.t, each) for each in (response.sh_x, response.sh_y))
    towards = np.abs(np.arctan2(y, x) - math.pi / 2.0) < math.pi / 8.0
    rows = rows_of(
        [finding(np.where(towards & (0.06 * HEIGHTS.max() < HEIGHTS), 1e-3, 0.0))], "direction"
    )
    assert rows["crest at 90° (+y)"].share > 0.98
    assert "no wave predicted" in rows


@pytest.mark.parametrize(
    ("factor", "name"), [(0.0, "near 0"), (1.0, "near ω₁"), (2.0, "near 2ω₁"), (1.70, "near ω₂")]
)
def test_a_disagreement_at_one_frequency(factor, name):
    frequency = factor * MODEL.container.natural_frequency(1)
    rows = rows_of([finding(1e-3 * np.cos(frequency * T))], "frequency")
    assert max(rows.values(), key=lambda row: row.share).label.startswith(name)
    assert max(row.share for row in rows.values()) > 0.9


def test_the_input_that_the_residual_follows():
    yaw_rate = InputSeries.at(INPUTS, T).quantities()["yaw rate"]
    noise = np.random.default_rng(2).normal(size=len(T))
    rows = rows_of([finding(1e-3 * yaw_rate * noise)], "input")
    assert set(rows) == {"‖a‖", "z̈₀", "jerk", "yaw rate"}  # it never tilts
    assert rows["yaw rate"].before > 0.9
    still = rows_of([finding(1e-3 * (1.0 - np.minimum(yaw_rate, 1.0)) * noise)], "input")
    assert still["yaw rate"].before == 0.0


def test_worst_moments_are_apart_and_no_outliers():
    residual = 1e-4 * np.ones(len(T))
    residual[100] = 0.05  # a single outlier
    residual[200:210] = 4e-3
    residual[212:215] = 3.9e-3  # the same moment
    residual[300:310] = -2e-3
    residual[305] = np.nan
    worst = worst_moments([finding(residual)], 3)
    assert [moment.t for moment in worst[:2]] == pytest.approx([T[204], T[304]], abs=0.1)
    assert worst[0].measured - worst[0].before == pytest.approx(4e-3)
    assert worst[1].measured - worst[1].before == pytest.approx(-2e-3)
    assert np.min(np.diff(np.sort([moment.t for moment in worst]))) >= 0.5
    assert len(worst_moments([finding(residual), finding(2.0 * residual, name="b")], 2)) == 2
    assert worst_moments([finding(residual), finding(2.0 * residual, name="b")])[0].motion == "b"


def test_nothing_moves():
    inputs = Inputs(np.array([0.0, 1.0]), np.zeros((2, 3)))
    assert motion_span(inputs) == (1.0, 1.0)
    assert still_until(inputs) == 1.0
