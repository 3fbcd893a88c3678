"""Tests which messages of a bag are played, and when."""

from itertools import islice
from pathlib import Path

import pytest

from slosh_bag.bag_writer import BagWriter, Qos
from slosh_bag.definitions import Definitions
from slosh_bag.errors import SloshBagError
from slosh_bag.interchange.bag_contents import BagTopic, parse_offered
from slosh_bag.nodes.player_thread import BATCH_LENGTH, BATCHES, ReadAhead
from slosh_bag.playing.play_plan import (
    PlayRequest,
    make_plan,
    refusal,
    renamed,
    without,
)
from slosh_bag.playing.playback import Playback, PlaybackSettings
from slosh_bag.reader import BagMessage
from slosh_base.files.nanoseconds import SECOND
from slosh_msgs_py import topics

MS = 1_000_000
BEGIN = 1_700_000_000 * SECOND
ACCEL, HEADER = "geometry_msgs/msg/AccelStamped", "std_msgs/msg/Header"


def message(offset_ns, topic="/slosh/accel"):
    return BagMessage(topic, ACCEL, BEGIN + offset_ns, BEGIN + offset_ns, b"x")


def steps(messages, span=None, latched=None, passes=1, **settings):
    offsets = [m.log_ns for m in messages]
    playback = Playback(
        span or (min(offsets), max(offsets)), PlaybackSettings(**settings), latched
    )
    taken = playback.steps(lambda: iter(messages))
    return list(taken) if passes == 1 else list(islice(taken, passes))


def messages_of(taken):
    return [step for step in taken if step.message is not None]


KILOHERTZ = [message(k * MS) for k in range(500)]
# Three topics that speak in turns, pauses, several messages of one time.
MIXED = sorted(
    [message(k * MS + k % 7 * 1000) for k in range(0, 200)]
    + [message(k * MS + 300_000, "/slosh/estimate") for k in range(0, 200)]
    + [message(k * MS, "/slosh/camera/image_raw") for k in range(0, 900, 17)],
    key=lambda m: m.log_ns,
)


@pytest.mark.parametrize("rate", [0.01, 0.5, 1.0, 3.7, 20.0, 1000.0])
@pytest.mark.parametrize("messages", [KILOHERTZ, MIXED], ids=["1 kHz", "mixed"])
def test_each_message_is_due_at_its_time_divided_by_the_rate(messages, rate):
    taken = messages_of(steps(messages, rate=rate))
    assert [step.message for step in taken] == messages
    for step in taken:
        assert step.wall_ns == round((step.message.log_ns - BEGIN) / rate)
        assert step.clock_ns == step.message.log_ns


@pytest.mark.first(10)
@pytest.mark.parametrize("clock_rate", [0.0, 25.0, 4000.0])
@pytest.mark.parametrize("rate", [0.01, 0.5, 1.0, 20.0, 1000.0])
@pytest.mark.parametrize("messages", [KILOHERTZ, MIXED], ids=["1 kHz", "mixed"])
def test_the_clock_comes_first_never_goes_back_and_never_lags(messages, rate, clock_rate):
    clock, wall = -1, 0
    period = SECOND / clock_rate if clock_rate else 10 * MS
    lead = rate * period if clock_rate else min(rate * MS, 10 * MS)
    taken = steps(messages, rate=rate, clock_rate=clock_rate)
    assert taken[0][1:] == (BEGIN, None)
    for step in taken:
        assert step.wall_ns >= wall
        assert step.wall_ns - wall <= period + 1  # no pause of time where nothing is said
        wall = step.wall_ns
        if step.message is None:
            assert step.clock_ns >= clock
            clock = step.clock_ns
        else:
            assert step.clock_ns <= clock <= step.clock_ns + lead
    assert clock == messages[-1].log_ns


def test_a_node_sees_the_time_of_each_kilohertz_sample_and_not_more_clock_than_that():
    taken = steps(KILOHERTZ)
    clocks = [step.clock_ns for step in taken if step.message is None]
    assert clocks == [m.log_ns for m in KILOHERTZ]


def test_a_part_is_played_from_its_own_beginning():
    taken = steps(KILOHERTZ, start=0.1, duration=0.05, rate=2.0)
    assert [step.message for step in messages_of(taken)] == KILOHERTZ[100:151]
    assert (taken[0].wall_ns, taken[0].clock_ns) == (0, BEGIN + 100 * MS)
    assert messages_of(taken)[0].wall_ns == 0
    assert taken[-1].clock_ns == BEGIN + 150 * MS


