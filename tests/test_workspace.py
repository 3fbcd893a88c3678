"""Tests that the workspace has what colcon, rosdep and ros2 launch expect."""

import ast
import functools
import importlib
import importlib.metadata
import os
import re
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest
import yaml
from ament_index_python.packages import get_package_prefix

from slosh_bringup.processes import known_nodes

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = sorted(path.parent for path in ROOT.glob("*/slosh*/package.xml"))
PYTHON = [package for package in PACKAGES if (package / "setup.py").exists()]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text()
LOCKS = ("ros", "runtime", "development")
ORDER = (
    "slosh_base", "slosh_msgs", "slosh_msgs_py", "slosh_model",
    "slosh_camera", "slosh_report", "slosh_bag", "slosh_motion", "slosh_estimator", "slosh_plan",
    "slosh_replay",
    "slosh_discovery", "slosh_bringup", "slosh", "slosh_fleet", "slosh_governor",
    "slosh_machines", "slosh_plc", "slosh_shapes", "slosh_testing",
)  # fmt: skip
"""A package imports those before it alone."""
ROSDEP = {
    "cv2": "python3-opencv", "jinja2": "python3-jinja2", "llvmlite": "python3-numba",
    "markupsafe": "python3-jinja2", "matplotlib": "python3-matplotlib", "numba": "python3-numba",
    "numpy": "python3-numpy", "pytest": "python3-pytest", "rosbags": "python3-rosbags-pip",
    "scipy": "python3-scipy", "tqdm": "python3-tqdm", "uvicorn": "python3-uvicorn",
    "websockets": "python3-websockets", "yaml": "python3-yaml", "launch": "ros2launch",
    "launch_ros": "ros2launch",
}  # fmt: skip
"""Import name to rosdep key; what belongs to ROS has its own name as key."""
WITHOUT_KEY = {"dask", "distributed", "lz4", "mcap", "starlette", "zstandard"}
"""Imports for which rosdep has no key: setup.py and requirements/robot.in name them."""
PIP = {
    "cv2": "opencv-python-headless", "dask": "distributed", "llvmlite": "numba",
    "google": "protobuf", "markupsafe": "jinja2", "yaml": "PyYAML",
}  # fmt: skip
"""Import name to requirement, where it has another."""
UNSEEN = {"slosh_bringup": {"websockets"}}
"""What one of the imported packages imports, and calls optional."""
OPTIONAL = {
    "aiomqtt",
    "argcomplete",
    "asyncua",
    "casadi",
    "cryptography",
    "google",
    "pandas",
    "pymodbus",
}
"""Imported where it is used, and told of where it is missing."""
MESSAGE_TYPE = re.compile(r"(\w+)/(?:msg|srv)/\w+")


def manifest(package):
    return ElementTree.parse(package / "package.xml").getroot()


def scripts(package):
    text = (package / "setup.py").read_text()
    return dict(re.findall(r'"(\w+) = ([\w.]+):main"', text))


def trees(package):
    """Yields the syntax trees of a package's modules and launch files."""
    for folder in (package / package.name, package / "launch"):
        for path in folder.rglob("*.py"):
            yield ast.parse(path.read_text(encoding="utf-8"))


@functools.cache
def imported(package):
    """Returns the foreign modules that a package imports, and the message packages it names."""
    names = set()
    for node in (node for tree in trees(package) for node in ast.walk(tree)):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names.add(node.module.split(".")[0])
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            named = MESSAGE_TYPE.fullmatch(node.value)
            names |= {named[1]} if named else set()
    return names - sys.stdlib_module_names - {package.name} | UNSEEN.get(package.name, set())


def test_all_packages_are_there():
    assert sorted(package.name for package in PACKAGES) == sorted(ORDER)


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_a_package_imports_those_below_it(package):
    assert imported(package) & set(ORDER) <= set(ORDER[: ORDER.index(package.name)])


@pytest.mark.parametrize("package", PACKAGES, ids=lambda path: path.name)
def test_manifest_names_the_package_its_licence_and_its_build(package):
    root = manifest(package)
    assert root.findtext("name") == package.name
    assert root.findtext("license") == "Apache-2.0"
    build = "ament_cmake" if package.name == "slosh_msgs" else "ament_python"
    assert root.findtext("export/build_type") == build


