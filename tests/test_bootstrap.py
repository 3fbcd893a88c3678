"""Tests `make setup`: the Python that it chooses, and paths with special characters."""

import os
import re
import shlex
import subprocess
import sys
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

import bootstrap
import pytest
from packaging.specifiers import SpecifierSet

FOLDER = "Käse it's mine"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """Creates an empty checkout in a folder whose name has special characters."""
    root = tmp_path / FOLDER
    monkeypatch.setattr(bootstrap, "ROOT", root)
    monkeypatch.setattr(bootstrap, "VENV", root / ".venv")
    monkeypatch.setattr(bootstrap, "WORKSPACE", root / "ros2_ws")
    (root / ".venv/bin").mkdir(parents=True)
    (root / ".venv/lib/python3.11/site-packages").mkdir(parents=True)
    (root / "ros2_ws/install").mkdir(parents=True)
    return root


def make_venv(folder):
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    return folder / "bin"


def test_an_environment_on_path_makes_no_difference(tmp_path, monkeypatch):
    """Its own `.venv/bin` least of all: setup would clear it each time."""
    monkeypatch.delenv("SLOSH_PYTHON", raising=False)
    python = bootstrap.base_interpreter(sys.executable)
    # What runs the tests is an environment itself.
    base = Path(python.path)
    monkeypatch.setenv("PATH", str(base.parent), prepend=os.pathsep)
    without = bootstrap.find_python()
    monkeypatch.setenv("PATH", str(make_venv(tmp_path / FOLDER)), prepend=os.pathsep)
    assert bootstrap.find_python() == without
    assert not str(without).startswith(str(tmp_path))
    assert bootstrap.environment_inputs(without)[0].startswith(str(without).encode())


def test_what_was_on_path_before_stays_out_but_for_this_checkouts_own(place):
    own = f"{place}/.venv/bin"
    after = f"{place}/ros2_ws/install/bin:{own}:/usr/bin"
    new = f"{place}/ros2_ws/install/bin:{own}"
    assert bootstrap.new_entries(after, "/usr/bin") == new
    assert bootstrap.new_entries(after, f"{own}:/usr/bin") == new


def test_the_environments_file_is_read_by_a_shell(place, monkeypatch):
    packages = f"{place}/ros2_ws/build/one:{place}/ros2_ws/build/two"
    sourced = {
        "PATH": f"{place}/.venv/bin:/usr/bin:/bin",
        "PYTHONPATH": packages,
        "AMENT_PREFIX_PATH": f"{place}/ros2_ws/install",
    }
    monkeypatch.setattr(bootstrap, "sourced", lambda script, environment: sourced)
    monkeypatch.setenv("PATH", "/usr/bin:/bin")
    bootstrap.write_environment({})
    script = (
        f'. {shlex.quote(f"{place}/.venv/environment.sh")}; printf "%s\\n" "$PATH" "$PYTHONPATH"'
    )
    done = subprocess.run(["sh", "-c", script], env={"PATH": "/usr/bin"}, capture_output=True)
    assert done.stdout.decode().splitlines() == [f"{place}/.venv/bin:/usr/bin", packages]
    (pth,) = place.rglob("slosh_workspace.pth")
    assert pth.read_text("utf-8").splitlines() == packages.split(":")


def test_a_workspace_that_cannot_be_sourced_is_told(place, monkeypatch):
    monkeypatch.setattr(bootstrap, "sourced", lambda *_: {"AMENT_PREFIX_PATH": f"{place}/.venv"})
    with pytest.raises(bootstrap.BootstrapError, match="does not add the workspace"):
        bootstrap.write_environment({})


def test_cmake_files_get_the_paths_of_this_environment(place, monkeypatch):
    cmake = place / ".venv/share/one.cmake"
    cmake.parent.mkdir()
    cmake.write_text(
        'set(x "/opt/python/cp311-cp311/include/python3.11;'
        '/tmp/build/lib/site-packages/numpy/core/include")\n'
    )
    numpy = f"{place}/.venv/lib/python3.11/site-packages/numpy/_core/include"
    found = subprocess.CompletedProcess([], 0, f"/usr/include/python3.11\n{numpy}\n")
    monkeypatch.setattr("bootstrap.subprocess.run", lambda *_, **__: found)
    bootstrap.mend_wheels()
    assert cmake.read_text() == f'set(x "/usr/include/python3.11;{numpy}")\n'


@pytest.mark.parametrize("sign", list(':;"$`'))
def test_a_path_that_no_shell_takes_is_refused_in_a_line(place, monkeypatch, sign):
    monkeypatch.setattr(bootstrap, "ROOT", place / f"a{sign}b")
    with pytest.raises(bootstrap.BootstrapError, match="cannot be set up; move") as refused:
        bootstrap.check_place()
    assert repr(sign) in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_path_with_a_blank_an_umlaut_and_a_quote_is_taken(place):
    bootstrap.check_place()
    assert not bootstrap.PLAIN.fullmatch(str(place))
    assert bootstrap.PLAIN.fullmatch("/home/me/slosh-1.0/.venv")


def test_extras_are_installed_once_and_a_failure_is_one_line(place, monkeypatch, capsys):
    """`make test` has what it can get; the next one asks again only for what failed."""
    (place / ".venv/.environment").write_text("digest")
    installed = []

    def run(command):
        name = Path(command[-1]).stem
        installed.append(name)
        if name == "moto":
            raise bootstrap.BootstrapError("`pip` failed:\nERROR: No matching distribution\nmore")

    monkeypatch.setattr(bootstrap, "run", run)
    monkeypatch.setattr(bootstrap, "to_bytecode", lambda folders: None)
    monkeypatch.setattr(bootstrap, "ROS", place / "no ros")
    for expected in (list(bootstrap.EXTRAS), ["moto"]):
        installed.clear()
        bootstrap.install_extras()
        assert installed == expected
        assert capsys.readouterr().err.splitlines() == [
            "setup: requirements/moto.txt could not be installed, its tests are skipped: "
            "No matching distribution"
        ]


def test_only_tests_and_measurements_pay_for_the_extras():
    """A user's `make demo` downloads nothing that only tests use."""
    text = (bootstrap.REQUIREMENTS.parent / "Makefile").read_text()
    needs = dict(re.findall(r"^([\w-]+): (setup|test-setup)$", text, re.MULTILINE))
    paying = {target for target, needed in needs.items() if needed == "test-setup"}
    assert paying == {"test", "test-all", "validation", "coverage", "bench"}
    assert needs["demo"] == "setup"
    recipe = re.search(r"^test-setup:\n\t(.*)$", text, re.MULTILINE)
    assert recipe is not None
    assert recipe[1].endswith("bootstrap.py --tests")


def test_what_is_installed_takes_the_oldest_python_of_each_system():
    """Debian 12 has Python 3.11.2, Ubuntu 24.04 has 3.12.3."""
    for pinned in bootstrap.ROOT.glob("requirements/*.txt"):
        for line in pinned.read_text().splitlines():
            name = line.partition("==")[0].strip()
            if "==" not in line:
                continue
            try:
                needs = SpecifierSet(str(metadata(name).json.get("requires_python", "")))
            except PackageNotFoundError:  # of an extra
                continue
            assert needs.contains("3.11.2"), line
            assert needs.contains("3.12.3"), line
