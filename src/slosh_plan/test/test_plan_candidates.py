"""Tests what plans are compared with, and their check at the end by their rows alone."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slosh_model import Cylinder, Model
from slosh_model.motion_profiles import quintic
from slosh_plan.planning import optimise
from slosh_plan.planning import plan as planner
from slosh_plan.planning.checked import Checker, checked
from slosh_plan.planning.final_check import Kept, broken
from slosh_plan.planning.given_law import GIVEN, KINEMATIC, GivenLaw, all_laws
from slosh_plan.planning.known_laws import fastest, known_laws, shortest
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.optimise import PathSearch, PathSolution
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, plan

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
LINE = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))
CORNER = path_through(np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0], [0.3, 0.2, 0.1]]))
LIMITS = PlanLimits(0.015, 0.002)
needs_casadi = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)


def shaped():
    """Returns times and places of two strokes, half a period of the liquid apart."""
    lag = np.pi / CUP.mode_constants()[0].natural_frequency
    t = np.arange(0.0, 0.6 + lag, 1e-3)
    place = 0.15 * sum(quintic(np.clip((t - late) / 0.6, 0.0, 1.0))[0] for late in (0.0, lag))
    return t, np.outer(place, [1.0, 0.0, 0.0])


def test_a_given_timing_that_leaves_no_wave_is_kept_where_no_law_is_as_fast():
    t, place = shaped()
    limits = replace(LIMITS, height=0.02, residual=1e-3)
    usual = plan(CUP, path_through(place), limits, time_limit=0.0)
    answer = plan(CUP, path_through(place, times=t), limits, time_limit=0.0)
    assert answer.method == GIVEN
    assert answer.found.motion.duration < 0.95 * usual.found.motion.duration


def test_a_given_timing_is_slowed_evenly():
    t, place = shaped()
    path = path_through(place, times=t)
    motion = GivenLaw(path).motion(2.0)
    at = np.interp(t / t[-1] * 2.0, motion.t, motion.position[:, 0])
    assert at == pytest.approx(place[:, 0], abs=1e-4)
    assert broken(motion, path, LIMITS, None, []) == ""


@pytest.mark.parametrize(
    "times", [[0.0, 1.0, 0.5], [0.0, 1.0, np.inf], [0.0, 1e-3, 1.0]], ids=["back", "inf", "fast"]
)
def test_times_that_are_no_motion_are_no_candidate(times):
    points = np.array([[0.0, 0.0, 0.0], [0.29, 0.0, 0.0], [0.3, 0.0, 0.0]])
    assert GIVEN not in all_laws(path_through(points, times=np.array(times)), LIMITS, 0.0)


@needs_casadi
@pytest.mark.parametrize("path", [LINE, CORNER], ids=["line", "corner"])
def test_the_kinematic_law_is_the_fastest_without_a_liquid(path):
    laws = all_laws(path, LIMITS, 10.0)
    least = {name: shortest(law.motion, LIMITS) for name, law in laws.items()}
    assert min(least, key=least.get) == KINEMATIC
    motion = laws[KINEMATIC].motion(1.01 * least[KINEMATIC])
    assert (
        broken(laws[KINEMATIC].motion(round(1.05 * motion.duration, 3)), path, LIMITS, None, [])
        == ""
    )


@pytest.mark.parametrize(
    ("seed", "name"),
    [
        *((seed, "quintic") for seed in (17, 18, 20, 34, 36)),
        *((seed, "S-curve") for seed in (30, 32)),
        *((seed, "steady, 15 % ramps") for seed in (6, 9)),
    ],
)
def test_a_narrow_range_of_durations_in_which_waves_cancel_is_found(seed, name):
    """Tests laws of which longer motions are unsafe again, by a scan of all durations."""
    random = np.random.default_rng(seed)
    size, fill = random.uniform(0.025, 0.05), random.uniform(0.04, 0.08)
    height = random.choice([0.005, 0.01, 0.02])
    limits = PlanLimits(height, height * random.choice([0.03, 0.1, 0.3]))
    way = path_through(np.array([[0.0, 0.0, 0.0], [random.uniform(0.1, 0.5), 0.0, 0.0]]))
    check = Checker(Model(Cylinder(size, fill)).spatial().nonlinear())
    make = known_laws(way)[name].motion
    found = fastest(check, make, limits).motion.duration
    scanned = np.arange(np.ceil(500.0 * shortest(make, limits)) / 500.0, found, 2e-3)
    all_of_them = check([make(one, 1e-3) for one in scanned.round(3).tolist()])
    least = next((one.motion.duration for one in all_of_them if one.keeps(limits)), found)
    assert found <= 1.006 * least


@given(size=st.floats(1.0, 20.0), rate=st.floats(5.0, 20.0), phase=st.floats(0.0, np.pi))
def test_the_shortest_safe_duration_is_found_however_narrow_its_range_is(size, rate, phase):
    """Tests waves |cos(rate T + phase)| that fall with the square of the duration T."""

    def over(duration):
        return size * abs(np.cos(rate * duration + phase)) / duration**2 - 1.0

    def told(motion):
        excess = over(motion.duration)
        return SimpleNamespace(
            motion=motion, excess=lambda _: {"residual": excess}, keeps=lambda _: excess <= 0.0
        )

    def check(motions):
        return [told(one) for one in motions]

    check.glance = check  # type: ignore[attr-defined]
    make = known_laws(LINE)["quintic"].motion
    rows = np.arange(np.ceil(1e3 * shortest(make, LIMITS)), 20_000)
    least = next(row for row in rows if over(1e-3 * row) <= 0.0) / 1e3
    found = fastest(check, make, LIMITS).motion.duration
    assert found == pytest.approx(least, rel=0.006)


@needs_casadi
def test_a_search_that_did_not_end_at_rest_is_not_an_answer(monkeypatch):
    solve = PathSearch.solve

    def torn(self, *given):
        legs = solve(self, *given).legs
        for leg in legs:
            leg.controls[-15:] = 0.0
        return PathSolution(legs, converged=False, status="ended")

    monkeypatch.setattr(PathSearch, "solve", torn)
    answer = plan(CUP, LINE, replace(LIMITS, height=0.1, residual=0.1))
    assert answer.method == answer.scaled.law
    assert KINEMATIC not in answer.laws
    assert broken(answer.found.motion, LINE, LIMITS, None, []) == ""


@pytest.fixture(scope="module")
def planned():
    return plan(CUP, CORNER, LIMITS, time_limit=0.0)


def faulty(motion, fault):
    """Returns a motion with a fault."""
    place, change = motion.position.copy(), motion.acceleration.copy()
    if fault == "shifted":
        place += [0.0, 1e-3, 0.0]
    elif fault == "short":
        place[:] = place[0] + 0.99 * (place - place[0])
    elif fault == "jump":
        place[len(place) // 2 :] += [1e-5, 0.0, 0.0]
    elif fault == "end":
        change[-1] = [0.1, 0.0, 0.0]
    elif fault == "moving":
        place += np.outer(np.clip(motion.t - motion.duration + 0.1, 0.0, 1.0), [0.01, 0, 0])
    elif fault == "rows":
        return replace(motion, t=1.1 * motion.t)
    elif fault == "nan":
        change[5] = np.nan
    return replace(motion, position=place, acceleration=change)


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("none", ""),
        ("shifted", "begins 1.00 mm from"),
        ("short", "ends 3."),
        ("jump", "accelerations differ from its places"),
        ("end", "not at rest"),
        ("moving", "mm/s at its ends"),
        ("rows", "1 ms apart"),
        ("nan", "not finite"),
    ],
)
def test_what_the_rows_of_a_motion_do_not_keep_is_told(planned, fault, words):
    found = broken(faulty(planned.found.motion, fault), CORNER, LIMITS, None, [])
    assert words in found
    assert bool(found) == (fault != "none")


@pytest.mark.parametrize("name", ["acceleration", "jerk", "height", "residual"])
def test_a_motion_above_a_limit_is_told(planned, name):
    (found,) = checked(CUP, [planned.found.motion], None)
    used = {"height": found.peak}.get(name) or getattr(found, name)
    lower = replace(LIMITS, **{name: 0.99 * used})
    kept = [Kept(CUP, lower)]
    assert broken(planned.found.motion, CORNER, LIMITS, None, [Kept(CUP, LIMITS)]) == ""
    words = broken(planned.found.motion, CORNER, lower, None, kept)
    assert ("above the limit" in words) or ("the limit" in words and "mm" in words)


def test_an_answer_that_fails_the_last_check_is_not_given(monkeypatch):
    monkeypatch.setattr(planner, "broken", lambda *_: "it fails")
    with pytest.raises(NoSafeMotionError, match="failed its last check: it fails"):
        plan(CUP, LINE, LIMITS, time_limit=0.0)


@needs_casadi
def test_where_the_searched_motion_fails_it_the_slowed_law_is_given(monkeypatch):
    told = iter(["it fails", ""])
    monkeypatch.setattr(planner, "broken", lambda *_: next(told))
    answer = plan(CUP, LINE, LIMITS, time_limit=5.0)
    assert answer.method == answer.scaled.law
    assert answer.reason == "the searched motion was refused: it fails"
    assert not answer.legs
