"""Tests for each motion whether the camera agrees with the model."""

import math

import numpy as np
import pytest

from slosh_estimator.agreement import MotionAgreement, MotionWatch
from slosh_estimator.comparison import Condition, EstimatePoint, MeasuredPoint
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.sight import SATURATED
from slosh_estimator.tuning import TUNING
from slosh_estimator.validity import EstimateFlag
from slosh_model.model import Model
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs, simulate
from slosh_motion.signals.motion_spans import motion_spans

MS = 1_000_000
TRUTH = Model(Cylinder(0.05, 0.07), damping_ratio=0.01).spatial().nonlinear()
NOISE = 2e-4


def acceleration(t: np.ndarray) -> np.ndarray:
    """Returns accelerations (N, 3) [m/s²]: 1 s of rest, 2 s of motion, 3 s of rest."""
    swell = np.where((t > 1.0) & (t < 3.0), np.sin(0.5 * np.pi * (t - 1.0)) ** 2, 0.0)
    return swell[:, None] * np.column_stack(
        (1.5 * np.sin(14.0 * t), 1.0 * np.cos(13.0 * t), 3.0 * np.sin(11.0 * t))
    )


def watched(
    loaded: Model, motions: int = 1, *, flags: int = 0, spike: float = 0.0, stddev: float = NOISE
) -> Monitor:
    """Returns a monitor that has compared several motions with a given model."""
    monitor = Monitor(MonitorSettings(disagreement_limit=0.01))
    t = np.arange(0.0, 6.0, 0.005)
    moved = acceleration(t)
    inputs = Inputs(t, moved)
    seen, told = simulate(TRUTH, inputs)[0].msh, simulate(loaded, inputs)[0].msh
    noise = np.random.default_rng(1).normal(0.0, NOISE, len(t))
    for number in range(motions):
        for k, second in enumerate(t.tolist()):
            stamp = round((number * 6.0 + second + 1.0) * 1e9)
            point = EstimatePoint(stamp, told[k], told[k], flags, tuple(moved[k].tolist()))
            monitor.add_estimate(point, stamp)
            if k % 4 == 0:
                height = float(seen[k] + noise[k]) + (spike if second == 2.0 else 0.0)
                monitor.add_measurement(MeasuredPoint(stamp, height, stddev), stamp)
    return monitor


def test_a_right_model_is_not_told_and_a_wrong_one_is_once_for_each_motion() -> None:
    right = watched(TRUTH, 2).motions
    assert (right.finished, right.disagreeing) == (2, 0)
    assert not any(motion.disagrees for motion in right.take_finished())
    wrong = watched(TRUTH.planar().linear(), 2).motions
    assert (wrong.finished, wrong.disagreeing) == (2, 2)
    told = wrong.take_finished()
    assert [motion.disagrees for motion in told] == [True, True]
    assert wrong.take_finished() == []


def test_the_sentence_is_one_line_with_the_command() -> None:
    (motion,) = watched(TRUTH.linear()).motions.take_finished()
    assert "slosh discover --from-bag BAG --model MODEL" in motion.sentence
    assert f"{1e3 * motion.rms:.1f} mm" in motion.sentence
    assert "\n" not in motion.sentence


def test_noise_the_calibration_and_the_limit_explain_a_difference() -> None:
    def explained(limit: float, stddev: float, height: float) -> MotionAgreement:
        watch = MotionWatch(limit)
        for k in range(400):
            watch.add_acceleration(k * 10 * MS, (1.0 if k < 100 else 0.0, 0.0, 0.0))
            watch.add_pair(k * 10 * MS, height, stddev, height - 1e-3)
        (motion,) = watch.take_finished()
        return motion

    assert explained(math.nan, 1e-4, 0.01).disagrees
    assert not explained(math.nan, 4e-4, 0.01).disagrees
    assert not explained(math.nan, math.nan, 0.06).disagrees
    assert explained(0.01, 1e-4, 0.01).explained == pytest.approx(5e-4)
    assert not explained(0.03, 1e-4, 0.01).disagrees


def test_estimates_from_an_unknown_state_and_lower_bounds_are_not_judged() -> None:
    wrong = TRUTH.planar().linear()
    assert watched(wrong, flags=int(EstimateFlag.SETTLING)).motions.finished == 0
    monitor = Monitor(MonitorSettings())
    for k in range(600):
        moved = (1.0 if k < 200 else 0.0, 0.0, 0.0)
        monitor.add_estimate(EstimatePoint(k * 10 * MS, 0.02, 0.02, 0, moved), k * 10 * MS)
        point = MeasuredPoint(k * 10 * MS, 0.01, 1e-4, SATURATED)
        monitor.add_measurement(point, k * 10 * MS)
    assert monitor.motions.finished == 0


def test_too_few_images_are_no_judgement() -> None:
    for images, judged in ((TUNING.least_compared - 1, 0), (TUNING.least_compared, 1)):
        watch = MotionWatch()
        for k in range(400):
            watch.add_acceleration(k * 10 * MS, (1.0 if k < 100 else 0.0, 0.0, 0.0))
            if 10 <= k < 10 + images:
                watch.add_pair(k * 10 * MS, 0.02, 1e-4, 0.01)
        assert watch.finished == judged