def test_all_packages_have_one_version_and_the_changelog_has_it():
    (version,) = {manifest(package).findtext("version") for package in PACKAGES}
    assert re.search(rf"^## {re.escape(version)} - 20\d\d-\d\d-\d\d$", CHANGELOG, re.MULTILINE)
    assert importlib.metadata.version("slosh_bringup") == version


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_ament_finds_the_package_and_its_programs(package):
    assert (package / "resource" / package.name).is_file()
    assert f"lib/{package.name}" in (package / "setup.cfg").read_text()
    for module in scripts(package).values():
        assert callable(importlib.import_module(module).main)


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_every_module_and_every_template_is_installed(package, monkeypatch):
    """A linked workspace has them anyway; a robot's has what setup.py says."""
    said = setup_keywords(package, monkeypatch)
    root = package / package.name
    folders = {path.parent for path in root.rglob("*.py")}
    names = {".".join(folder.relative_to(package).parts) for folder in folders}
    assert set(said["packages"]) == names
    installed = {
        path
        for name, globs in said["package_data"].items()
        for glob in globs
        for path in (package / name.replace(".", "/")).glob(glob)
    }
    data = {path for path in root.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    assert installed == data - set(root.rglob("*.py"))


def setup_keywords(package, monkeypatch):
    """Returns the arguments of a package's setup.py."""
    said = {}
    monkeypatch.setattr("setuptools.setup", said.update)
    monkeypatch.chdir(package)
    monkeypatch.syspath_prepend(package)
    runpy.run_path("setup.py")
    return said


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_what_is_imported_is_declared_and_nothing_else(package):
    declared = {element.text for element in manifest(package).iter("exec_depend")}
    needed = {ROSDEP.get(name, name) for name in imported(package) - WITHOUT_KEY - OPTIONAL}
    assert (needed - declared, declared - needed) == (set(), set())


def bare(requirements):
    """Returns package names without their versions."""
    return {re.split("[<>=]", line)[0] for line in requirements}


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_what_is_imported_is_required_by_setup(package, monkeypatch):
    """ROS itself comes from its own packages."""
    said = setup_keywords(package, monkeypatch)
    extras = said.get("extras_require", {}).values()
    required = bare(said["install_requires"]).union(*map(bare, extras))
    ours = WITHOUT_KEY | OPTIONAL | {n for n, key in ROSDEP.items() if key.startswith("python3-")}
    assert {PIP.get(name, name) for name in imported(package) & ours} <= required


@pytest.mark.parametrize("package", PYTHON, ids=lambda path: path.name)
def test_programs_take_python_from_path(package):
    """colcon may be another Python's: the system's, where an environment is active."""
    assert (
        "[build_scripts]\nexecutable=/usr/bin/env python3" in (package / "setup.cfg").read_text()
    )
    for name in scripts(package):
        program = Path(get_package_prefix(package.name)) / "lib" / package.name / name
        assert program.read_text().startswith("#!/usr/bin/env python3\n")


def test_every_node_is_a_program_of_its_package():
    """The launch file and `ros2 run` start it by its name."""
    for node, module in known_nodes().items():
        package = next(one for one in PYTHON if one.name == module.partition(".")[0])
        assert scripts(package)[node] == module


def test_the_parameter_file_states_the_defaults():
    """So a file that sets two parameters changes two, and no other comes to lie elsewhere."""
    text = (ROOT / "src/slosh_bringup/config/cell.yaml").read_text()
    for node, content in yaml.safe_load(text)["/**"].items():
        specs = importlib.import_module(known_nodes()[node]).PARAMETERS
        defaults = {spec.name: spec.default for spec in specs}
        stated = content["ros__parameters"]
        assert stated == {name: defaults[name] for name in stated}


def locked(name):
    return (ROOT / "requirements" / f"{name}.txt").read_text().splitlines()[1:]


@pytest.mark.parametrize("name", LOCKS)
def test_every_requirement_has_one_exact_version(name):
    for line in locked(name):
        assert re.fullmatch(r'[\w.-]+==[\w.]+( ; python_version (<|>=) "3\.12")?', line), line


def said(program, environment=None):
    """Runs a program in its own process; returns its output."""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env=environment
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.first(2)
@pytest.mark.parametrize(
    "module",
    [
        "slosh_estimator.nodes.estimator_node",
        "slosh_camera.nodes.camera_node",
        "slosh_bringup.cli.simulate",
    ],
)
def test_a_start_waits_for_no_part_of_scipy(module):
    """They load for a third of a second what a usual model and cup never ask for."""
    program = (
        f"import sys, {module}\n"
        "print([name for name in sys.modules if name in "
        "('scipy.special', 'scipy.spatial', 'scipy.optimize', 'scipy.interpolate')])"
    )
    assert said(program) == "[]\n"


def test_the_recorder_loads_no_compiler():
    program = "import sys, slosh_bag.nodes.recorder_node\nprint('numba' in sys.modules)"
    assert said(program) == "False\n"


def test_kept_code_is_loaded_without_what_it_was_compiled_with():
    """Nor does its check take a part of SciPy: both load longer than all of the code."""
    program = (
        "import sys, slosh_estimator.estimator\n"
        "from slosh_base.compiled.compilation import load_all\n"
        "load_all()\nprint([name for name in sys.modules if name in "
        "('scipy.spatial', 'numba.np.linalg', 'numba.np.arraymath')])"
    )
    said(program)  # so that all of it is kept
    assert said(program) == "[]\n"


@pytest.mark.first(1)
@pytest.mark.parametrize("command", ["cell", "demo", "discover", "identify", "plan", "replay"])
def test_a_mistake_does_not_wait_for_what_draws(command):
    """matplotlib loads for a third of a second; what comes before a page does without."""
    program = f"import sys, slosh_bringup.cli.{command}\nprint('matplotlib' in sys.modules)"
    assert said(program) == "False\n"


@pytest.mark.parametrize(("given", "used"), [({}, "1"), ({"OPENBLAS_NUM_THREADS": "3"}, "3")])
def test_a_command_computes_in_one_thread_unless_told(given, used):
    program = (
        "import os, sys\nfrom slosh_bringup.cli.main import command\n"
        "early = 'numpy' not in sys.modules\nsys.argv = ['slosh', 'explain', 'gravity_tilt']\n"
        "command()\nprint(early, os.environ['OPENBLAS_NUM_THREADS'])"
    )
    environment = {k: v for k, v in os.environ.items() if k != "OPENBLAS_NUM_THREADS"} | given
    assert said(program, environment).splitlines()[-1] == f"True {used}"
