"""Tests a chain of transforms as poses of the container."""

import math

import numpy as np
import pytest

from slosh_motion.inputs.frames import TimedPose, Transform
from slosh_motion.inputs.transform_poses import POSED, TransformPoses

MS = 1_000_000
BEGIN = 1_700_000_000_000_000_000
STRAIGHT = (0.0, 0.0, 0.0, 1.0)


def turn(yaw):
    return (0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))


def link(parent, child, place=(0.0, 0.0, 0.0), quaternion=STRAIGHT, ms=0.0):
    return Transform(parent, child, BEGIN + round(ms * MS), place, quaternion)


FIXED = [link("world", "base", (1.0, 0.0, 0.0), turn(0.5)), link("tool", "cup", (0.0, 0.1, 0.0))]


def chain(fixed=FIXED):
    poses = TransformPoses("world", "cup")
    poses.take(fixed, fixed=True)
    return poses


def rail(ms):
    return link("base", "rail", (0.002 * ms, 0.0, 0.0), ms=ms)


def wrist(ms):
    return link("rail", "tool", (0.0, 0.0, 0.3), turn(0.003 * ms), ms)


def expected(ms):
    """Returns the expected position of the cup [m], computed by hand."""
    along, yaw = 0.002 * ms, 0.5 + 0.003 * ms
    return (
        1.0 + along * math.cos(0.5) - 0.1 * math.sin(yaw),
        along * math.sin(0.5) + 0.1 * math.cos(yaw), 0.3,
    )  # fmt: skip


def test_links_of_one_message_give_one_pose():
    poses, found = chain(), []
    for ms in range(0, 400, 8):
        found += poses.take([wrist(ms), rail(ms), link("base", "lamp", ms=ms)])
    # At the first message the chain is not known before its last link.
    assert [pose.stamp_ns for pose in found] == [BEGIN + ms * MS for ms in range(8, 400, 8)]
    for k, pose in enumerate(found, start=1):
        assert pose.position == pytest.approx(expected(8 * k), abs=1e-12)
    assert poses.trouble() == ""
    assert poses.facts() == {"chain of transforms": "world → base → rail → tool → cup"}


def test_the_slowest_link_that_moves_leads():
    poses, found = chain(), []
    for ms in range(1000):
        found += poses.take([wrist(ms + 0.3)])
        if ms % 10 == 0:
            found += poses.take([rail(ms)])
    late = found[20:]
    assert np.diff([pose.stamp_ns for pose in late]) == pytest.approx(10 * MS)
    for pose in late:
        assert pose.position == pytest.approx(expected((pose.stamp_ns - BEGIN) / MS), abs=1e-6)


def test_a_link_that_stands_on_tf_does_not_lead():
    poses, found = chain(), []
    for ms in range(600):
        found += poses.take([wrist(ms)])
        if ms % 100 == 0:
            found += poses.take([link("base", "rail", ms=ms)])
    assert np.diff([pose.stamp_ns for pose in found[1:]]) == pytest.approx(MS)
    assert len(found) > 590


def test_fixed_links_may_come_last_and_names_have_slashes_in_front():
    poses = TransformPoses("/world", "cup")
    assert poses.take([rail(0), wrist(0)]) == []
    poses.take([one._replace(parent=f"/{one.parent}") for one in FIXED], fixed=True)
    assert len(poses.take([rail(8), wrist(8)])) == 1
    assert len(poses.take([rail(16), wrist(16)])) == 1


def test_a_chain_that_is_not_there_is_told():
    poses = TransformPoses("world", "cup")
    for ms in range(60):
        poses.take([rail(ms), wrist(ms)])
    assert "'cup' is no frame of theirs (they have rail, tool)" in poses.trouble()
    poses.take([link("tool", "cup")], fixed=True)
    assert poses.trouble() == (
        "the transforms do not connect 'world' with 'cup': 'cup' hangs on 'base'; set world_frame "
        "and container_frame to frames of one tree"
    )


def test_a_chain_in_which_nothing_moves_is_told():
    poses = chain()
    for second in range(60):
        poses.take([link("base", "rail", ms=1e3 * second), link("rail", "tool", ms=1e3 * second)])
    assert poses.trouble() == (
        "nothing has moved between 'world' and 'cup' for 59 s: world → base → rail → tool → cup"
    )
    poses.take([rail(60e3), wrist(60e3)])
    assert poses.trouble() == ""


def test_a_fixed_link_that_changes_is_told():
    poses = chain()
    for ms in range(60):
        poses.take([rail(ms), wrist(ms)])
    poses.take(FIXED, fixed=True)
    assert poses.trouble() == ""
    poses.take([link("tool", "cup", (0.0, 0.2, 0.0))], fixed=True)
    assert "the fixed transform of 'cup' was published with two values" in poses.trouble()


def test_a_loop_ends():
    poses = TransformPoses("world", "cup")
    for ms in range(60):
        assert poses.take([link("cup", "tool", ms=ms), link("tool", "cup", ms=ms)]) == []
    assert "do not connect" in poses.trouble()


def test_a_link_that_hangs_on_another_parent_now_is_followed():
    poses = chain()
    poses.take([rail(0), wrist(0)])
    poses.take([link("base", "tool", (0.0, 0.0, 0.5), ms=8)])
    (found,) = poses.take([link("base", "tool", (0.0, 0.0, 0.5), ms=16)])
    assert found.position[2] == 0.5


