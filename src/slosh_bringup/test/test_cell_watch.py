"""Tests which of the nodes' diagnostics are shown to the user."""

import pytest
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from slosh_bringup.cell_watch import ERROR, OK, SILENT, STALE, WARN, CellWatch, NodeReport, reports
from slosh_bringup.cli import live
from slosh_bringup.live.run import OtherCells
from slosh_bringup.live.watch import CellStatus
from slosh_msgs_py.node.rivals import FORGOTTEN


def told(*said, nodes=("camera",)):
    """Returns the printed lines for a series of diagnostics, one per second."""
    watch = CellWatch(nodes, 0.0)
    lines = []
    for second, (level, sentence) in enumerate(said, start=1):
        lines += watch.take(NodeReport("camera", level, sentence, {}), float(second))
    return lines


def test_a_change_is_told_once_it_lasts_and_once_it_is_over():
    silent = [(STALE, f"no image for {second} s: nobody publishes it") for second in range(1, 6)]
    assert told(*silent, (OK, "measuring"), (OK, "measuring")) == [
        "camera: no image for 2 s: nobody publishes it",
        "camera: OK again: measuring",
    ]


def test_what_comes_and_goes_is_not_told():
    assert told((WARN, "dark"), (OK, "fine"), (WARN, "dark"), (ERROR, "bad"), (OK, "fine")) == []


def test_another_cause_is_told_and_other_numbers_are_not():
    assert told((WARN, "3 lost"), (WARN, "5 lost"), (WARN, "7 late"), (WARN, "0.5 late")) == [
        "camera: 5 lost",
        "camera: 0.5 late",
    ]


def test_a_node_that_says_nothing_is_named_once():
    watch = CellWatch(["camera", "monitor"], 0.0)
    assert watch.take(NodeReport("monitor", OK, "fine", {}), 3.0) == []
    assert watch.look(SILENT - 0.1) == []
    assert watch.look(SILENT + 0.1) == ["camera: no diagnostics for 5 s"]
    assert watch.look(SILENT + 0.2) == []
    assert watch.take(NodeReport("camera", OK, "fine", {}), 7.0) == []
    assert watch.look(3.0 + SILENT + 0.1) == ["monitor: no diagnostics for 5 s"]


def test_strangers_are_not_heard():
    watch = CellWatch(["camera"], 0.0)
    for _ in range(3):
        assert watch.take(NodeReport("arm", ERROR, "hot", {}), 1.0) == []


def test_reports_are_those_of_the_cells_own_namespace():
    def status(name):
        pairs = [KeyValue(key="state", value="ready")]
        return DiagnosticStatus(level=STALE.to_bytes(1), name=name, message="m", values=pairs)

    names = ("/slosh/camera", "/slosh/deep/camera", "/camera", "/other/camera", "arm: motor")
    message = DiagnosticArray(status=[status(name) for name in names])
    assert list(reports(message, "/slosh")) == [
        NodeReport("camera", STALE, "m", {"state": "ready"})
    ]
    assert [report.node for report in reports(message, "/")] == ["camera"]


# The line that `slosh cell` shows on a terminal, and keeps out of a log.


@pytest.fixture
def status():
    found = CellStatus()
    found.take_parameters("monitor", {"measured_limit": 0.02})
    found.take_report(NodeReport("camera", OK, "measuring", {"measurement [Hz]": "59.9"}))
    found.take_report(NodeReport("recorder", OK, "recording", {}))
    return found


def test_it_tells_state_heights_limit_and_rates(status):
    status.take_comparison(0.0123, 0.0112, 0, 5.0)
    assert status.line(5.1) == "SAFE · measured 12.3, estimated 11.2 of 20.0 mm · camera 60 Hz"


def test_without_a_camera_the_estimate_is_told_with_its_limit(status):
    status.take_parameters("monitor", {"measured_limit": 0.02, "estimated_limit": 0.015})
    status.take_comparison(float("nan"), 0.0112, 0, 5.0, alone=True)
    assert status.line(5.1) == "SAFE · estimated 11.2 of 15.0 mm, no camera · camera 60 Hz"


def test_a_rim_that_is_lower_than_the_limit_is_told(status):
    status.take_parameters("monitor", {"measured_limit": 0.02, "rim": 0.015})
    status.take_comparison(0.0123, 0.0112, 0, 5.0)
    assert "estimated 11.2 of 15.0 mm (rim) ·" in status.line(5.1)


def test_silence_is_told_in_place_of_old_heights(status):
    status.take_comparison(0.0123, float("nan"), 0, 5.0)
    assert "estimated – of" in status.line(5.1)
    assert status.line(9.0).startswith("BLIND · no message from the monitor for 4 s")


@pytest.mark.parametrize(
    ("terminal", "expected"), [(True, ["SAFE", "SAFE"]), (False, ["", "waiting for camera"])]
)
def test_a_log_is_not_told(monkeypatch, terminal, expected):
    shown = []
    monkeypatch.setattr(live, "can_draw", lambda stream: terminal)
    screen = live.LiveScreen(lambda elapsed, text: shown.append(text), None)
    screen.show(1.0, "", "SAFE")
    screen.show(2.0, "waiting for camera", "SAFE")
    assert shown == expected


# Another cell in the namespace is told when it is seen, once, and one's own nodes are none.


NAMES = ("estimator", "monitor")


@pytest.fixture
def cells():
    """Returns the detector of other cells after this cell has started its nodes at 0 s."""
    others = OtherCells()
    for name in NAMES:
        others.started(name, 0.0)
    return others


def counts(**extra):
    """Returns the number of discovered nodes by name, with optional additional ones."""
    return {name: 1 + extra.get(name, 0) for name in NAMES}


def test_another_cell_is_told_once_with_all_of_its_nodes_and_again_when_it_comes_back(cells):
    both = counts(estimator=1, monitor=1)
    seen = [counts(estimator=1), both, both, both, counts(), counts(), both, both]
    told = [cells.look(one, float(now)) for now, one in enumerate(seen)]
    assert told == [[], [], list(NAMES), [], [], [], [], list(NAMES)]


def test_nodes_that_are_there_before_ones_own_are_another_cells():
    others = OtherCells()
    assert [others.look({"monitor": 1}, float(now)) for now in range(2)] == [[], ["monitor"]]


def test_a_node_that_was_killed_and_started_again_is_ones_own_until_it_should_be_forgotten(cells):
    cells.started("monitor", 10.0)
    seen = [cells.look(counts(monitor=1), 10.0 + age) for age in (1.0, 2.0, FORGOTTEN)]
    assert seen == [[]] * 3
    late = 10.0 + FORGOTTEN
    assert [cells.look(counts(monitor=1), late + age) for age in (1.0, 2.0)] == [[], ["monitor"]]
