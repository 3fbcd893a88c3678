"""Tests that the core works, is tested and keeps its import rules where no add-on is installed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from slosh_base.addons import add_ons
from slosh_model.model_text import format_model, parse_model
from slosh_testing.mode_solver import needs_solver

ROOT = Path(__file__).resolve().parent.parent
HIDING = ROOT / "tools" / "core_alone"
ADD_ONS = sorted(path.parent.name for path in ROOT.glob("addons/*/setup.py"))
SPHERE = "container: {shape: sphere, radius: 0.05, fill_height: 0.05}\n"
FOUND = """
import sys
from importlib.util import find_spec
from slosh_base.addons import add_ons
print([find_spec(name) for name in sys.argv[1:]], add_ons())
"""
CONTRACT = "[[tool.importlinter.contracts]]"
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command()"
TESTS = ("test_addons", "test_cell_liquid", "test_command_line", "test_parameter_file")


def alone(*words, folder=ROOT, module="slosh_bringup.cli", code=""):
    """Runs a module, or code, where add-ons are hidden, and what it starts, too."""
    what = ["-c", code] if code else ["-m", module]
    path = os.pathsep.join([str(HIDING), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, *what, *map(str, words)], cwd=folder, capture_output=True, text=True,
        check=False, env={**os.environ, "PYTHONPATH": path}, timeout=280,
    )  # fmt: skip


def test_all_add_ons_are_hidden():
    assert len(ADD_ONS) == len(add_ons()) == 5
    done = alone(*ADD_ONS, code=FOUND)
    assert done.stdout == f"{[None] * len(ADD_ONS)} ()\n", done.stderr


def test_the_command_has_what_the_core_brings():
    done = alone("--help")
    assert (done.returncode, done.stderr) == (0, "")
    assert "\n  demo " in done.stdout
    assert "\n  plc " not in done.stdout
    names = alone("node", "--help").stdout
    assert "estimator" in names
    assert "governor" not in names
    assert alone("demo", "--governor").returncode == 2


@needs_solver
def test_stored_modes_suffice_and_others_are_refused_with_the_remedy(tmp_path):
    (tmp_path / "sphere.yaml").write_text(SPHERE)
    (tmp_path / "stored.yaml").write_text(format_model(parse_model(SPHERE)))
    (tmp_path / "motion.csv").write_text("t,ax,ay,az\n0,0,0,0\n0.1,1,0,0\n0.2,0,0,0\n")
    done = alone("modes", "sphere.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert re.fullmatch(r"slosh modes: sphere.yaml: .*add-on slosh_shapes.*\n", done.stderr)
    done = alone("modes", "stored.yaml", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "2.7845 Hz" in done.stdout
    done = alone("simulate", "stored.yaml", "motion.csv", "-o", "heights.csv", folder=tmp_path)
    assert done.returncode == 0, done.stderr


def test_a_cell_file_with_a_key_of_an_add_on_is_refused_with_the_reason(tmp_path):
    (tmp_path / "cell.yaml").write_text("model: model.yaml\ngovern: twist\n")
    done = alone("cell", "--config", "cell.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert "unknown key 'govern'" in done.stderr
    assert "others need their add-on" in done.stderr


def test_a_shipped_recording_is_replayed_bit_for_bit(tmp_path):
    done = alone("replay", ROOT / "bags" / "l", "--check", "-o", tmp_path)
    assert done.returncode == 0, done.stderr
    assert "3233 bit for bit  as expected" in done.stdout


def test_the_import_rules_hold_without_add_ons(tmp_path):
    one = "|".join(ADD_ONS)
    rules = re.sub(rf'"(?:{one})(?: \| (?:{one}))*", ?', "", (ROOT / "pyproject.toml").read_text())
    parts = rules.split(CONTRACT)
    own = [part for part in parts if "The core works without add-ons" not in part]
    assert len(own) == len(parts) - 1
    (tmp_path / "pyproject.toml").write_text(CONTRACT.join(own))
    done = alone("--no-logo", "--no-cache", folder=tmp_path, code=LINT)
    assert f"{len(own) - 1} kept, 0 broken" in done.stdout, done.stdout + done.stderr


@pytest.mark.long
def test_all_tests_of_the_core_can_be_loaded():
    done = alone("src", "--collect-only", "-q", "-p", "no:cacheprovider", module="pytest")
    assert done.returncode == 0, done.stdout[-3000:]


@pytest.mark.long
def test_a_part_of_the_tests_of_the_core_passes():
    own = [ROOT / "src/slosh_bringup/test" / f"{name}.py" for name in TESTS]
    done = alone(*own, "-q", "-p", "no:cacheprovider", "-p", "no:xdist", module="pytest")
    assert done.returncode == 0, done.stdout[-3000:]
