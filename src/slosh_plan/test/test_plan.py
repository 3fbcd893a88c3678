import sys
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slosh_model import Cylinder, Model, Rectangle
from slosh_model.covariance import Covariance
from slosh_plan.errors import SloshPlanError
from slosh_plan.planning import optimise
from slosh_plan.planning.checked import checked
from slosh_plan.planning.known_laws import UNIT_LAWS, best_scaled, known_laws
from slosh_plan.planning.limits import PlanLimits
from slosh_plan.planning.paces import PACES, Pace, PacedLeg
from slosh_plan.planning.path import path_through
from slosh_plan.planning.plan import NoSafeMotionError, Plan, plan
from slosh_plan.planning.progress import StoppedError, Watch

GRAVITY = 9.81
CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
TANK = Model(Rectangle(0.08, 0.06, 0.07)).spatial().nonlinear()
LIMITS = PlanLimits(0.015, 0.002, 9.5, 74.0)
LINE = np.array([[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]])
needs_casadi = pytest.mark.skipif(not optimise.available(), reason="CasADi is not installed")


def random_path(seed):
    """Some waypoints in a box of half a metre that do not turn sharply."""
    generator = np.random.default_rng(seed)
    while True:
        steps = generator.normal(size=(generator.integers(2, 6), 3)) * [0.12, 0.12, 0.05]
        points = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
        directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
        if (np.einsum("ij,ij->i", directions[:-1], directions[1:]) > 0.6).all():
            return points


def heights_of_dl22(motion, after=2.5):
    """MSH by eqs. (11), (14), (24) of DL22 and SciPy's DOP853, at 1 kHz [m]."""
    r, h, alpha, xi = 0.05, 0.07, 0.58, 1.8411837813406593
    depth = np.tanh(xi * h / r)
    omega = np.sqrt(GRAVITY * xi / r * depth)
    viscous = 0.92 * np.sqrt(1e-6 / np.sqrt(GRAVITY * r**3))
    k = 1.84 * h / r
    zeta = viscous * (1.0 + 0.318 / np.sinh(k) * (1.0 + (1.0 - h / r) / np.cosh(k)))
    gain = xi**2 * h / r * 2.0 * r * depth / (xi * h * (xi**2 - 1.0))
    c2 = (omega**2 * r / GRAVITY) ** 2
    t = np.arange(round((motion.duration + after) * 1000) + 1) / 1000
    a = np.zeros((len(t), 3))
    a[: len(motion.t)] = motion.acceleration

    def rate(now, state):
        row = min(int(now * 1000), len(t) - 2)
        felt = a[row] + (now * 1000 - row) * (a[row + 1] - a[row])
        q, v = state[:2], state[2:]
        bar = q / r
        force = -2.0 * zeta * omega * v - omega**2 * (1.0 + felt[2] / GRAVITY) * q - felt[:2]
        radial = 2.0 * zeta * omega * c2 * bar @ v + c2 * v @ v / r
        radial += omega**2 * alpha * bar @ bar * r
        return [*v, *np.linalg.solve(np.eye(2) + c2 * np.outer(bar, bar), force - radial * bar)]

    found = solve_ivp(
        rate, (0.0, t[-1]), np.zeros(4), "DOP853", t, rtol=1e-8, atol=1e-10, max_step=0.01
    )
    return gain * np.hypot(found.y[0], found.y[1])


def check_by_itself(answer: Plan, points, limits=LIMITS):
    """What a plan promises, without the product's simulation."""
    motion = answer.found.motion
    assert np.allclose(np.diff(motion.t), 1e-3, atol=1e-12)
    sizes = np.linalg.norm(motion.acceleration, axis=1)
    assert sizes.max() <= limits.acceleration * (1.0 + 1e-9)
    steps = np.linalg.norm(np.diff(motion.acceleration, axis=0), axis=1)
    assert steps.max() / 1e-3 <= limits.jerk * (1.0 + 1e-9)
    assert (motion.acceleration[[0, -1]] == 0.0).all()
    # The accelerations lead along the positions, and to rest.
    between = 0.5 * (motion.acceleration[1:] + motion.acceleration[:-1])
    speed = np.concatenate([np.zeros((1, 3)), np.cumsum(between, axis=0) * 1e-3])
    way = speed[:-1] * 1e-3 + 1e-6 * (
        motion.acceleration[:-1] / 3.0 + motion.acceleration[1:] / 6.0
    )
    assert np.abs(speed[-1]).max() < 2e-3
    places = motion.position[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(way, axis=0)])
    assert np.abs(places - motion.position).max() < 1e-3
    for point in points:
        assert distance(point, motion.position) < 1e-4
    assert motion.position[0] == pytest.approx(points[0], abs=1e-6)
    assert motion.position[-1] == pytest.approx(points[-1], abs=1e-6)


