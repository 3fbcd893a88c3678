"""`slosh explain`: what the registry and the messages say, in text that a terminal shows."""

import re

import pytest

from slosh_bringup.cli.main import main
from slosh_bringup.explain.flags import flags
from slosh_bringup.explain.plain_equation import plain_equation
from slosh_camera.measurement import Flag
from slosh_estimator.validity import EstimateFlag
from slosh_model.effects.registry import EFFECTS


def explained(name, capsys):
    assert main(["explain", name]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_is_told_whole_and_without_latex(name, capsys):
    effect, said = EFFECTS[name], explained(name, capsys)
    assert said.startswith(f"{name}: {effect.title}\n{effect.meaning}\n")
    assert not set(said) & set("\\$\0")
    assert "{" not in plain_equation(effect.equation)
    lines = re.findall(r"^parameter +(\w+): .*$", said, re.M)
    assert lines == [parameter.name for parameter in effect.parameters]
    for label in ("acts on", "equation", "source", "containers", "model.yaml", "page"):
        assert len(re.findall(rf"^{re.escape(label)} +\S", said, re.M)) == 1, label


def test_a_parameter_is_told_with_unit_range_and_default(capsys):
    assert "; 0 … 5, default 0.58, usually 0 … 2" in explained("surface_nonlinearity", capsys)
    assert "rad, must be given, 0 has no effect, usually 0 ± 0.04" in explained(
        "static-tilt", capsys
    )
    assert "0 or 1, default 1" in explained("static_tilt", capsys)
    assert "needs       a motion with attitude" in explained("lever_arm", capsys)
    assert "containers  rectangle" in explained("pendulum_nonlinearity", capsys)


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"\omega_n^2 \to k\,\omega_n^2", "ωₙ² → k ωₙ²"),
        (r"\frac{\beta}{R}\lVert\dot q\rVert\,\dot q = 0", "(β/R)‖q̇‖ q̇ = 0"),
        (r"\frac{a + b}{\rho g} - 1", "(a + b)/(ρ g) − 1"),
        (r"\max_{|\varphi-c|\le w/2}\eta(\varphi)", "max_(|φ−c| ≤ w/2) η(φ)"),
        (r"u = (\cos\varphi, \cos^2\theta\,x),\quad v", "u = (cos φ, cos²θ x),   v"),
        (r"a_{\mathrm{command}}^T \new{x}", "a_commandᵀ newx"),
    ],
)
def test_equations_are_readable(latex, text):
    assert plain_equation(latex) == text


def test_flags_are_those_of_the_cores(capsys):
    names = {message: [] for message in ("FreeSurface", "SloshEstimate", "SloshComparison")}
    for flag in flags():
        names[flag.message].append(flag.name)
    for kind, message in ((Flag, "FreeSurface"), (EstimateFlag, "SloshEstimate")):
        assert names[message] == [flag.name for flag in kind]
    assert "BLIND" in names["SloshComparison"]
    said = explained("ambiguous", capsys)
    assert said.startswith("AMBIGUOUS: flag of a measurement (FreeSurface)\nthe image alone does")


def test_alone_it_lists_everything(capsys):
    assert main(["explain"]) == 0
    lines = capsys.readouterr().out.splitlines()
    firsts = [line.split()[0] for line in lines if line]
    assert [name for name in firsts if name in EFFECTS] == list(EFFECTS)
    assert {flag.name for flag in flags()} <= set(firsts)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("tilt", "nearest: gravity_tilt, sensor_tilt, static_tilt"),
        ("swirll", "nearest: swirl_stiffening"),
        ("SATURATE", "nearest: SATURATED, frame_saturation, surface_nonlinearity"),
        ("xyz", "`slosh explain` lists them"),
    ],
)
def test_an_unknown_name_is_one_line_with_the_nearest(name, told, capsys):
    assert main(["explain", name]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"slosh explain: '{name}' is neither an effect nor a flag; {told}"
