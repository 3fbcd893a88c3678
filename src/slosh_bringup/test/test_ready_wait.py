"""Tests which nodes a cell waits for before it begins, and when it stops waiting."""

import pytest

from slosh_bringup.cell_watch import OK, WARN, NodeReport
from slosh_bringup.ready_wait import STUCK, ReadyWait, sentence


def report(node, state, text="measuring"):
    return NodeReport(node, OK if state == "ready" else WARN, text, {"state": state})


def test_all_named_nodes_are_waited_for():
    wait = ReadyWait(["camera", "monitor"], 0.0)
    assert sentence(wait.missing()) == "camera, monitor (no diagnostics received yet)"
    wait.take(report("camera", "compiling", "not ready, compiling: the detector"), 1.0)
    wait.take(report("monitor", "ready"), 1.0)
    assert wait.missing() == {"camera": "compiling: the detector"}
    assert sentence(wait.missing()) == "camera (compiling: the detector)"
    wait.take(report("camera", "ready"), 2.0)
    assert wait.missing() == {}


def test_a_node_that_shows_up_unready_is_waited_for_too():
    wait = ReadyWait([], 0.0)
    wait.take(report("camera", "starting", "not ready, starting"), 1.0)
    assert wait.missing() == {"camera": "starting"}
    wait.take(report("camera", "ready"), 2.0)
    assert wait.missing() == {}


def recorder(heard):
    return NodeReport(
        "recorder", OK, "recording", {"state": "ready", "recorded settings of": heard}
    )


def test_the_recorder_is_ready_when_it_has_heard_what_the_others_work_with():
    wait = ReadyWait(["recorder", "camera", "monitor", "cell"], 0.0)
    for node in ("camera", "monitor", "cell"):
        wait.take(report(node, "ready"), 1.0)
    wait.take(recorder(""), 1.0)
    assert (
        sentence(wait.missing()) == "recorder (has not received the settings of camera, monitor)"
    )
    wait.take(recorder("monitor"), 2.0)
    assert wait.missing() == {"recorder": "has not received the settings of camera"}
    wait.take(recorder("camera, monitor"), 3.0)
    assert wait.missing() == {}
    assert wait.unrecorded == ()


@pytest.mark.parametrize(
    ("reports", "now", "given_up"),
    [
        ([], 10.0, ""),
        ([], 10.1, "camera has sent no diagnostics for 10 s"),
        ([(5.0, "a")], 15.0, ""),
        ([(5.0, "a")], 15.1, "camera has sent no diagnostics for 10 s: a"),
        # It may say the same for long, and new things for ever.
        ([(t, "a") for t in range(100)], 100.0, ""),
        ([(t, "a") for t in range(102)], 102.0, "camera has reported for 102 s: a"),
        ([(t, f"{t // 50}") for t in range(1000)], 1000.0, ""),
    ],
)
def test_waiting_ends_where_nothing_new_comes(reports, now, given_up):
    wait = ReadyWait(["camera"], 0.0, 10.0)
    assert STUCK == 10.0
    for at, text in reports:
        wait.take(report("camera", "compiling", text), float(at))
    assert wait.given_up(now) == given_up
    wait.take(report("camera", "ready"), now)
    assert wait.given_up(now + 1000.0) == ""
