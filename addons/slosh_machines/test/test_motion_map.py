"""Tests motion maps: time laws, random speeds, and the controller's program as executed."""

import csv
import re

import numpy as np
import pytest
from scipy.integrate import trapezoid

from slosh_machines.design import NamedLaw, Stroke, designed, heights
from slosh_machines.motion_map import motion_map
from slosh_machines.profile import COUNT, Profile
from slosh_machines.structured_text import structured_text, table_text
from slosh_model import Cylinder, Inputs, Model, simulate
from slosh_model.motion_profiles import LAWS
from slosh_plan import SloshPlanError
from slosh_plan.planning.limits import PlanLimits

MODEL = Model(Cylinder(0.05, 0.07))
CUP = MODEL.spatial().nonlinear()
STROKE = Stroke(0.1, 0.4)
LIMITS = PlanLimits(0.012, 0.002)


@pytest.fixture(scope="module")
def found():
    """Returns the motion map of a cup for 30 to 60 cycles a minute, which ends earlier."""
    return motion_map(CUP, STROKE, [30.0, 34.0, 38.0, 42.0, 50.0, 60.0], LIMITS)


def test_a_law_is_the_double_integral_of_its_acceleration():
    weights = np.random.default_rng(1).normal(size=COUNT)
    law = Profile(weights)
    u = np.linspace(0.0, 1.0, 20001)
    speed = np.concatenate(
        [[0.0], np.cumsum(0.5 * np.diff(u) * (law.acceleration(u)[1:] + law.acceleration(u)[:-1]))]
    )
    place = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(u) * (speed[1:] + speed[:-1]))])
    assert law.position(u) == pytest.approx(place, abs=1e-7 * np.abs(place).max())
    parts = law.coefficients()
    for number, part in enumerate(parts):
        v = np.linspace(0.0, 1.0, 7)
        there = np.polynomial.polynomial.polyval(v, part)
        assert there == pytest.approx(law.position((number + v) / len(parts)), abs=1e-12)


def test_the_design_leaves_no_linear_wave_and_ends_at_rest():
    model = MODEL.spatial()
    law = designed(model, STROKE, 40.0, PlanLimits(0.02, 0.01), None)
    assert law.position(np.array([0.0, 1.0])) == pytest.approx([0.0, 1.0], abs=1e-9)
    inputs = STROKE.inputs(law, 40.0, 1.0)
    speed = trapezoid(inputs.acceleration[:, 0], inputs.t)
    assert speed == pytest.approx(0.0, abs=1e-4)
    msh = simulate(model, inputs)[0].msh
    left = msh[inputs.t > STROKE.duration(40.0)].max()
    assert left < 0.01 * msh.max()


def test_the_design_is_lower_than_any_known_law(found):
    """Also than TM20's four laws at the same stroke and time."""
    for row in found.rows:
        others = [heights(CUP, STROKE, NamedLaw(name), row.speed).peak for name in LAWS]
        assert row.found.peak < min(others)


def test_every_speed_of_the_map_keeps_the_limits(found):
    """Speeds that nobody looked at, over many cycles, at twice the rate."""
    rng = np.random.default_rng(7)
    for speed in rng.uniform(found.rows[0].speed, found.rows[-1].speed, 40):
        law = found.profile(float(speed))
        cycle, duration = STROKE.cycle(speed), STROKE.duration(speed)
        t = np.arange(0.0, 30.0, duration / 800.0)
        u = np.mod(t, cycle) / duration
        acceleration = STROKE.length / duration**2 * law.acceleration(u)
        msh = simulate(CUP, Inputs(t, np.outer(acceleration, [1.0, 0.0, 0.0])))[0].msh
        assert msh.max() <= 1.002 * LIMITS.height
        assert msh[u > 1.0].max() <= 1.002 * LIMITS.residual
        assert np.abs(acceleration).max() <= LIMITS.acceleration
        assert np.abs(np.diff(acceleration)).max() / t[1] <= LIMITS.jerk


def test_the_map_ends_below_the_first_unsafe_speed(found):
    last = found.rows[-1].speed
    assert 40.0 < last < 60.0
    assert "of 12 mm" in found.reason
    above = designed(CUP, STROKE, last + 0.2, LIMITS, found.rows[-1].profile)
    assert heights(CUP, STROKE, above, last + 0.2).excess(LIMITS) > 0.0
    with pytest.raises(SloshPlanError, match="outside the map"):
        found.profile(last + 0.2)
    with pytest.raises(SloshPlanError, match=r"needs more than 9\.5 m/s² or 74 m/s³"):
        motion_map(CUP, STROKE, [80.0, 90.0], LIMITS)


def program(text):
    """Translates the function block to a Python function of speed and time."""
    text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
    constants = re.search(r"VAR CONSTANT(.*?)END_VAR", text, re.DOTALL).group(1)
    fixed = {}
    for name, value in re.findall(r"(\w+) : [^:]*?:= (\[.*?\]|[^;]*);", constants, re.DOTALL):
        fixed[name] = eval(value)
    body = text[text.rindex("END_VAR") + 7 : text.index("END_FUNCTION_BLOCK")]
    lines, depth = [], 0
    for raw in body.strip().splitlines():
        line = raw.strip().replace(":=", "=").replace(" AND ", " and ")
        line = re.sub(r"FOR (\w+) = (\d+) TO 0 BY -1 DO", r"for \1 in range(\2, -1, -1):", line)
        line = re.sub(r"WHILE (.*) DO", r"while \1:", line)
        line = re.sub(r"IF (.*) THEN", r"if \1:", line)
        if line.startswith("END_"):
            depth -= 1
            continue
        lines.append("    " * depth + line.rstrip(";"))
        depth += line.endswith(":")

    def limit(low, value, high):
        return max(low, min(value, high))

    code = compile("\n".join(lines), "stroke.st", "exec")

    def run(speed, time):
        names = {
            **fixed,
            "LIMIT": limit,
            "TRUNC": int,
            "DINT_TO_LREAL": float,
            "Speed": speed,
            "Elapsed": time,
        }
        exec(code, names)
        return names

    return run


def test_the_controllers_program_gives_the_laws(found):
    run = program(structured_text(found))
    rng = np.random.default_rng(3)
    low, high = found.rows[0].speed, found.rows[-1].speed
    for speed in [low, high, *rng.uniform(low, high, 20).tolist()]:
        law, duration = found.profile(speed), STROKE.duration(speed)
        for u in [0.0, 1.0, 1.7, *rng.uniform(0.0, 1.0, 10).tolist()]:
            told = run(speed, u * duration)
            at = np.array([u])
            assert told["Valid"]
            assert told["Position"] == pytest.approx(
                STROKE.length * law.position(at)[0], abs=1e-12
            )
            expected = STROKE.length / duration**2 * law.acceleration(at)[0]
            assert told["Acceleration"] == pytest.approx(expected, abs=1e-8)
    step = 1e-6
    ahead, behind = (run(low, 0.3 + sign * step)["Position"] for sign in (1.0, -1.0))
    assert run(low, 0.3)["Velocity"] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6)
    assert not run(low - 0.1, 0.1)["Valid"]
    assert not run(high + 0.1, 0.1)["Valid"]


def test_the_table_holds_the_same_coefficients(found):
    head, *rows = csv.reader(line for line in table_text(found).splitlines() if line[0] != "#")
    assert head == ["speed", "segment", *(f"c{n}" for n in range(8))]
    first = found.rows[0].profile.coefficients()
    assert np.array(rows[: len(first)], float)[:, 2:] == pytest.approx(STROKE.length * first)
    assert len(rows) == len(found.rows) * len(first)
