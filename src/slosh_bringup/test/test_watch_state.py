"""Tests the operator's page: displayed values and the safety verdict."""

import json

import numpy as np
import pytest

from slosh_bringup.cell_watch import ERROR, OK, NodeReport
from slosh_bringup.watch.recording import first_happening
from slosh_bringup.watch.state import (
    CalmNews,
    Compared,
    Estimated,
    Fused,
    LimitNews,
    Surface,
    WatchState,
)
from slosh_bringup.watch.verdict import CellVerdict, judge
from slosh_model import Cylinder
from slosh_model.shapes import LyingCylinder, Tray
from slosh_testing.mode_solver import needs_solver

SECOND = 1_000_000_000
START_NS = 1_700_000_000 * SECOND


def compared(seconds, measured=0.004, estimated=0.005, state=0, stale=()):
    stamp_ns = START_NS + round(seconds * SECOND)
    return Compared(
        stamp_ns, measured, 1e-4, estimated, measured - estimated, 2e-4, -0.03, state, stale
    )


def event(number, kind, source=0, text="measured height 20.1 mm"):
    return LimitNews(START_NS + number * SECOND, number, kind, source, 0.02, text)


def frame(state, now):
    return json.loads(state.frame(now))


class TestVerdict:
    @pytest.mark.parametrize(
        ("state", "expected"),
        [
            (0, CellVerdict.SAFE), (1, CellVerdict.NEAR), (2, CellVerdict.EXCEEDED),
            (3, CellVerdict.BLIND), (4, CellVerdict.BLIND), (17, CellVerdict.BLIND),
            (None, CellVerdict.BLIND),
        ],
    )  # fmt: skip
    def test_each_state_of_the_monitor_has_one(self, state, expected):
        assert judge(state, 0.1).verdict is expected

    @pytest.mark.parametrize("state", [0, 1, 2, 3, 4])
    def test_silence_is_never_safe(self, state):
        verdict, reason = judge(state, 3.2)
        assert verdict is CellVerdict.BLIND
        assert "no message from the monitor for 3 s" in reason

    def test_without_a_camera_by_choice_the_estimate_makes_the_verdict(self):
        verdict, reason = judge(0, 0.1, alone=True)
        assert verdict is CellVerdict.SAFE
        assert reason == "estimated below its limit; no camera configured"

    def test_who_is_silent_is_named(self):
        assert "the camera" in judge(3, 0.1, ("the camera",)).reason

    def test_sides_that_disagree_are_not_near_a_limit(self):
        verdict, reason = judge(1, 0.1, disagree=True)
        assert verdict is CellVerdict.DISAGREE
        assert "disagree" in reason
        assert judge(2, 0.1, disagree=True).verdict is CellVerdict.EXCEEDED


