"""Tests the event recorder: all events, no duplicates, correct order and limited memory."""

import json
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slosh_bag.bag_writer import Qos
from slosh_bag.black_box import black_box as module
from slosh_bag.black_box.black_box import EVENTS, BlackBox, Cause, Happening, Windows
from slosh_bag.black_box.ring import OVERHEAD, Place
from slosh_bag.errors import SloshBagError

SECOND = 1_000_000_000
TYPE = "std_msgs/msg/Header"
MUCH = 10**9


class Written:
    """An in-memory bag that replaces a file."""

    def __init__(self, cause=None):
        self.cause, self.topics, self.messages = cause, {}, []
        self.facts, self.missed, self.closed = {}, {}, False

    def add_topic(self, name, message_type, qos):
        self.topics[name] = message_type

    def add(self, topic, data, log_ns, publish_ns=None):
        assert topic in self.topics
        assert not self.closed
        self.messages.append((topic, data, log_ns))

    def note(self, name, value):
        self.facts[name] = value

    def miss(self, counts):
        self.missed = dict(counts)

    def close(self):
        self.closed = True

    @property
    def told(self):
        return [event["text"] for event in json.loads(self.facts[EVENTS])]

    @property
    def numbers(self):
        return [int(data) for topic, data, _ in self.messages if topic == "/h"]


class Box:
    """An event recorder and the bags that it has started."""

    def __init__(self, before=2.0, after=3.0, memory=MUCH, longest=MUCH, place=None):
        self.bags, self.refuses = [], ""
        windows = Windows(round(before * SECOND), round(after * SECOND), memory, longest)
        self.box = BlackBox(windows, self.begin, place or (lambda topic, data: None))
        self.box.add_topic("/h", TYPE, Qos())

    def begin(self, happening):
        if self.refuses:
            raise SloshBagError(self.refuses)
        self.bags.append(Written(happening.cause))
        return self.bags[-1]

    def hear(self, begin, end, step=0.1):
        """Adds messages in the time range [begin, end) [s], each with a unique number."""
        for k in range(round(begin / step), round(end / step)):
            self.box.add("/h", b"%d" % k, round(k * step * SECOND))

    def happen(self, text="", cause=Cause.LIMIT):
        self.box.happen(Happening(cause, 0, text))


def test_a_bag_holds_the_time_round_its_event():
    box = Box()
    box.hear(0.0, 10.0)
    box.happen("first")
    box.hear(10.0, 20.0)
    (bag,) = box.bags
    assert bag.numbers == list(range(79, 130))
    assert (bag.cause, bag.told, bag.closed) == (Cause.LIMIT, ["first"], True)


def test_an_event_within_the_window_lengthens_it_and_one_after_it_begins_another():
    box = Box()
    box.hear(0.0, 10.0)
    box.happen("a")
    box.hear(10.0, 12.0)
    box.happen("b", Cause.BLIND)
    box.hear(12.0, 20.0)
    box.happen("c")
    box.hear(20.0, 21.0)
    box.box.close()
    first, second = box.bags
    assert first.numbers == list(range(79, 150))
    assert first.told == ["a", "b"]
    assert second.numbers == list(range(179, 210))
    assert second.closed


def test_a_box_that_has_heard_nothing_writes_an_empty_bag_for_a_request():
    box = Box()
    box.happen("now", Cause.REQUEST)
    box.box.close()
    (bag,) = box.bags
    assert (bag.messages, bag.told, bag.closed) == ([], ["now"], True)


def test_a_bag_ends_although_nothing_is_heard_any_more():
    box = Box()
    box.hear(0.0, 5.0)
    box.happen()
    box.box.look(9 * SECOND)
    assert box.bags[0].closed
    assert len(box.box.ring) == 0


@pytest.mark.parametrize("back", [3.0, 1000.0])
def test_a_clock_that_is_set_back_neither_holds_a_bag_open_nor_loses_what_was_heard(back):
    box = Box()
    box.hear(1000.0, 1010.0)
    box.happen()
    box.hear(1010.0 - back, 1020.0 - back)
    assert box.bags[0].closed
    assert len(box.bags[0].messages) == pytest.approx(51, abs=2)


def test_small_disorder_of_the_times_does_not_make_the_windows_shorter():
    box = Box()
    for k in range(100):
        box.box.add("/h", b"%d" % k, round((0.1 * k - 0.3 * (k % 2)) * SECOND))
        box.box.look(round(0.1 * k * SECOND))
    box.happen()
    assert box.bags[0].numbers == list(range(80, 100))  # an odd one came as the one before it


def test_the_ring_is_bounded_in_bytes_and_in_messages(monkeypatch):
    box = Box(before=1000.0, memory=20 * (OVERHEAD + 2))
    box.hear(1.0, 9.0)
    assert len(box.box.ring) == 20
    assert box.box.ring.is_short
    assert box.box.ring.size <= 20 * (OVERHEAD + 2)
    monkeypatch.setattr(module, "MOST", 7)
    box = Box(before=1000.0)
    box.hear(1.0, 9.0)
    assert [int(message.data) for message in box.box.ring] == list(range(83, 90))


def test_a_message_larger_than_the_memory_is_not_kept_and_costs_nothing_else():
    box = Box(memory=10_000)
    box.box.add("/h", bytes(20_000), 0)
    assert (len(box.box.ring), box.box.ring.size) == (0, 0)
    box.hear(0.1, 1.0)
    assert len(box.box.ring) == 9


def place(topic, data):
    """Returns which latched message is replaced: 's' is a node's start, 'c' is a change."""
    if topic != "/settings":
        return None
    return Place(data[1:2], int(data[:1] == b"c"))


