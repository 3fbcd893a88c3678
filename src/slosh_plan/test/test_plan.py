import sys
from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Model, Rectangle
from slosh_model.covariance import Covariance
from slosh_plan import ModelError, Trajectory, predict
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning import optimise
from slosh_plan.planning.checked import Checker, checked
from slosh_plan.planning.known_laws import (
    best_scaled,
    known_laws,
)
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, demanded, plan
from slosh_plan.planning.progress import Watch
from slosh_plan.planning.search import OptimalSearch
from slosh_plan.planning.searched_law import SearchedLaw
from slosh_plan.planning.unit_laws import UNIT_LAWS
from slosh_plan.tuning import TUNING

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
TANK = Model(Rectangle(0.08, 0.06, 0.07)).spatial().nonlinear()
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
LINE = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
needs_casadi = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)


@pytest.fixture(scope="module")
def line():
    """Returns the optimal motion along a line."""
    return plan(CUP, path_through(LINE), LIMITS)


@needs_casadi
def test_a_line_is_run_as_fast_as_the_liquid_allows(line, check_plan):
    answer = line
    assert answer.method == "optimal"
    assert answer.reason == ""
    assert answer.found.motion.duration < 0.84
    assert answer.found.motion.duration < 0.85 * answer.scaled.found.motion.duration
    check_plan(answer, LINE, CUP, LIMITS)


@needs_casadi
def test_a_rectangle_that_stands_turned_keeps_the_limit_in_its_corner(check_plan):
    half = np.array([0.0, 0.0, np.sin(0.3), np.cos(0.3)])
    limits = PlanLimits(0.012, 0.003, 5.0, 60.0)
    answer = plan(TANK, path_through(LINE), limits, attitude=half)
    assert answer.method == "optimal"
    check_plan(answer, LINE, TANK, limits, half)
    again = checked(TANK, [answer.found.motion], half)[0]
    assert again.peak <= limits.height
    # Not turned the same motion makes another wave.
    assert checked(TANK, [answer.found.motion], None)[0].peak != pytest.approx(again.peak, 1e-3)


@pytest.mark.long
@needs_casadi
def test_the_whole_model_is_checked_not_its_first_mode_alone(line):
    whole = CUP.with_effect("second_mode", damping_ratio=0.01)
    answer = plan(whole, path_through(LINE), LIMITS)
    assert checked(whole, [answer.found.motion], None)[0].keeps(LIMITS)
    assert answer.found.motion.duration != line.found.motion.duration


def test_a_covariance_gives_an_interval_that_is_wider_than_the_answer():
    unsure = replace(CUP, damping_ratio=0.006, natural_frequency=19.0)
    known = plan(unsure, path_through(LINE), LIMITS, time_limit=0.0)
    assert known.upper is None
    covariance = Covariance(("natural_frequency",), ((0.05**2,),))
    answer = plan(
        replace(unsure, covariance=covariance), path_through(LINE), LIMITS, time_limit=0.0
    )
    assert answer.found.motion.duration >= known.found.motion.duration
    peak, residual = answer.upper
    assert 1.0 < peak / answer.found.peak < 1.2
    assert peak <= LIMITS.height
    assert residual <= LIMITS.residual
    assert residual > answer.found.residual


def test_a_covariance_that_moves_the_wave_out_of_step_costs_time():
    """Tests it by the wave that a motion leaves: |∫ a exp(iωt) dt| of one mode, by quadrature."""
    limits = replace(LIMITS, residual=0.1 * LIMITS.height)
    model = replace(CUP, damping_ratio=0.006, natural_frequency=19.0)
    error = 0.4
    known = plan(model, path_through(LINE), limits, time_limit=0.0)
    motion = known.found.motion
    rates = 19.0 + error * np.array([0.0, -1.0, 1.0])
    turns = np.exp(1j * np.outer(rates, motion.t))
    left = np.abs(turns @ motion.acceleration[:, 0])
    # Two standard errors of the residual height by its difference over as many of the frequency.
    interval = known.found.residual * (1.0 + abs(left[2] - left[1]) / left[0])
    assert known.found.residual <= limits.residual < 0.7 * interval
    covariance = Covariance(("natural_frequency",), ((error**2,),))
    answer = plan(
        replace(model, covariance=covariance), path_through(LINE), limits, time_limit=0.0
    )
    assert answer.found.motion.duration > 1.01 * known.found.motion.duration
    assert max(answer.upper[1], answer.found.residual) <= limits.residual