def test_what_was_latched_before_the_start_still_holds():
    early = [message(k * MS, "/facts") for k in range(5)]
    stream = [message(k * 10 * MS + 1) for k in range(10)]
    taken = steps(early + stream, latched={"/facts": 2}, start=0.05)
    assert [step.message for step in messages_of(taken)][:3] == [*early[3:], stream[5]]
    assert [step.clock_ns for step in messages_of(taken)][:2] == [BEGIN + 50 * MS] * 2
    nothing_after = steps(early, (BEGIN, BEGIN + SECOND), {"/facts": 2}, start=0.5)
    assert [step.message for step in messages_of(nothing_after)] == early[3:]


def test_a_loop_begins_anew_where_the_last_pass_ends():
    once = steps(KILOHERTZ, rate=2.0)
    taken = steps(KILOHERTZ, rate=2.0, loop=True, passes=3 * len(once))
    for number in range(3):
        part = taken[number * len(once) : (number + 1) * len(once)]
        assert [step.wall_ns - number * 499 * MS // 2 for step in part] == [
            step.wall_ns for step in once
        ]
        assert [step.clock_ns for step in part] == [step.clock_ns for step in once]


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"rate": 0.0}, r"rate = 0: must lie in \[0.01, 1000\]"),
        ({"rate": float("nan")}, "rate = nan"),
        ({"start": -1.0}, r"start = -1 s: must lie in \[0, 1e9\] s"),
        ({"duration": float("inf")}, "duration = inf s"),
        ({"clock_rate": 0.1}, "clock = 0.1 Hz: must be 0 or lie in"),
        ({"start": 1.0}, "start = 1 s: the bag ends after 0.499 s"),
    ],
)
def test_what_does_not_fit_is_named(settings, said):
    with pytest.raises(SloshBagError, match=said):
        steps(KILOHERTZ, **settings)


def test_a_time_that_ros_cannot_say_is_told():
    with pytest.raises(SloshBagError, match="ROS times end in the year 2038"):
        Playback((0, 2**31 * SECOND), PlaybackSettings())


# --- reading ahead -------------------------------------------------------------------------------


def test_reading_ahead_changes_neither_items_nor_order_and_is_bounded():
    given = []

    def items():
        for number in range(BATCH_LENGTH * BATCHES * 3):
            given.append(number)
            yield number

    with ReadAhead(items(), lambda item: 1) as ahead:
        taken = []
        for item in ahead:
            taken.append(item)
            # One batch is being filled, one waits to be put, one is being read.
            assert len(given) - len(taken) <= BATCH_LENGTH * (BATCHES + 3)
    assert taken == given


# --- what is played ------------------------------------------------------------------------------


TYPES = {
    "/slosh/accel": ACCEL,
    "/slosh/imu": "sensor_msgs/msg/Imu",
    "/slosh/camera/image_raw": "sensor_msgs/msg/Image",
    "/slosh/estimate": "slosh_msgs/msg/SloshEstimate",
    "/slosh/limit_event": "slosh_msgs/msg/LimitEvent",
    "/clock": "rosgraph_msgs/msg/Clock",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
}
LATCHED = Qos(durability="transient_local", depth=7)


@pytest.fixture
def bag(tmp_path):
    folder = tmp_path / "bag"
    with BagWriter(folder) as writer:
        for topic, kind in TYPES.items():
            writer.add_topic(topic, kind, LATCHED if "event" in topic else Qos("best_effort"))
            for k in range(5):
                writer.write(topic, b"x" * 100, BEGIN + k * MS)
    return folder


def chosen(bag, **request):
    return set(make_plan(PlayRequest(bag, **request)).topics)


def test_everything_but_the_clock_is_played_with_what_its_publishers_offered(bag):
    plan = make_plan(PlayRequest(bag))
    assert set(plan.topics) == set(TYPES) - {"/clock"}
    assert not plan.warnings
    for topic, entry in plan.topics.items():
        latched = "event" in topic
        assert entry.message_type == TYPES[topic]
        assert entry.name == topic
        assert entry.qos.durability == ("transient_local" if latched else "volatile")
        assert entry.qos.reliability == ("reliable" if latched else "best_effort")
    assert [s.message.topic for s in messages_of(plan.steps())[::6]] == ["/slosh/accel"] * 5


def test_topics_are_chosen(bag):
    assert chosen(bag, topics="accel|imu") == {"/slosh/accel", "/slosh/imu"}
    assert chosen(bag, topics="^/slosh", exclude="e") == {"/slosh/imu"}
    assert chosen(bag, inputs=True) == {"/slosh/accel", "/slosh/imu", "/slosh/camera/image_raw"}
    with pytest.raises(
        SloshBagError, match=r"bag: nothing to play: no topic is selected \(topics: /clock, /diag"
    ):
        chosen(bag, topics="/nothing")
    with pytest.raises(SloshBagError, match=r"topics = '\(': not a regular expression"):
        chosen(bag, topics="(")
    with pytest.raises(SloshBagError, match="namespace = 'a b': not a valid ROS name"):
        chosen(bag, namespace="a b")


