"""Tests the checks of messages against themselves and against each other."""

import itertools
import math
import random

import numpy as np
import pytest

from slosh_motion.checks.message_checks import Dropouts, Stairs, ToAndFro, TwistCheck, unstamped
from slosh_motion.checks.table_checks import motion_doubts
from slosh_motion.inputs.kept_poses import Leap

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def way(t, start=1.0, length=0.7, size=0.4):
    """Returns a position on a stroke along x, at rest before and after."""
    s = min(max((t - start) / length, 0.0), 1.0)
    return (size * s**3 * (10 - 15 * s + 6 * s * s), 0.0, 0.8)


def mixed(rate, other, lag, noise=0.0, seed=0):
    """Returns the positions of two publishers, the second `lag` late, in order of arrival."""
    draw = random.Random(seed)
    own = [(k / rate, 0.0) for k in range(int(3 * rate))]
    late = [(k / other + 0.3 / rate, lag) for k in range(int(3 * other))] if other else []
    return [
        tuple(x + draw.gauss(0.0, noise) for x in way(t - behind))
        for t, behind in sorted(own + late)
    ]


@pytest.mark.parametrize(("rate", "other"), [(100, 50), (125, 125), (500, 50), (125, 30)])
@pytest.mark.parametrize("lag", [0.02, 0.08])
def test_two_publishers_are_found(rate, other, lag):
    check = ToAndFro("poses")
    for position in mixed(rate, other, lag):
        check.take(position)
    assert "several publishers" in check.raised.text


@pytest.mark.parametrize("rate", [20, 100, 1000])
@pytest.mark.parametrize("noise", [0.0, 1e-4, 2e-3])
def test_one_noisy_publisher_is_not_two(rate, noise):
    check = ToAndFro("poses")
    for position in mixed(rate, 0, 0.0, noise):
        check.take(position)
    assert check.raised is None


@pytest.mark.parametrize("frequency", [0.5, 2.0, 3.7])
def test_a_shaken_container_is_no_second_publisher(frequency):
    check = ToAndFro("poses")
    for k in range(300):
        t = k / 30.0
        check.take((0.05 * t + 0.1 * math.sin(math.tau * frequency * t), 0.0, 0.8))
    assert check.raised is None


def test_a_second_publisher_that_stops_is_over_but_stays_known():
    check = ToAndFro("poses")
    for position in mixed(100, 100, 0.03):
        check.take(position)
    before = check.found
    for position in mixed(500, 0, 0.0):
        check.take(position)
    assert (before, check.found) == (True, False)
    assert check.raised is not None


def stairs(rate, renewed, quantum=0.0):
    check = Stairs("joint states", 5e-3)
    for k in range(int(3 * rate)):
        x, y, z = way(math.floor(k / rate * renewed + 1e-9) / renewed)
        if quantum:
            x = round(x / quantum) * quantum
        check.take(int(1e9 * k / rate), (x, y, z))
    return check


@pytest.mark.parametrize(
    ("rate", "renewed"), [(100, 25), (500, 25), (125, 30), (100, 50), (50, 10)]
)
def test_stairs_are_named_with_both_rates(rate, renewed):
    text = stairs(rate, renewed).raised.text
    told = float(text.partition("renewed at ")[2].partition(" Hz")[0])
    assert f"sent at {rate} Hz" in text or abs(told * rate / renewed - rate) < 0.3 * rate
    assert told == pytest.approx(renewed, rel=0.35)


@pytest.mark.parametrize(
    ("rate", "renewed", "quantum"), [(500, 125, 0.0), (100, 100, 0.0), (500, 500, 2e-3)]
)
def test_fast_renewal_and_coarse_values_are_no_stairs(rate, renewed, quantum):
    assert stairs(rate, renewed, quantum).raised is None


def test_a_shake_at_a_quarter_of_the_rate_is_no_stairs():
    check = Stairs("poses", 5e-3)
    for k in range(200):
        check.take(k * 20_000_000, ((0.0, 0.01, 0.01, 0.0)[k % 4], 0.0, 0.0))
    assert check.raised is None


def leaps(positions, rate):
    """Returns which positions are leaps from the last one that is none."""
    found, kept, before = [], [positions[0]], []
    for index, position in enumerate(positions[1:], 1):
        leap = Leap.between((*kept[-1], *UPRIGHT), (*position, *UPRIGHT), 1.0 / rate)
        if not leap.is_small() and leap.is_beyond(before[-8:], 1.0 / rate):
            found.append(index)
            continue
        kept.append(position)
        before.append(leap)
    return found