def test_latched_messages_of_before_come_first_as_they_hold_at_the_beginning():
    box = Box(place=place)
    box.box.add_topic("/settings", TYPE, Qos(durability="transient_local"))
    box.box.add("/settings", b"sa1", 0)
    box.box.add("/settings", b"ca2", SECOND // 10)
    box.box.add("/settings", b"sb3", SECOND // 5)
    box.box.add("/settings", b"sa4", SECOND // 4)
    box.box.add("/settings", b"ca5", SECOND // 3)
    box.box.add("/settings", b"ca6", SECOND // 2)
    box.hear(1.0, 10.0)
    box.box.add("/settings", b"sb7", 10 * SECOND)
    box.happen()
    (bag,) = box.bags
    assert [data for _, data, _ in bag.messages[:3]] == [b"sb3", b"sa4", b"ca6"]
    assert bag.messages[-1][1] == b"sb7"
    # They are heard when the bag begins, not seconds before.
    assert {log_ns for *_, log_ns in bag.messages[:4]} == {8 * SECOND}


def test_a_topic_that_gets_another_type_is_not_written_with_the_old_messages():
    box = Box()
    box.hear(0.0, 1.0)
    box.box.add_topic("/h", "std_msgs/msg/String", Qos())
    box.hear(1.0, 2.0)
    box.happen()
    assert box.bags[0].numbers == list(range(10, 20))
    assert box.bags[0].topics == {"/h": "std_msgs/msg/String"}


def test_a_bag_that_cannot_be_begun_is_tried_again_while_its_time_is_in_memory():
    box = Box()
    box.hear(0.0, 10.0)
    box.refuses = "no space left"
    box.happen("a")
    box.hear(10.0, 11.0)
    assert (box.box.failure, box.bags) == ("no space left", [])
    box.refuses = ""
    box.hear(11.0, 20.0)
    (bag,) = box.bags
    assert bag.told == ["a"]
    assert bag.numbers[-1] == 129
    assert {99, 100} <= set(bag.numbers)
    assert (box.box.failure, box.box.missed) == ("", 0)


def test_an_event_whose_time_has_left_the_memory_is_counted():
    box = Box()
    box.refuses = "no space left"
    box.hear(0.0, 10.0)
    box.happen("a")
    box.hear(10.0, 20.0)
    assert (box.box.missed, box.box.failure) == (1, "")
    box.happen("b")
    box.box.close()
    assert (box.box.missed, box.bags) == (2, [])


def test_messages_that_were_lost_are_noted_in_the_bag_of_their_time_alone():
    box = Box()
    box.hear(0.0, 1.0)
    box.box.miss({"/h": 5})
    box.hear(1.0, 10.0)
    box.happen()
    assert box.bags[0].missed == {}
    box.box.miss({"/h": 8})
    assert box.bags[0].missed == {"/h": 3}
    box.hear(10.0, 14.0)
    box.happen()
    assert box.bags[1].missed == {}


def test_a_bag_that_gets_too_large_goes_on_in_another_one_with_the_time_before():
    box = Box(after=30.0, longest=100 * (OVERHEAD + 3))
    box.hear(10.0, 20.0)
    box.happen("long")
    box.hear(20.0, 60.0)
    assert len(box.bags) > 3
    assert all(bag.told == ["long"] and len(bag.messages) <= 101 for bag in box.bags)
    numbers = [number for bag in box.bags for number in bag.numbers]
    assert set(numbers) == set(range(179, 500))
    for bag, follower in zip(box.bags, box.bags[1:], strict=False):
        assert follower.numbers[0] == bag.numbers[-1] - 20  # a replay finds a state before the cut


def test_a_storm_of_events_does_not_fill_the_facts():
    box = Box()
    box.hear(0.0, 1.0)
    for k in range(1000):
        box.happen(str(k))
    box.happen("blind", Cause.BLIND)
    assert len(box.bags[0].told) == module.TOLD + 1
    assert box.bags[0].told[-1] == "blind"


# Steps of up to some seconds between messages; an event after a message, or none.
COURSES = st.lists(
    st.tuples(st.integers(0, 4 * SECOND), st.sampled_from([None, None, None, *Cause])), max_size=80
)


@settings(max_examples=200, deadline=None)
@given(
    course=COURSES,
    before=st.integers(1, 10 * SECOND),
    after=st.integers(0, 10 * SECOND),
    most=st.integers(2, 60),
)
def test_whatever_happens_no_event_is_lost_and_nothing_is_twice(course, before, after, most):
    longest = 2 * most * (OVERHEAD + 2)
    box = Box(before / SECOND, after / SECOND, most * (OVERHEAD + 2), longest)
    now, times, events = 0, [], []
    for number, (step, cause) in enumerate(course):
        now += step
        times.append(now)
        box.box.add("/h", b"%d" % number, now)
        assert box.box.ring.size <= most * (OVERHEAD + 2)
        if cause is not None:
            events.append((now, cause))
            box.happen(str(now), cause)
    box.box.close()
    for bag in box.bags:
        # In order, without holes, once each.
        assert bag.numbers == list(range(bag.numbers[0], bag.numbers[-1] + 1))
        assert bag.closed
        assert len(bag.messages) * (OVERHEAD + 1) <= longest + OVERHEAD + 2
    told = Counter(text for bag in box.bags for text in bag.told)
    assert set(told) == {str(at) for at, _ in events}
    assert box.box.missed == 0
    for at, _ in events:
        held = {number for bag in box.bags for number in bag.numbers}
        wanted = [k for k, time in enumerate(times) if at <= time <= at + after]
        assert set(wanted) <= held
        recent = [k for k, time in enumerate(times) if at - before <= time <= at][-2:]
        assert set(recent) <= held

    assert box.box.bags == len(box.bags)
