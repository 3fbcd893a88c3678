"""Tests that `slosh explain` shows the effects and messages as terminal text."""

import inspect
import re
from importlib import resources

import pytest

from slosh_bringup.cli import predict, quantities, replay
from slosh_bringup.cli import simulate as simulated
from slosh_bringup.cli.main import main
from slosh_bringup.detect import table as detected
from slosh_bringup.explain.effect import plain_equation
from slosh_bringup.explain.terms import flags
from slosh_bringup.live import run_result
from slosh_bringup.predict import document as predicted
from slosh_camera.measurement import Flag
from slosh_discovery.discovery_report import document as discovered
from slosh_discovery.discovery_report import motions as moved
from slosh_discovery.discovery_report import text as told
from slosh_discovery.force import document as forced
from slosh_discovery.identification_report import document as identified
from slosh_estimator.validity import EstimateFlag
from slosh_fleet.motions import motions_page as fleet
from slosh_fleet.validation import document as validated
from slosh_model.effects.registry import EFFECTS
from slosh_motion.tables.motion_table import ANGULAR_VELOCITY, ATTITUDE, MOTION
from slosh_plan.plan_report import document as planned
from slosh_plan.tables.path_table import PLACES
from slosh_plan.validity import MotionFlag
from slosh_report.page.units import UNITS
from slosh_report.run_report import document as ran
from slosh_report.run_report import index


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
    assert said.startswith("AMBIGUOUS: flag of a measurement (FreeSurface)\none image does")


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
        ("SATURATE", "nearest: SATURATED, frame_saturation, state"),
        ("xyz", "`slosh explain` lists them"),
    ],
)
def test_an_unknown_name_is_one_line_with_the_nearest(name, told, capsys):
    assert main(["explain", name]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"slosh explain: '{name}' is no effect, flag, column, model or unit; {told}"


DOCUMENTS = (
    planned, predicted, discovered, moved, identified, forced, ran, index, validated, fleet,
)  # fmt: skip
HEADING = r'(?:Column|numbers|limited|_number|_text|KeyFigure|_column)\((?:\s|\d|,)*"([^"]+)"'


def page_headings():
    """Returns the headings of the operator's page, except those filled in at run time."""
    text = resources.files("slosh_bringup.watch.page").joinpath("index.html").read_text("utf-8")
    found = re.findall(r"<(?:th|dt)\b[^>]*>(.*?)</(?:th|dt)>", text)
    plain = [re.sub(r"<[^>]+>|{{.*?}}", "", one).strip() for one in found if one]
    yield from (one for one in plain if one)


def printed_heads():
    """Returns the headings of tables and figures of documents, read from their source code."""
    for module in DOCUMENTS:
        yield from re.findall(HEADING, inspect.getsource(module))
    for module in (told, replay, run_result):
        source = inspect.getsource(module)
        tuples = re.findall(
            r"(?:rows: list\[Row\] = \[|heads? = |aligned\(\[)\((.*?)\)\]?\n", source
        )
        yield from (one for found in tuples for one in re.findall(r'"(\w[^"]*)"', found))
        yield from re.findall(r"{'([^']+)':>\d+}", source)


COLUMNS = sorted(
    {
        *simulated.COLUMNS, *detected.COLUMNS, *predict.COLUMNS, *replay.HEADS,
        *MOTION, *ATTITUDE, *ANGULAR_VELOCITY, *PLACES, "eta_045", "clock", *page_headings(),
        *printed_heads(), "MAE 3D-NL", "ε 2D-L", "highest measured", "limit events",
    }
)  # fmt: skip


@pytest.mark.parametrize("name", COLUMNS)
def test_each_column_of_each_table_is_explained(name, capsys):
    assert ": column or figure\n" in explained(name, capsys)
    for unit in re.findall(r"\[([^\]]+)\]$", name):
        assert ": unit\n" in explained(unit, capsys)


@pytest.mark.parametrize(
    "flag",
    [*Flag, *EstimateFlag, *MotionFlag],
    ids=lambda flag: f"{type(flag).__name__}.{flag.name}",
)
def test_each_flag_is_explained_by_name_and_by_number(flag, capsys):
    said = explained(flag.name, capsys)
    assert said.startswith(f"{flag.name}: flag of a")
    meaning = said.splitlines()[1]
    for number in (f"0x{flag.value:x}", f"0x{flag.value:04X}", str(flag.value)):
        assert f"  {flag.name} ({flag.value}): {meaning}" in explained(number, capsys)


def test_a_model_with_further_effects_is_explained(capsys):
    said = explained("3D-NL+second_mode", capsys)
    assert EFFECTS["second_mode"].meaning in said
    assert main(["explain", "3D-NL+seconds"]) == 2


@pytest.mark.parametrize(
    "name",
    sorted(
        {
            *(unit for unit in UNITS if unit),
            *(unit for one in quantities.QUANTITIES for unit in one.units),
            *(one.unit for effect in EFFECTS.values() for one in effect.parameters),
        }
    ),
)  # fmt: skip
def test_each_unit_is_explained(name, capsys):
    assert f"{name}: unit\n" in explained(name, capsys)