def riding(since_ns: int | None, first: int) -> tuple[TransformPoses, list[TimedPose]]:
    """Returns poses relative to a carriage for a node that misses the messages before `first`.

    The carriage's transforms come a message later than the poses, and at half their rate.
    """
    poses, found = TransformPoses("world", "cup", since_ns), []
    for k in range(first, 60):
        stamp = BEGIN + k * MS
        turn = (0.0, 0.0, np.sin(1e-3 * k * k), np.cos(1e-3 * k * k))
        found += poses.take([Transform("carriage", "cup", stamp, (0.01 * k, 0.0, 0.0), turn)])
        if k % 2 and k > first:
            place = (0.0, 1e-4 * k * k, 0.0)
            link = Transform("world", "carriage", stamp - MS, place, (0.0, 0.0, 0.0, 1.0))
            found += poses.take([link])
    return poses, found


@pytest.mark.parametrize("first", [0, 1, 7, 20])
def test_who_hears_of_a_chain_later_is_repeated_with_the_stamp_that_it_tells(first: int) -> None:
    """A recording begins earlier than the node that it is a recording of."""
    live, heard = riding(0, first)
    assert live.since_ns
    _, replayed = riding(live.since_ns, 0)
    assert heard
    assert replayed == heard
    assert first < 2 or riding(0, 0)[1] != heard  # without that stamp it begins earlier


def test_a_clock_that_is_set_back_later_is_followed() -> None:
    poses, found = TransformPoses("world", "cup", 0), []
    for begin in (10 * BEGIN, BEGIN):
        for k in range(0, 3000, 10):
            link = Transform("world", "cup", begin + k * MS, (0.01 * k, 0.0, 0.0), (0, 0, 0, 1.0))
            found += poses.take([link])
    assert found[-1].stamp_ns == BEGIN + 2990 * MS


def clocks(rail_ms, wrist_ms, offset_ms=0.0, moved=1.0):
    """Returns the doubt about transforms that arrive so long after their stamps [ms]."""
    poses = chain()
    for ms in range(0, 2000, 10):
        for made, late in ((rail(moved * ms), rail_ms), (wrist(ms), wrist_ms)):
            link_then = made._replace(stamp_ns=BEGIN + ms * MS)
            poses.take([link_then], at_ns=BEGIN + round((ms + late + offset_ms) * MS))
    return poses.clock_doubt()


def test_transforms_stamped_ahead_of_their_arrival_are_named():
    doubt = clocks(-100.0, 2.0)
    assert "the transforms of 'rail' are stamped 100 ms ahead" in doubt.text
    assert doubt.wrong


def test_the_clock_of_poses_in_a_frame_that_moves_is_compared_with_the_frames():
    poses = TransformPoses("world", POSED, 0)
    for ms in range(0, 4000, 10):
        for late, (parent, child) in ((-100, ("world", "base")), (2, ("base", POSED))):
            place = (0.001 * ms, 0.0, 0.0)
            link = Transform(parent, child, BEGIN + ms * MS, place, (0.0, 0.0, 0.0, 1.0))
            poses.take([link], at_ns=BEGIN + (ms + late) * MS)
    doubt = poses.clock_doubt()
    assert "the transforms of 'base' are stamped 100 ms ahead" in doubt.text
    assert "and the poses -2 ms" in doubt.text
    assert doubt.wrong


def restamped(ahead_ms, begins_ms=0, ends_ms=2000):
    """Returns the doubt about transforms that a converter logged by their stamps."""
    poses, links = chain(), []
    for ms in range(0, 2000, 10):
        links.append(wrist(ms)._replace(stamp_ns=BEGIN + ms * MS))
        if begins_ms <= ms < ends_ms:
            links.append(rail(ms)._replace(stamp_ns=BEGIN + (ms + ahead_ms) * MS))
    for link in sorted(links, key=lambda one: one.stamp_ns):
        poses.take([link], at_ns=link.stamp_ns)
    return poses.clock_doubt()


def test_a_clock_ahead_shows_at_the_ends_where_the_log_times_are_the_stamps():
    doubt = restamped(300)
    assert doubt.text.startswith("the transforms of 'rail' begin and end 300 ms later than")
    assert doubt.wrong


@pytest.mark.parametrize(
    "which", [{}, {"begins_ms": 500}, {"ends_ms": 1500}, {"begins_ms": 500, "ends_ms": 1900}]
)
def test_publishers_that_start_or_stop_by_themselves_have_one_clock(which):
    assert restamped(0, **which) is None


def test_transforms_that_may_be_late_are_a_remark():
    doubt = clocks(60.0, 2.0)
    assert "the transforms of 'rail' arrive 60 ms after their stamps" in doubt.text
    assert not doubt.wrong


@pytest.mark.parametrize(
    ("rail_ms", "wrist_ms", "offset_ms", "moved"),
    [(2.0, 20.0, 0.0, 1.0), (2.0, 2.0, -300.0, 1.0), (2.0, 2.0, 5000.0, 1.0),
     (-300.0, 2.0, 0.0, 0.005), (-300.0, 2.0, 0.0, 0.02)],
)  # fmt: skip
def test_small_delays_common_offsets_and_corrections_are_no_fault(
    rail_ms, wrist_ms, offset_ms, moved
):
    assert clocks(rail_ms, wrist_ms, offset_ms, moved) is None