def test_inputs_and_names_do_not_depend_on_the_namespace(bag):
    for topic in (
        "/accel", "/a/b/imu", "/camera/camera_info", "/x/camera/image_raw/compressed",
        "/joint_states", "/tf", "/robot_description",
    ):  # fmt: skip
        assert topics.is_input(topic)
    for topic in ("/slosh/estimate", "/slosh/cell/truth", "/slosh/acceleration", "/diagnostics"):
        assert not topics.is_input(topic)
    assert renamed("/slosh/camera/image_raw/compressed", "test") == (
        "/test/camera/image_raw/compressed"
    )
    assert renamed("/accel", "/a/b/") == "/a/b/accel"
    assert renamed("/slosh/accel", "/") == "/accel"
    assert renamed("/slosh/accel", "") == "/slosh/accel"
    assert renamed("/tf_static", "test") == "/tf_static"
    names = {entry.name for entry in make_plan(PlayRequest(bag, namespace="test")).topics.values()}
    assert names == {topic.replace("/slosh", "/test") for topic in TYPES} - {"/clock"}


def test_all_topics_of_a_cell_move_into_a_namespace_and_no_others(tmp_path):
    """Tests that a recorded plan does not reach a live predictor."""
    foreign = {"/plc/settings": "std_msgs/msg/String", "/robot/plan": "std_msgs/msg/String"}
    own = {f"/slosh/{row.name}": row.type for row in topics.TOPICS if not row.is_absolute}
    with BagWriter(tmp_path / "bag") as writer:
        for number, (topic, kind) in enumerate({**own, **foreign}.items()):
            writer.add_topic(topic, kind)
            writer.write(topic, b"x" * 100, BEGIN + number * MS)
    plan = make_plan(PlayRequest(tmp_path / "bag", namespace="/replayed"))
    names = {topic: entry.name for topic, entry in plan.topics.items()}
    assert names == {topic: topic for topic in foreign} | {
        topic: topic.replace("/slosh/", "/replayed/") for topic in own
    }


@pytest.mark.parametrize(
    ("text", "profiles"),
    [
        ("", []),
        ("- {reliability: reliable, durability: transient_local, depth: 3}", [
            Qos("reliable", "transient_local", 3)]),
        ("- {reliability: 2, durability: 2, depth: 5}", [Qos("best_effort", "volatile", 5)]),
        ("- {reliability: 1, durability: 1, depth: 0}", [Qos("reliable", "transient_local")]),
        ("- {history: unknown, depth: 0, reliability: system_default}", [Qos()]),
        ("[[[", []),
        ("reliable", []),
    ],
)  # fmt: skip
def test_rosbag2s_notes_are_read_as_words_and_as_numbers(text, profiles):
    assert parse_offered(text) == profiles


def test_a_type_that_is_another_here_is_not_played_as_if_it_were_the_same(bag, tmp_path):
    text = Definitions().text(ACCEL)
    assert refusal("/a", BagTopic(ACCEL, text, "cdr")) == ""
    # Whoever is built with another definition would read wrong numbers out of the same bytes.
    older = refusal("/a", BagTopic(ACCEL, f"float64 gain\n{text}", "cdr"))
    assert older == f"the bag's definition of {ACCEL} is not the installed one"
    assert "package other_msgs is not installed" in refusal(
        "/a", BagTopic("other_msgs/msg/Thing", "float64 x", "cdr")
    )
    assert "are json, not cdr" in refusal("/a", BagTopic(ACCEL, text, "json"))
    assert "not a valid ROS name" in refusal("/a-b", BagTopic(ACCEL, text, "cdr"))
    for damaged in ("", "no definition at all $", text.replace("MSG: std_msgs", "MSG: gone")):
        assert refusal("/a", BagTopic(ACCEL, damaged, "cdr"))


def test_topics_that_cannot_be_sent_are_left_out_with_one_warning(bag):
    plan = without(make_plan(PlayRequest(bag)), ["/slosh/imu", "/slosh/accel"])
    assert not {"/slosh/imu", "/slosh/accel"} & set(plan.topics)
    assert len(plan.warnings) == 1
    assert ACCEL in plan.warnings[0]
    assert {s.message.topic for s in messages_of(plan.steps())} == set(plan.topics)
    with pytest.raises(SloshBagError, match="nothing to play: types not installed here: "):
        without(plan, list(plan.topics))


def test_a_bag_without_messages_is_told(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/slosh/accel", ACCEL)
    with pytest.raises(SloshBagError, match="bag: holds no messages"):
        make_plan(PlayRequest(tmp_path / "bag"))
    with pytest.raises(SloshBagError, match="no such file"):
        make_plan(PlayRequest(Path("/nowhere")))