def test_a_container_that_never_rests_is_judged_by_the_minute() -> None:
    watch = MotionWatch()
    for k in range(13_000):
        watch.add_acceleration(k * 10 * MS, (0.0, math.cos(0.1 * k), math.sin(0.1 * k)))
        watch.add_pair(k * 10 * MS, 0.02, 1e-4, 0.01)
    assert watch.finished == 2


@pytest.mark.parametrize(("rest", "judged"), [(90, 1), (110, 2), (150, 2), (300, 2)])
def test_motions_are_those_of_a_replay(rest: int, judged: int) -> None:
    """Tests that a live monitor finds the same motions as a replay."""
    watch, stamps, felt = MotionWatch(), [], []
    for k in range(200 + rest + 400):
        moves = k < 100 or 100 + rest <= k < 200 + rest
        felt.append((1.0 if moves else 0.0, 0.0, 0.0))
        stamps.append(k * 10 * MS)
        watch.add_acceleration(stamps[-1], felt[-1])
        watch.add_pair(stamps[-1], 0.01 if k < 100 + rest else 0.03, 1e-4, 0.01)
    told = watch.take_finished()
    assert len(told) == watch.finished == judged
    spans = motion_spans(np.array(stamps), np.array(felt))
    assert [(motion.start_ns, motion.end_ns) for motion in told] == spans
    if judged == 2:  # the pairs of one are not those of the other
        assert [motion.rms for motion in told] == pytest.approx([0.0, 0.02])


def test_a_reset_forgets_the_count_and_the_motion_under_way() -> None:
    monitor = watched(TRUTH.linear(), 2)
    monitor.reset_accuracy()
    assert (monitor.motions.finished, monitor.motions.disagreeing) == (0, 0)
    assert monitor.motions.last is None


def turned(degrees: float, seconds: float = 6.0) -> Monitor:
    """Returns a monitor after motions seen by a camera that is turned about the z axis."""
    monitor = Monitor(MonitorSettings(disagreement_limit=0.01))
    t = np.arange(0.0, seconds, 0.005)
    moved = acceleration(t)
    told = simulate(TRUTH, Inputs(t, moved))[0]
    noise = np.random.default_rng(1).normal(0.0, NOISE, len(t))
    for k, second in enumerate(t.tolist()):
        stamp = round((second + 1.0) * 1e9)
        height, azimuth = float(told.msh[k]), float(told.azimuth[k])
        felt = tuple(moved[k].tolist())
        monitor.add_estimate(EstimatePoint(stamp, height, height, 0, felt, azimuth=azimuth), stamp)
        if k % 4 == 0:
            seen = height + float(noise[k])
            wave = seen * complex(np.exp(1j * (azimuth + math.radians(degrees))))
            monitor.add_measurement(MeasuredPoint(stamp, seen, NOISE, 0, wave), stamp)
    return monitor


@pytest.mark.parametrize("degrees", [90, 180])
def test_an_azimuth_that_is_wrong_is_a_disagreement_though_the_heights_agree(
    degrees: int,
) -> None:
    monitor = turned(degrees)
    (motion,) = monitor.motions.take_finished()
    assert motion.rms < motion.explained
    assert motion.is_turned
    assert motion.disagrees
    assert f"azimuth is {degrees} degrees from the estimated one" in motion.sentence
    assert monitor.motions.warning == motion.sentence
    assert monitor.condition(7_000 * MS) is Condition.WARN
    right = turned(0)
    assert [motion.disagrees for motion in right.motions.take_finished()] == [False]
    assert right.condition(7_000 * MS) is Condition.OK


def test_a_disagreement_stands_until_a_motion_agrees_or_a_reset() -> None:
    watch = MotionWatch()

    def moves(start: int, difference: float) -> None:
        for k in range(400):
            at = (start + 10 * k) * MS
            watch.add_acceleration(at, (1.0 if k < 100 else 0.0, 0.0, 0.0))
            watch.add_pair(at, 0.01 + difference, 1e-4, 0.01)

    moves(0, 0.004)
    assert "differ by 4.0 mm" in watch.warning
    for k in range(1000):  # rest
        watch.add_acceleration((4_000 + 10 * k) * MS, (0.0, 0.0, 0.0))
    assert watch.warning
    moves(20_000, 0.0)
    assert watch.warning == ""
    moves(30_000, 0.004)
    watch.reset()
    assert watch.warning == ""


def test_many_accelerations_are_as_one_by_one() -> None:
    random = np.random.default_rng(5)
    stamps = np.cumsum(random.integers(1, 20, 4000)) * MS
    felt = random.normal(0.0, 1.0, (4000, 3)) * ((np.arange(4000) // 400) % 2)[:, None]
    felt[random.random(4000) < 0.01] = np.nan
    one, many = MotionWatch(), MotionWatch()
    for start in range(0, 4000, 250):
        part = slice(start, start + 250)
        for stamp, row in zip(stamps[part].tolist(), felt[part].tolist(), strict=True):
            one.add_acceleration(stamp, tuple(row))
        many.add_accelerations(stamps[part], felt[part])
        for watch in (one, many):
            for stamp in stamps[part][::10].tolist():
                watch.add_pair(stamp, 0.01, 1e-4, 0.005)
        assert repr(one.take_finished()) == repr(many.take_finished())
        assert one.warning == many.warning
    assert one.finished > 3