@pytest.mark.parametrize("rate", [50, 125, 500])
def test_zeros_now_and_then_are_leaps_and_a_fast_stroke_is_none(rate):
    positions = [way(k / rate, length=0.4, size=1.0) for k in range(2 * rate)]
    assert leaps(positions, rate) == []
    zeros = [rate // 2, int(1.2 * rate), int(1.6 * rate)]
    for index in zeros:
        positions[index] = (0.0, 0.0, 0.0)
    assert leaps(positions, rate) == zeros


@pytest.mark.parametrize(
    ("way", "on_it"),
    [((0.0, 0.3, 0.6), True), ((0.0, 0.5, 0.1), False), ((0.3, 0.0, 0.31), False)],
)
def test_turns_that_lead_on_are_told_from_leaps_away_and_back(way, on_it):
    poses = [(0.0, 0.0, 0.0, 0.0, 0.0, math.sin(a / 2), math.cos(a / 2)) for a in way]
    steps = [Leap.between(*pair, 0.02) for pair in itertools.pairwise(poses)]
    assert Leap.between(poses[0], poses[-1], 0.04).is_way_of(steps) == on_it


def twists(how, rate=50, corrected=0.0):
    """Returns the check of an odometry on a straight, then on a curve of 2 rad."""
    check, x, y, heading = TwistCheck(), 0.0, 0.0, 0.4
    for k in range(4 * rate):
        t = k / rate
        speed = 0.8 * min(t, 1.0)
        turning = 1.0 if 1.5 < t < 3.5 else 0.0
        vx, vy = speed * math.cos(heading), speed * math.sin(heading)
        turned, sent = how((vx, vy, 0.0), (speed, 0.0, 0.0), heading)
        check.take(int(1e9 * t), (x + corrected * (t > 2.0), y, 0.0), turned, sent)
        x, y, heading = x + vx / rate, y + vy / rate, heading + turning / rate
    return check


def rotated(v, angle):
    c, s = math.cos(angle), math.sin(angle)
    return (c * v[0] - s * v[1], s * v[0] + c * v[1], 0.0)


@pytest.mark.parametrize("rate", [10, 50, 200])
@pytest.mark.parametrize(
    ("how", "word"),
    [
        (lambda world, body, heading: (rotated(world, heading), world), "axes of header.frame_id"),
        (lambda world, body, heading: ((0.0,) * 3, (0.0,) * 3), "stays zero"),
        (lambda world, body, heading: (tuple(1e3 * v for v in world), body), "unit, axes"),
    ],
)  # fmt: skip
def test_a_wrong_twist_is_named(rate, how, word):
    check = twists(how, rate)
    assert check.found
    assert word in check.raised.text


@pytest.mark.parametrize("rate", [10, 50, 200])
def test_an_honest_twist_whose_pose_is_corrected_once_is_none(rate):
    assert twists(lambda world, body, heading: (world, body), rate, 0.05).raised is None


def test_stamps_that_were_never_filled_are_named():
    assert unstamped(1, 10, "/joint_states") == ""
    assert "stamped 0" in unstamped(0, 10, "/joint_states")


@pytest.mark.parametrize(
    ("at", "word"),
    [
        (lambda k: way(k / 100), None),
        (lambda k: way(k / 100 - 0.05 * (k % 2)), "several publishers"),
    ],
)
def test_a_table_of_poses_is_checked_as_messages_are(at, word):
    t = np.arange(300) / 100.0
    position = np.array([at(k) for k in range(300)])
    # Their accelerations are those that a filter made of them: nothing shows in them.
    doubts = motion_doubts(t, np.zeros((300, 3)), None, position)
    assert [word in doubt and doubt.wrong for doubt in doubts] == ([] if word is None else [True])


@pytest.mark.parametrize("rate", [50, 125, 500])
def test_velocities_that_drop_to_zero_are_found(rate):
    check = Dropouts("velocities")
    for k in range(3 * rate):
        speed = 0.0 if k in (rate, rate + 1, 2 * rate) else 0.8 * min(k / rate, 1.0)
        check.take(k * 10**9 // rate, (speed, 0.0, 0.0))
    assert "3 of the velocities are zero between others" in check.raised.text


@pytest.mark.parametrize("rate", [10, 50, 125, 500])
def test_a_frame_that_stops_and_goes_on_is_not_blamed(rate):
    check = Dropouts("velocities")
    for k in range(6 * rate):
        # Up to 10 m/s², through zero and back, rounded as encoders do.
        speed = round(min(abs(10.0 * (k / rate - 3.0)), 1.0) / 0.01) * 0.01
        check.take(k * 10**9 // rate, (speed, 0.0, 0.0))
    assert check.raised is None


def test_what_rests_but_for_rounding_and_then_moves_is_no_stair():
    check, place = Stairs("poses", 5e-3), 0.5
    for k in range(100):
        if k % 2 == 0 and k < 60:  # the last bit flickers
            place = 0.5 if k % 4 else math.nextafter(0.5, 1.0)
        elif k >= 60:
            place = 0.5 + 0.5 * 10.0 * ((k - 60) / 50) ** 2
        check.take(k * 20_000_000, (place, 0.0, 0.0))
    assert check.raised is None
