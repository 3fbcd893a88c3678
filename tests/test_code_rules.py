"""Tests that `make lint` passes, and that each of its rules rejects a planted violation."""

import ast
import os
import re
import shutil
import subprocess
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
RECIPE = re.search(r"^lint: setup\n((?:\t.+\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)
COMMANDS = re.findall(r"^\t@tools/run (.+)$", RECIPE[1], re.MULTILINE)
FORMAT, STYLE, COMPILED, IMPORTS, TYPES = COMMANDS
# The types take a minute: `make test-all` and `make lint` check them.
QUICK = [pytest.param(c, marks=pytest.mark.long if c == TYPES else ()) for c in COMMANDS]
# Where a rule looks, and what it refuses there.
CORE = "src/slosh_model/slosh_model/core.py"
FINE = '"""Of a test."""\n'
PLANTED = {
    "a line that is not formatted": (FORMAT, CORE, "number = 'one'\n"),
    "a name that is not used": (STYLE, CORE, "import os\n"),
    "ROS in a core": (STYLE, CORE, "import rclpy\n\nrclpy.init()\n"),
    "a second way to compile": (COMPILED, CORE, "from numba import njit\n"),
    "a test that compiles": (COMPILED, "tests/test_a.py", "from numba import njit\n"),
}
UPWARDS = {
    "Packages import those below them": ("slosh_model/containers.py", "slosh_bag.reader"),
    "The core works without add-ons": ("slosh_bringup/processes.py", "slosh_governor.core"),
    "The camera's rooms import those below them": (
        "slosh_camera/optics/__init__.py",
        "slosh_camera.detection",
    ),
    "A bag library knows no sloshing: what records needs base and messages alone": (
        "slosh_bag/errors.py",
        "slosh_model.constants",
    ),
    "Files and compiled code know nothing of each other": (
        "slosh_base/files/new_file.py",
        "slosh_base.compiled",
    ),
    "A bag is read in one place, below export and playing": (
        "slosh_bag/mcap_files/checksum.py",
        "slosh_bag.reader",
    ),
    "Inputs of a recording are above inputs, these above their checks": (
        "slosh_motion/checks/constancy.py",
        "slosh_motion.inputs.gate",
    ),
    "A replay is above what a recording holds": (
        "slosh_replay/recording/heights.py",
        "slosh_replay.replay",
    ),
    "The command line is above all, a live run above replay and nodes": (
        "slosh_bringup/cell/__init__.py",
        "slosh_bringup.cli",
    ),
}
"""By the contract that it breaks: a module, and what it must not import."""
PROGRAM = r"chromium|google-chrome|povray|mosquitto"
OTHER_WAY = re.compile(
    r"LiveBrowser\(|find_browser|^import headless_browser|find_mosquitto|\bBroker\(|"
    rf"import .*\bBroker\b|which\(\s*[\"'](?:{PROGRAM})[\"']|\[\s*[\"'](?:{PROGRAM})[\"']",
    re.MULTILINE,
)
"""What starts a browser, a broker or a ray tracer without the fixtures of `conftest.py`."""


def run(command, folder, **variables):
    """Runs a rule's command in a folder; skips the test if the tool is not installed."""
    tool = "mypy" if command == TYPES else command.split()[0]
    if shutil.which(tool) is None:
        pytest.skip(f"{tool} is not in this environment: requirements/development.txt has it")
    environment = {**os.environ, "NO_COLOR": "1", **variables}
    return subprocess.run(
        command.split(), cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def rules(folder):
    """Copies the configuration of the rules to a temporary folder."""
    (folder / "tools").mkdir()
    for name in ("pyproject.toml", "tools/compiled_code.toml", "tools/typecheck.py"):
        shutil.copy(ROOT / name, folder / name)
    return folder


def plant(folder, name, text):
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(FINE + "\n" + text)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("command", QUICK, ids=lambda command: command.split()[0])
def test_the_code_keeps_the_rule(command):
    done = run(command, ROOT)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("planted", PLANTED)
def test_ruff_refuses(tmp_path, planted):
    command, name, text = PLANTED[planted]
    folder = rules(tmp_path)
    plant(folder, name, "number = 1\n")
    fine = run(command, folder)
    assert fine.returncode == 0, fine.stdout + fine.stderr
    plant(folder, name, text)
    done = run(command, folder)
    assert done.returncode == 1
    assert name in done.stdout


def test_import_linter_refuses_each_import_upwards(tmp_path):
    folder = rules(tmp_path)
    for package in ROOT.glob("*/slosh*/setup.py"):
        name = package.parent.name
        for path in (package.parent / name).rglob("*.py"):
            copy = folder / path.relative_to(package.parent)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, copy)
    for module, imported in UPWARDS.values():
        assert (folder / module).exists()
        with (folder / module).open("a") as file:
            file.write(f"import {imported}\n")
    done = run(IMPORTS, folder, PYTHONPATH=str(folder))
    assert done.returncode == 1
    for contract, (module, imported) in UPWARDS.items():
        importer = module.removesuffix("/__init__.py").removesuffix(".py").replace("/", ".")
        assert f"{contract} BROKEN" in done.stdout
        assert re.search(
            rf"-\s+{re.escape(importer)} -> {re.escape(imported)} \(l\.\d+\)", done.stdout
        )


def other_ways(text):
    """Returns what a test's source starts without a fixture that skips where it is missing."""
    tracing = [
        node.name
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef)
        and "render.Renderer(" in ast.unparse(node)
        and "ray_tracer" not in ast.unparse(node)
    ]
    return [*OTHER_WAY.findall(text), *tracing]