@pytest.mark.parametrize(
    "time_limit", [0.0, pytest.param(30.0, marks=needs_casadi)], ids=["known law", "optimal"]
)
def test_the_models_error_is_kept_off_the_limits(time_limit):
    """Tests that the upper ends of the intervals keep the limits."""
    error = ModelError(sigma=0.0002, epsilon=0.1)
    answer = plan(CUP, path_through(LINE), LIMITS, error=error, time_limit=time_limit)
    found, motion = answer.found, answer.found.motion
    assert found.upper <= LIMITS.height
    assert found.residual_upper <= LIMITS.residual
    half = np.hypot(2 * 0.0002, 0.1 * found.peak)
    assert found.upper == pytest.approx(found.peak + half, rel=1e-12)
    (told,) = predict(CUP, Trajectory(motion.t, motion.acceleration), horizon=2.5, error=error)
    assert answer.upper == pytest.approx((told.upper, told.residual_upper), rel=1e-3)
    if time_limit:
        # As fast as what is left allows.
        assert found.peak > 0.97 * error.highest(LIMITS.height)


def test_with_an_error_the_covariance_counts_too():
    covariance = Covariance(("natural_frequency",), ((0.05**2,),))
    unsure = replace(CUP, damping_ratio=0.006, natural_frequency=19.0, covariance=covariance)
    limits = replace(LIMITS, residual=0.01)
    answer = plan(unsure, path_through(LINE), limits, error=ModelError())
    assert answer.found.peak < answer.found.upper <= limits.height
    for frequency in (18.9, 19.1):
        other = replace(unsure, natural_frequency=frequency, covariance=None)
        assert checked(other, [answer.found.motion], None)[0].keeps(limits)


def test_an_error_that_leaves_nothing_of_a_limit_is_refused():
    with pytest.raises(SloshPlanError, match=r"3 mm \(2 MAE\), is not below the limit of 2 mm"):
        plan(CUP, path_through(LINE), LIMITS, error=ModelError(sigma=0.0015))


def test_without_casadi_a_known_law_is_scaled(monkeypatch, check_plan):
    monkeypatch.setitem(sys.modules, "casadi", None)
    monkeypatch.setattr(optimise, "available", lambda: False)
    answer = plan(CUP, path_through(LINE), LIMITS)
    assert answer.method == answer.scaled.law
    assert "requirements/plan.txt" in answer.reason
    check_plan(answer, LINE, CUP, LIMITS)


def test_when_the_time_is_up_the_safe_motion_is_the_answer(check_plan):
    answer = plan(CUP, path_through(LINE), LIMITS, time_limit=0.0)
    assert answer.method in UNIT_LAWS
    assert "time was up" in answer.reason or "not installed" in answer.reason
    check_plan(answer, LINE, CUP, LIMITS)


@needs_casadi
def test_a_search_that_cannot_be_repeated_is_repeated_from_a_slower_start(monkeypatch, check_plan):
    solve, begun = optimise.PathSearch.solve, []

    def second_fails(self, limits, guess, *given):
        if not self.layout.liquids:
            return solve(self, limits, guess, *given)
        begun.append(sum(leg.duration for leg in guess))
        if len(begun) > 1:
            return replace(solve(self, limits, guess, *given), converged=len(begun) > 2)
        higher = replace(limits, height=1.1 * limits.height, residual=1.1 * limits.residual)
        return solve(self, higher, guess, *given)

    monkeypatch.setattr(optimise.PathSearch, "solve", second_fails)
    answer = plan(CUP, path_through(LINE), LIMITS)
    assert begun[2] / begun[1] == pytest.approx(TUNING.repeated[1] / TUNING.repeated[0])
    assert (answer.method, answer.reason) == ("optimal", "")
    assert answer.found.motion.duration < 0.9 * answer.scaled.found.motion.duration
    check_plan(answer, LINE, CUP, LIMITS)


def test_an_impossible_limit_is_no_motion():
    with pytest.raises(NoSafeMotionError, match="the limit of the acceleration asks for"):
        plan(CUP, path_through(LINE), replace(LIMITS, acceleration=1e-5))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"height": 0.0}, "height limit = 0.0 m"),
        ({"residual": -1.0}, "residual"),
        ({"jerk": float("nan")}, "jerk = nan"),
        ({"acceleration": float("inf")}, "acceleration = inf"),
    ],
)
def test_limits_that_are_none(changes, text):
    with pytest.raises(SloshPlanError, match=text):
        replace(LIMITS, **changes)


@pytest.mark.parametrize("margin", [-1e-3, 0.002, float("nan")])
def test_margins_that_leave_nothing(margin):
    with pytest.raises(SloshPlanError, match="margin"):
        plan(CUP, path_through(LINE), LIMITS, margin=margin)


