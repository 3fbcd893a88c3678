"""Tests the recorder's diagnostics: problem, place, time and remedy."""

from pathlib import Path

import pytest

from slosh_bag.nodes.recorder_health import findings
from slosh_bag.recorder import RecorderStatus
from slosh_msgs_py.node.diagnostics import ERROR, OK, WARN

FINE = {
    "path": Path("/data/run/run_1.mcap"), "files": 2, "written": {"/a": 10, "/b": 5},
    "size": 1000, "refused": {}, "unkept": 0, "waiting": 0, "highest": 3, "age": 0.1,
    "free": 10**11, "rate": 1e6, "failure": "", "since": 0.0, "interruptions": 0,
    "lost_meanwhile": 0,
}  # fmt: skip


def said(absent=None, on_the_way=0, left_out=None, silent=False, **changes):
    status = RecorderStatus(**{**FINE, **changes})
    return findings(status, absent or {}, on_the_way, left_out or {}, silent)


def test_topics_that_are_not_of_one_are_named():
    level, sentence = findings(
        RecorderStatus(**FINE), {}, 0, {}, False, ["/slosh/estimate"], {"/slosh/accel": "a/msg/B"}
    )
    assert level == WARN
    assert "several publishers on /slosh/estimate: is another cell" in sentence
    assert "/slosh/accel is also published as a/msg/B, which is not recorded" in sentence


def test_a_full_disk_is_an_error_with_path_space_and_remedy():
    level, sentence = said(
        failure="/data/run/run_1.mcap: No space left on device", since=12.4, free=3_000_000,
        waiting=400, unkept=7, lost_meanwhile=7,
    )  # fmt: skip
    assert level == ERROR
    for part in (
        "for 12 s", "/data/run/run_1.mcap: No space left on device", "3 MB free",
        "free some space",
        "400 messages are waiting, 7 are lost",
    ):  # fmt: skip
        assert part in sentence


def test_what_was_lost_on_a_full_disk_is_told_afterwards():
    level, sentence = said(interruptions=1, unkept=7, lost_meanwhile=7)
    assert level == WARN
    assert "resumed in run_1.mcap" in sentence
    assert "7 messages were lost" in sentence


def test_a_disk_that_is_too_slow_is_an_error():
    assert said(unkept=9, lost_meanwhile=7) == (
        ERROR,
        "2 messages lost: the disk is too slow",
    )


@pytest.mark.parametrize(
    ("free", "rate", "level"),
    [
        (599 * 10**6, 1e6, WARN),
        (601 * 10**6, 1e6, OK),
        (10**6, 0.0, OK),
        (10**6, float("nan"), OK),
    ],
)
def test_a_disk_that_will_soon_be_full_is_warned_of(free, rate, level):
    found, sentence = said(free=free, rate=rate)
    assert found == level
    assert ("/data/run will be full in 10.0 min at 1.0 MB/s, 599 MB" in sentence) == (
        level == WARN
    )


def test_everything_is_said_the_worst_first():
    level, sentence = said(
        {"/accel": 12.3, "/image": 3.0}, 4, {"/odd": "odd_msgs is not installed here"},
        unkept=1,
    )  # fmt: skip
    assert level == ERROR
    assert sentence == (
        "1 messages lost: the disk is too slow; "
        "publisher lost: /accel (for 12 s), /image (for 3 s); "
        "4 messages lost before they reached the recorder; "
        "1 topics are not recorded, such as /odd: odd_msgs is not installed here"
    )