def test_browser_broker_and_ray_tracer_have_one_way():
    files = [*ROOT.glob("*/slosh*/test/**/*.py"), *ROOT.glob("tests/**/*.py")]
    files += ROOT.glob("validation/**/test_*.py")
    found = {
        str(path.relative_to(ROOT)): ways
        for path in files
        if path != Path(__file__) and (ways := other_ways(path.read_text(encoding="utf-8")))
    }
    assert found == {}


@pytest.mark.parametrize(
    "planted",
    [
        "with LiveBrowser() as browser:\n    pass\n",
        "import headless_browser\n",
        "from slosh_testing.plc import Broker, free_port\n",
        'shutil.which("povray")\n',
        'subprocess.run(["mosquitto", "-v"])\n',
        "def test_a(scenes):\n    scenes.render.Renderer(scene, folder)\n",
    ],
)
def test_another_way_to_a_program_is_refused(planted):
    assert other_ways(planted)


@pytest.mark.long
def test_mypy_refuses_a_wrong_type(tmp_path):
    folder = rules(tmp_path)
    (folder / "src/slosh_model").mkdir(parents=True)
    (folder / "src/slosh_model/setup.py").touch()
    plant(folder, CORE, "number: int = 1\n")
    assert run(TYPES, folder).returncode == 0
    plant(folder, CORE, "number: int = 'one'\n")
    done = run(TYPES, folder)
    assert done.returncode == 1
    assert "Incompatible types in assignment" in done.stdout


@pytest.mark.parametrize("path", sorted(ROOT.glob("*/slosh_*/slosh_*/**/tuning.py")), ids=str)
def test_every_tuning_number_is_used(path):
    names = set(re.findall(r"^    (\w+): .*= number\(", path.read_text(), re.MULTILINE))
    room = ".".join(path.relative_to(ROOT).with_suffix("").parts[2:])
    used = set()
    for module in ROOT.glob("*/slosh_*/slosh_*/**/*.py"):
        text = module.read_text()
        bound = re.search(rf"^from {room} import TUNING(?: as (\w+))?$", text, re.MULTILINE)
        if bound:
            used |= set(re.findall(rf"\b{bound[1] or 'TUNING'}\.(\w+)", text))
    assert used == names


def given_twice(text):
    """Returns the names that a module gives to two values, of which the first is lost."""
    given = []
    for node in ast.parse(text).body:
        if isinstance(node, ast.ClassDef):
            given.append(node.name)
        elif isinstance(node, ast.FunctionDef):
            given += (
                []
                if any("overload" in ast.unparse(d) for d in node.decorator_list)
                else [node.name]
            )
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            inner = [one for target in targets for one in ast.walk(target)]
            given += [
                one.id
                for one in inner
                if isinstance(one, ast.Name) and isinstance(one.ctx, ast.Store)
            ]
    return {name for name, count in Counter(given).items() if count > 1}


def test_no_module_gives_a_name_twice():
    modules = [*ROOT.glob("src/slosh*/slosh*/**/*.py"), *ROOT.glob("addons/slosh*/slosh*/**/*.py")]
    assert {path: names for path in modules if (names := given_twice(path.read_text()))} == {}


@pytest.mark.parametrize(
    "planted",
    ["A = 1\nA = 2\n", "A, B = 1, 2\nC, B = 3, 4\n", "A: int = 1\n\n\ndef A():\n    pass\n"],
)
def test_a_name_that_is_given_twice_is_refused(planted):
    assert given_twice(planted)