class TestFrames:
    def test_a_frame_holds_what_is_new_and_the_next_one_does_not(self):
        state = WatchState()
        for step in range(5):
            state.take_comparison(compared(step / 60.0), step / 60.0)
        found = frame(state, 0.1)
        assert [row[0] for row in found["rows"]] == pytest.approx(
            [step / 60.0 for step in range(5)], abs=1e-4
        )
        assert found["rows"][0][1:3] == [0.004, 0.005]
        assert found["now"]["measured"] == 0.004
        assert found["verdict"] == "safe"
        assert frame(state, 0.2)["rows"] == []

    def test_without_a_camera_the_estimate_goes_on_alone(self):
        state = WatchState()
        state.take_comparison(compared(0.0), 0.0)
        state.take_estimate(Estimated(START_NS + SECOND // 10, 0.006, 0.3), 0.1)
        assert len(frame(state, 0.1)["rows"]) == 1  # a comparison holds it
        state.take_estimate(Estimated(START_NS + 2 * SECOND, 0.007, 0.3), 2.0)
        found = frame(state, 2.0)
        assert found["rows"] == [[2.0, None, 0.007, None, None, None]]
        assert (found["now"]["measured"], found["now"]["estimated"]) == (None, 0.007)
        assert found["verdict"] == "blind"

    def test_the_container_is_drawn_and_both_sides_are_told_how_far_the_rim_is(self):
        state = WatchState()
        state.take_comparison(compared(0.0), 0.0)
        assert "to_rim" not in frame(state, 0.0)["now"]
        # The camera alone: nothing of the estimator's model is known.
        state = WatchState()
        state.take_container(Cylinder(0.04, 0.06, rim_height=0.07))
        state.take_comparison(compared(0.0, measured=0.012, estimated=0.005), 0.0)
        found = frame(state, 0.0)
        assert found["now"]["to_rim"] == {"measured": -0.002, "estimated": 0.005}
        assert found["container"]["outline"] == [[0.0, -0.06], [0.04, -0.06], [0.04, 0.01]]
        assert "across" not in found["container"]
        assert found["container"]["plan"] == []

    @needs_solver
    def test_a_container_that_looks_another_from_its_end_is_drawn_from_there_too(self):
        state = WatchState()
        state.take_container(LyingCylinder(radius=0.05, length=0.2, fill_height=0.04))
        drawn = frame(state, 0.0)["container"]
        assert max(x for x, _ in drawn["outline"]) == 0.1
        assert max(y for y, _ in drawn["across"]) == 0.05

    @needs_solver
    def test_a_prism_is_drawn_from_above(self):
        state = WatchState()
        tray = Tray(width=0.2, depth=0.12, corner_radius=0.03, fill_height=0.04, rim_height=0.07)
        state.take_container(tray)
        state.take_comparison(compared(0.0, measured=0.012, estimated=0.005), 0.0)
        drawn = frame(state, 0.0)["container"]
        assert np.abs(np.array(drawn["plan"])).max(axis=0).tolist() == [0.1, 0.06]
        assert drawn["outline"] == [[0.0, -0.04], [0.1, -0.04], [0.1, 0.03]]

    def test_a_late_camera_does_not_begin_a_new_drawing_a_played_loop_does(self):
        state = WatchState()
        state.take_comparison(compared(10.0), 0.0)
        drawing = frame(state, 0.0)["drawing"]
        state.take_comparison(compared(9.0), 0.1)
        assert frame(state, 0.1)["drawing"] == drawing
        state.take_comparison(compared(0.0), 0.2)
        found = frame(state, 0.2)
        assert found["drawing"] == drawing + 1
        assert found["rows"] == [[0.0, 0.004, 0.005, None, None, None]]

    def test_the_fused_height_is_drawn_with_its_band_and_calm_is_shown_while_it_is_said(self):
        state = WatchState()
        state.take_fused(Fused(START_NS - 5_000_000, 0.003, 0.0005))
        state.take_comparison(compared(0.0), 0.0)
        state.take_calm(CalmNews(False, 2, 0.004, 0.001, 3.5), 0.0)
        found = frame(state, 0.1)
        assert found["rows"][0][3:] == [0.003, 0.002, 0.004]
        assert found["calm"]["wait"] == 3.5
        assert frame(state, 100.0)["calm"] == {}
        state.take_comparison(compared(1.0), 1.0)
        assert frame(state, 1.0)["rows"][0][3:] == [None, None, None]

    def test_an_excess_is_shown_until_it_ends_or_the_monitor_starts_anew(self):
        state = WatchState()
        state.take_comparison(compared(0.0), 0.0)
        state.take_event(event(1, 0))
        found = frame(state, 0.1)
        assert (found["verdict"], found["reason"]) == ("limit exceeded", "measured height 20.1 mm")
        state.take_event(event(1, 1))
        assert frame(state, 0.1)["verdict"] == "safe"
        state.take_event(event(2, 0))
        state.take_parameters("monitor", {"measured_limit": 0.02})
        assert frame(state, 0.1)["verdict"] == "safe"

    def test_the_worst_container_of_a_tray_is_named_and_two_excesses_end_one_by_one(self):
        state = WatchState()
        facts = {"worst container": "far", "container far": "9.0 mm, limit 10.0 mm"}
        state.take_report(NodeReport("monitor", OK, "", facts), 0.0)
        assert json.loads(state.frame(0.1))["reason"].endswith(
            "; worst container far: 9.0 mm, limit 10.0 mm"
        )
        for number in (1, 2):
            state.take_event(LimitNews(1, number, 0, 1, 0.02, f"container c{number}: above"))
        state.take_event(LimitNews(2, 1, 1, 1, 0.02, "container c1: back"))
        state.take_comparison(compared(0.1), 0.1)
        shown = json.loads(state.frame(0.2))
        assert (shown["verdict"], shown["reason"]) == ("limit exceeded", "container c2: above")

    def test_a_flood_of_names_of_nodes_leaves_those_of_the_cell(self):
        state = WatchState()
        for number in range(20_000):
            state.take_report(NodeReport(f"stranger_{number}", OK, "well", {}), 0.0)
        state.take_report(NodeReport("camera", OK, "measuring", {}), 0.0)
        text = state.frame(0.0)
        assert len(text) < 10_000
        assert '"camera"' in text

    def test_the_limit_that_holds_is_shown_and_named(self):
        """If the rim is lower than the limit, the rim is the limit in effect."""
        state = WatchState()
        told = {"measured_limit": 0.02, "estimated_limit": 0.008, "disagreement_limit": 0.01}
        state.take_parameters("monitor", told)
        state.take_parameters("monitor", {**told, "rim": 0.0123}, goes_on=True)
        assert frame(state, 0.0)["limits"] == {
            "measured": {"height": 0.0123, "name": "rim"},
            "estimated": {"height": 0.008, "name": "limit"},
            "disagreement": {"height": 0.01, "name": "limit"},
        }

    def test_the_command_is_shown_to_whoever_sees_the_sides_disagree(self):
        state = WatchState("slosh discover bag")
        state.take_parameters("monitor", {"disagreement_limit": 0.01})
        state.take_comparison(compared(0.0, measured=0.02, estimated=0.005), 0.0)
        assert frame(state, 0.0)["command"] == "slosh discover bag"
        other = WatchState("slosh discover bag")
        other.take_comparison(compared(0.0), 0.0)
        assert frame(other, 0.0)["command"] == ""
        facts = {"motions that disagree": "2"}
        third = WatchState("slosh discover bag")
        third.take_report(NodeReport("monitor", ERROR, "", facts), 0.0)
        assert frame(third, 0.0)["command"] == "slosh discover bag"

    def test_a_line_of_thousands_of_points_is_thinned(self):
        state = WatchState()
        many = [0.001 * k for k in range(5000)]
        state.take_surface(Surface(START_NS, 0.004, 0.1, many, many, 0))
        assert len(frame(state, 0.0)["surface"]["line"]) < 130


@pytest.mark.parametrize(
    ("heights", "exceeded", "begins"),
    [
        ([0.0, 0.0, 0.001, 0.004, 0.02, 0.015], 4, 4),
        ([0.0, 0.0, 0.001, 0.004, 0.01, 0.003], None, 3),
        ([0.0, 0.0002, -0.0003, 0.0], None, 0),
        ([], None, 0),
    ],
)
def test_a_recording_begins_where_a_limit_is_exceeded_or_the_liquid_moves(
    heights, exceeded, begins
):
    verdicts = ["limit exceeded" if k == exceeded else "safe" for k in range(len(heights))]
    frames = [
        json.dumps({"verdict": verdict, "rows": [[0.1 * k, height, None]]})
        for k, (verdict, height) in enumerate(zip(verdicts, heights, strict=True))
    ]
    assert first_happening(frames) == begins