def distance(point, places):
    """From a point to the line through places [m]."""
    starts, steps = places[:-1], np.diff(places, axis=0)
    squares = np.maximum((steps**2).sum(axis=1), 1e-30)
    share = np.clip(((point - starts) * steps).sum(axis=1) / squares, 0.0, 1.0)
    return np.linalg.norm(starts + share[:, None] * steps - point, axis=1).min()


def check_heights(answer: Plan, limits=LIMITS):
    heights = heights_of_dl22(answer.found.motion)
    # The two integrators agree to a thousandth of a limit.
    assert heights.max() <= limits.height * 1.001
    assert heights[len(answer.found.motion.t) - 1 :].max() <= limits.residual * 1.001
    assert heights.max() == pytest.approx(answer.found.peak, rel=1e-3)


@pytest.fixture(scope="module")
def line():
    """The optimal motion along a line."""
    return plan(CUP, path_through(LINE), LIMITS)


@needs_casadi
def test_a_line_is_run_as_fast_as_the_liquid_allows(line):
    answer = line
    assert answer.method == "optimal"
    assert answer.reason == ""
    assert answer.found.motion.duration < 0.84
    assert answer.found.motion.duration < 0.85 * answer.scaled.found.motion.duration
    check_by_itself(answer, LINE)
    check_heights(answer)


@needs_casadi
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_random_paths_keep_the_limits_by_another_integrator(seed):
    points = random_path(seed)
    answer = plan(CUP, path_through(points), LIMITS, time_limit=10.0)
    check_by_itself(answer, points)
    check_heights(answer)


@needs_casadi
@pytest.mark.long
@pytest.mark.timeout(7200)
@pytest.mark.parametrize("height", [0.005, 0.015, 0.025])
def test_two_hundred_random_paths(height):
    limits = replace(LIMITS, height=height)
    for seed in range(100, 167):
        points = random_path(seed)
        answer = plan(CUP, path_through(points), limits)
        check_by_itself(answer, points, limits)
        check_heights(answer, limits)


@needs_casadi
def test_a_path_back_along_itself_turns_without_a_stop_of_the_acceleration():
    there = np.column_stack([np.linspace(0.0, 0.3, 40), np.zeros((40, 2))])
    points = np.concatenate([there, there[-2::-1]])
    path = path_through(points)
    assert path.reversals == (True,)
    answer = plan(CUP, path, LIMITS)
    check_by_itself(answer, points)
    motion = answer.found.motion
    turn = int(np.argmax(motion.position[:, 0]))
    assert abs(motion.acceleration[turn, 0]) > 1.0


@needs_casadi
def test_a_rectangle_that_stands_turned_keeps_the_limit_in_its_corner():
    half = np.array([0.0, 0.0, np.sin(0.3), np.cos(0.3)])
    limits = PlanLimits(0.012, 0.003, 5.0, 60.0)
    answer = plan(TANK, path_through(LINE), limits, attitude=half)
    assert answer.method == "optimal"
    check_by_itself(answer, LINE, limits)
    again = checked(TANK, [answer.found.motion], half)[0]
    assert again.peak <= limits.height
    # Not turned the same motion makes another wave.
    assert checked(TANK, [answer.found.motion], None)[0].peak != pytest.approx(again.peak, 1e-3)


@needs_casadi
def test_the_whole_model_is_checked_not_its_first_mode_alone(line):
    whole = CUP.with_effect("second_mode", damping_ratio=0.01)
    answer = plan(whole, path_through(LINE), LIMITS)
    assert checked(whole, [answer.found.motion], None)[0].keeps(LIMITS)
    assert answer.found.motion.duration != line.found.motion.duration


