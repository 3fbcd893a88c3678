"""The line that `slosh cell` shows on a terminal, and keeps out of a log."""

import pytest

from slosh_bringup.cell_watch import OK, NodeReport
from slosh_bringup.cli import live
from slosh_bringup.live.watch import CellStatus


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