def test_the_scan_finds_the_fastest_that_is_safe():
    path = path_through(LINE)
    found = best_scaled(Checker(CUP), LIMITS, known_laws(path))
    assert found is not None
    duration = found.found.motion.duration
    for known in known_laws(path).values():
        faster = [known.motion(round(duration * s, 3)) for s in (0.85, 0.93)]
        assert not any(one.keeps(LIMITS) for one in checked(CUP, faster, None))


@needs_casadi
def test_a_searched_law_is_slowed_evenly(line):
    path, answer = line.path, line
    law = SearchedLaw(path, 0.0, answer.legs)
    assert law.whole
    same, slow = (law.motion(round(s * answer.found.motion.duration, 3)) for s in (1.0, 1.5))
    np.testing.assert_allclose(same.position, answer.found.motion.position, atol=1e-9)
    ratio = (same.duration / slow.duration) ** 2
    assert np.abs(slow.acceleration).max() == pytest.approx(
        ratio * np.abs(same.acceleration).max(), rel=1e-2
    )
    torn = [replace(leg, controls=leg.controls.copy()) for leg in answer.legs]
    torn[-1].controls[-20:] = 0.0
    assert not SearchedLaw(path, 0.0, tuple(torn)).whole


@needs_casadi
def test_a_search_that_is_ended_is_slowed_where_that_is_faster_than_a_known_law(monkeypatch, line):
    path, best = line.path, line
    hasty = tuple(leg.slowed(0.97) for leg in best.legs)
    monkeypatch.setattr(OptimalSearch, "_starts", lambda _: iter(()))
    check, kept, nominal, yaw = demanded(CUP, path, LIMITS, None, 0.0, None, None)
    search = OptimalSearch(check, path, kept, nominal, yaw, best.scaled, 30.0, Watch(), [hasty])
    found = search.run()
    assert found.law == "result 1 of the search, slowed"
    assert found.motion is not None
    assert found.motion.keeps(LIMITS)
    assert best.found.motion.duration <= found.duration < best.scaled.found.motion.duration


def test_legs_share_the_time_by_their_lengths_or_by_their_limits():
    path = path_through(np.array([[0.0, 0, 0], [0.4, 0, 0], [0.4, 0.1, 0]]))
    laws = known_laws(path, LIMITS)
    first, second = laws["quintic"].durations(1.0), laws["quintic, legs by their limits"]
    assert first == pytest.approx((2 / 3, 1 / 3))
    assert sum(second.durations(1.0)) == pytest.approx(1.0)
    assert second.durations(1.0) != pytest.approx(first, rel=1e-3)


@pytest.mark.parametrize("name", UNIT_LAWS)
def test_a_known_law_leads_from_rest_to_rest_and_its_columns_are_derivatives(name):
    u = np.linspace(0.0, 1.0, 20_001)
    place, rate, change = UNIT_LAWS[name](u)
    assert (place[0], place[-1]) == pytest.approx((0.0, 1.0), abs=1e-12)
    ends = [*rate[[0, -1]], *change[[0, -1]]]
    assert ends == pytest.approx([0.0] * 4, abs=1e-9)
    assert np.gradient(place, u)[1:-1] == pytest.approx(rate[1:-1], abs=1e-5)
    assert np.gradient(rate, u)[1:-1] == pytest.approx(change[1:-1], abs=0.05)


@needs_casadi
def test_who_waits_is_told_how_far_it_is():
    told = []
    answer = plan(CUP, path_through(LINE), LIMITS, watch=Watch(told.append))
    phases = list(dict.fromkeys(one.phase for one in told))
    assert phases == ["known laws", "search 1 of 2", "search 2 of 2"]
    durations = [one.duration for one in told]
    assert durations[0] == np.inf
    assert durations == sorted(durations, reverse=True)
    assert durations[-1] == answer.found.motion.duration
    assert [one.elapsed for one in told] == sorted(one.elapsed for one in told)
    # In every iteration of a search.
    assert sum(one.phase == "search 1 of 2" for one in told) > 10


@needs_casadi
def test_who_stops_a_search_gets_what_is_safe_so_far():
    told = []
    watch = Watch(told.append, stopped=lambda: told[-1].phase == "search 1 of 2")
    answer = plan(CUP, path_through(LINE), LIMITS, watch=watch)
    assert answer.method in UNIT_LAWS
    assert "stopped" in answer.reason
    assert sum(one.phase == "search 1 of 2" for one in told) < 10