def test_a_margin_lowers_the_heights():
    answer = plan(CUP, path_through(LINE), LIMITS, margin=0.0005, time_limit=0.0)
    assert answer.found.peak <= 0.0145
    assert answer.found.residual <= 0.0015


def test_a_covariance_gives_an_interval_that_is_wider_than_the_answer():
    unsure = replace(CUP, damping_ratio=0.006, natural_frequency=19.0)
    known = plan(unsure, path_through(LINE), LIMITS, time_limit=0.0)
    assert known.upper is None
    covariance = Covariance(("natural_frequency",), ((0.05**2,),))
    answer = plan(
        replace(unsure, covariance=covariance), path_through(LINE), LIMITS, time_limit=0.0
    )
    assert answer.found.motion.duration == known.found.motion.duration
    peak, residual = answer.upper
    assert 1.0 < peak / answer.found.peak < 1.2
    assert residual > answer.found.residual


def test_without_casadi_a_known_law_is_scaled(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    monkeypatch.setattr(optimise, "available", lambda: False)
    answer = plan(CUP, path_through(LINE), LIMITS)
    assert answer.method == answer.scaled.law
    assert "requirements/plan.txt" in answer.reason
    check_by_itself(answer, LINE)
    check_heights(answer)


def test_when_the_time_is_up_the_safe_motion_is_the_answer():
    answer = plan(CUP, path_through(LINE), LIMITS, time_limit=0.0)
    assert answer.method in UNIT_LAWS
    assert "time was up" in answer.reason or "not installed" in answer.reason
    check_heights(answer)


def test_an_impossible_limit_is_no_motion():
    with pytest.raises(NoSafeMotionError, match="no motion of up to 120 s"):
        plan(CUP, path_through(LINE), replace(LIMITS, acceleration=1e-5))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"height": 0.0}, "height = 0 m"),
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


def test_a_tilted_container_is_refused():
    with pytest.raises(SloshPlanError, match=r"tilted by 11\.5°"):
        plan(CUP, path_through(LINE), LIMITS, attitude=np.array([0.1, 0.0, 0.0, 0.995]))


def test_the_scan_finds_the_fastest_that_is_safe():
    path = path_through(LINE)
    found = best_scaled(CUP, path, LIMITS)
    assert found is not None
    duration = found.found.motion.duration
    for known in known_laws(path).values():
        faster = [known.motion(round(duration * s, 3)) for s in (0.85, 0.93)]
        assert not any(one.keeps(LIMITS) for one in checked(CUP, faster, None))


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


def test_a_plan_that_is_stopped_at_once_is_no_motion():
    with pytest.raises(StoppedError, match="before there was a safe motion"):
        plan(
            CUP,
            path_through(LINE),
            replace(LIMITS, height=1e-4),
            watch=Watch(stopped=lambda: True),
        )


def test_a_curved_path_is_slower_where_it_bends():
    """An ellipse at the two-thirds power law is gone through harmonically."""
    angle = np.linspace(0.0, 1.5 * np.pi, 400)
    ellipse = np.column_stack([0.2 * np.cos(angle), 0.1 * np.sin(angle), np.zeros(400)])
    path = path_through(ellipse)
    harmonic = PacedLeg(path.legs[0], Pace(1.0 / 3.0, 0.0))
    places = path.legs[0].at(harmonic.splines[0](angle / angle[-1]))[0]
    assert np.abs(places - ellipse).max() < 2e-4
    names = list(known_laws(path))
    assert len(names) == 3 * len(known_laws(path_through(LINE)))
    best = best_scaled(CUP, path, LIMITS)
    assert best.law.endswith("in curves")


@pytest.mark.parametrize("name", PACES)
def test_a_paced_law_is_a_motion_whose_columns_are_derivatives(name):
    leg = path_through(random_path(1)).legs[0]
    u = np.linspace(0.0, 1.0, 20_001)
    s, v, a = PacedLeg(leg, PACES[name]).along(*UNIT_LAWS["septic"](u))
    assert s[[0, -1]] == pytest.approx([0.0, leg.length], abs=1e-9)
    assert np.gradient(s, u)[1:-1] == pytest.approx(v[1:-1], abs=1e-4)
    assert np.gradient(v, u)[1:-1] == pytest.approx(a[1:-1], abs=0.05)
