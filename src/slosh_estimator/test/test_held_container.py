"""Tests changes of the container that the gripper holds."""

import math

import numpy as np
import pytest

from slosh_estimator.comparison import Condition, EstimatePoint, Expected, MeasuredPoint
from slosh_estimator.errors import SloshEstimatorError
from slosh_estimator.estimator import Estimator
from slosh_estimator.height_checks import LevelWatch
from slosh_estimator.held_container import HeldContainer, tray_holding
from slosh_estimator.limits import Kind
from slosh_estimator.monitor import Monitor
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import EstimateFlag
from slosh_model.errors import SloshModelError
from slosh_model.model_text import parse_model
from slosh_model.standing import Standing
from slosh_model.tray import Tray, TrayContainer
from slosh_motion.inputs.sampling import Sample, Samples

MS = 1_000_000
CUP = parse_model(
    "container: {shape: cylinder, radius: 0.04, fill_height: 0.06, rim_height: 0.09}\n"
    "effects: [{name: vertical_acceleration}]"
)
MUG = parse_model("container: {shape: cylinder, radius: 0.05, fill_height: 0.05}")
START = HeldContainer(CUP, "cup")


def test_a_fill_is_that_of_the_container_that_stays():
    held = START.changed(fill_height=0.07)
    assert (held.name, held.empty, held.fill_height) == ("cup", False, 0.07)
    assert held.model.container.fill_height == 0.07
    assert held.model.container.freeboard == pytest.approx(0.02)
    assert not held.fresh


def test_another_container_and_one_that_comes_back_bring_other_liquid():
    assert START.changed(name="mug", model=MUG).fresh
    assert not START.changed(name="cup", model=CUP, fill_height=0.05).fresh
    empty = START.changed(empty=True)
    assert empty.empty
    assert not empty.fresh
    again = empty.changed(fill_height=0.05)
    assert (again.empty, again.fresh, again.name) == (False, True, "cup")


STANDING = (0.2, 0.06, 0.035, 0.3)
LOOSE = HeldContainer(CUP, "cup", standing=Standing(*STANDING))


@pytest.mark.parametrize(
    ("changed", "given", "stands"),
    [
        ({"fill_height": 0.05}, (), STANDING),
        ({"name": "cup", "model": CUP}, (), STANDING),
        ({"empty": True}, (), STANDING),
        ({"name": "mug", "model": MUG}, (0.1, 0.05, 0.03, 0.2), (0.1, 0.05, 0.03, 0.2)),
        ({"name": "mug", "model": MUG}, (0.0,) * 4, None),
        ({}, (0.3, 0.06, 0.035, 0.3), (0.3, 0.06, 0.035, 0.3)),
    ],
)
def test_a_container_stands_as_it_did_or_as_it_is_told(changed, given, stands):
    held = LOOSE.changed(**changed, standing=given)
    assert held.standing == (stands and Standing(*stands))


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"name": "mug", "model": MUG}, "standing is missing: another container"),
        ({"model": MUG}, "standing is missing"),
        ({"fill_height": 0.05, "standing": (0.2, 0.06)}, "must be mass, centre_height"),
        ({"fill_height": 0.05, "standing": (0.2, 0.06, math.nan, 0.3)}, "base_radius"),
        ({"fill_height": 0.05, "standing": (-0.2, 0.06, 0.03, 0.3)}, "standing.mass"),
        ({"empty": True, "standing": STANDING}, "empty with a container"),
    ],
)
def test_another_container_does_not_stand_as_the_one_before(changed, message):
    """Mass, base and friction of the last container would foretell a wrong fall."""
    with pytest.raises((SloshEstimatorError, SloshModelError), match=message) as caught:
        LOOSE.changed(**changed)
    assert "\n" not in str(caught.value)


def test_the_tray_takes_the_standing_of_what_it_holds():
    tray = Tray((TrayContainer("left", CUP, standing=LOOSE.standing),))
    mug = LOOSE.changed(name="mug", model=MUG, standing=(0.1, 0.05, 0.03, 0.2))
    (held,) = tray_holding(tray, 0, mug).containers
    assert held.standing == Standing(0.1, 0.05, 0.03, 0.2)
    (gone,) = tray_holding(tray, 0, LOOSE.changed(empty=True)).containers
    assert gone.standing == LOOSE.standing  # the same container may come back


def test_a_measured_frequency_follows_the_fill():
    measured = parse_model(
        "container: {shape: cylinder, radius: 0.04, fill_height: 0.06}\nnatural_frequency: 20.0"
    )
    filled = measured.filled_to(0.02)
    ratio = filled.container.natural_frequency(1) / measured.container.natural_frequency(1)
    assert filled.mode_constants()[0].natural_frequency == pytest.approx(20.0 * ratio)
    assert ratio < 0.9


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "nothing to change"),
        ({"limit": 0.01}, "nothing to change"),
        ({"empty": True, "fill_height": 0.05}, "empty with a container"),
        ({"fill_height": 0.09}, "must lie above"),
        ({"fill_height": -0.01}, "fill_height"),
        ({"fill_height": math.inf}, "fill_height"),
        ({"fill_height": 60.0}, "fill_height"),
        ({"fill_height": 0.05, "limit": -0.01}, "limit"),
        ({"fill_height": 0.05, "limit": math.inf}, "limit"),
        (
            {"fill_height": 0.05, "limit": 1e300},
            "limit = 1e\\+300 m must lie above 0 and up to 10 m",
        ),
        ({"fill_height": 0.05, "limit": 12.0}, "did you mean 12 mm"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(given, message):
    with pytest.raises((SloshEstimatorError, SloshModelError), match=message) as caught:
        START.changed(**given)
    assert "\n" not in str(caught.value)


def shaken(estimator, first, count, ax):
    """Returns the last of several estimates at 1 kHz."""
    for k in range(first, first + count):
        estimate = estimator.update(Sample(k * MS, ax, 0.0, 0.0, 0.0))
    return estimate


def test_an_empty_gripper_has_no_height_and_says_so():
    estimator = Estimator(CUP)
    shaken(estimator, 0, 100, 2.0)
    estimator.load_model(CUP, empty=True)
    estimate = shaken(estimator, 100, 10, 2.0)
    assert estimate.flags == EstimateFlag.NO_CONTAINER
    assert math.isnan(estimate.nonlinear.msh)
    assert math.isnan(estimate.linear.reading)
    assert all(map(math.isnan, estimate.nonlinear.modal))
    assert math.isfinite(estimate.jerk)


def test_one_by_one_and_together_an_empty_gripper_gives_the_same_bits():
    ax = np.sin(np.arange(300) * 0.05) * 3.0
    one, many = Estimator(CUP), Estimator(CUP)
    for estimator in (one, many):
        estimator.load_model(CUP, empty=True)
    stamps = np.arange(300, dtype=np.int64) * MS
    accelerations = np.column_stack((ax, np.zeros((300, 2))))
    together = many.update_many(
        Samples(stamps, accelerations, np.zeros(300), np.zeros(300, dtype=bool))
    )
    last = [one.update(Sample(int(t), a, 0.0, 0.0, 0.0)) for t, a in zip(stamps, ax, strict=True)]
    assert np.isnan(together.heights).all()
    assert np.isnan(together.modal).all()
    assert together.flags.tolist() == [estimate.flags for estimate in last]
    assert together.jerk.tolist() == [estimate.jerk for estimate in last]


def test_a_change_in_motion_is_flagged_until_the_liquid_is_known():
    estimator = Estimator(CUP)
    shaken(estimator, 0, 200, 2.0)
    estimator.load_model(CUP.filled_to(0.05))
    assert shaken(estimator, 200, 1, 2.0).flags & EstimateFlag.SETTLING


def test_other_liquid_is_still_where_the_container_is_at_rest():
    """Tests that the liquid of a newly gripped container counts as still."""
    for fresh in (False, True):
        estimator = Estimator(CUP)
        shaken(estimator, 0, 200, 2.0)
        waves = shaken(estimator, 200, 100, 0.0)
        assert waves.nonlinear.msh > 2e-3
        estimator.load_model(MUG, fresh=fresh)
        flags = shaken(estimator, 300, 1, 0.0).flags
        assert bool(flags & EstimateFlag.SETTLING) is not fresh
    moving = Estimator(CUP)
    shaken(moving, 0, 200, 2.0)
    moving.load_model(MUG, fresh=True)
    assert shaken(moving, 200, 1, 2.0).flags & EstimateFlag.SETTLING


def test_nothing_is_watched_and_nothing_missed_while_the_gripper_is_empty():
    monitor = Monitor(MonitorSettings(0.01, 0.01, 0.005))
    for k in range(100):
        monitor.add_estimate(EstimatePoint(k * MS, 0.02, 0.02), k * MS)
    (begun,) = monitor.take_events()
    assert begun.kind is Kind.START
    empty = int(EstimateFlag.NO_CONTAINER)
    for k in range(100, 1500):
        monitor.add_estimate(EstimatePoint(k * MS, math.nan, math.nan, empty), k * MS)
        if k % 20 == 0:  # the camera sees the robot's fingers
            monitor.add_measurement(MeasuredPoint(k * MS, 0.03, 1e-4), k * MS)
        if k % 100 == 0:
            monitor.check(k * MS)
    (ended,) = monitor.take_events()
    assert ended.kind is Kind.END
    assert "no container" in ended.description
    assert monitor.condition(1500 * MS) is Condition.OK
    assert monitor.blindness(1500 * MS) == ""
    assert monitor.nonlinear.count == 0


def seen(watch, seconds, level, wave=0.0, flags=0, begin=0.0):
    for t in np.arange(begin, begin + seconds, 1 / 60):
        point = MeasuredPoint(round(t * 1e9), abs(level), 1e-4, flags, level=level)
        watch.look(point, Expected(wave, wave))


@pytest.mark.parametrize(("level", "off"), [(4e-3, True), (-2e-3, True), (3e-4, False)])
def test_a_level_that_contradicts_the_fill_is_told_within_two_seconds(level, off):
    watch = LevelWatch()
    seen(watch, 2.0, level)
    assert bool(watch.text) is off
    if off:
        assert f"{1e3 * level:+.1f} ± 0.1 mm from the fill height" in watch.text


def test_a_level_is_judged_at_rest_and_by_clear_images_alone():
    watch, told = LevelWatch(), []
    for begin, given in enumerate(
        (
            {"level": 4e-3, "wave": 2e-3},  # in motion
            {"level": 4e-3, "flags": 512},  # AMBIGUOUS
            {"level": 4e-3},
            {"level": 0.0},
        )
    ):
        seen(watch, 2.0, begin=2.0 * begin, **given)
        told.append(bool(watch.text))
    assert told == [False, False, True, False]


def test_the_monitor_warns_of_the_level_until_the_fill_is_told():
    monitor = Monitor(MonitorSettings())
    for k in range(2000):
        monitor.add_estimate(EstimatePoint(k * MS, 0.0, 0.0), k * MS)
        if k % 20 == 0:
            monitor.add_measurement(MeasuredPoint(k * MS, 4e-3, 1e-4, level=4e-3), k * MS)
    assert monitor.condition(2000 * MS) is Condition.WARN
    monitor.change_settings(MonitorSettings())
    assert monitor.condition(2000 * MS) is Condition.OK
