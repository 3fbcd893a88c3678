"""Tests that a package brings a command and a node of its own, and that the core needs none."""

import os
import subprocess
import sys

from slosh_bringup.processes import known_nodes

HELLO = """
from slosh_base.addons import AddOn, Command

ADDON = AddOn({"hello": Command("start", "say hello", "hello.command")}, {"hi": "hello.node"})
"""
COMMAND = """
def add_arguments(parser):
    parser.add_argument("--name", default="liquid")


def run(arguments):
    print("hello", arguments.name)
    return 1
"""


def installed(folder, name, files):
    """Writes a package as pip would: its modules and its entry point."""
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    facts = folder / f"{name}-1.0.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n")
    (facts / "entry_points.txt").write_text(f"[slosh.addons]\n{name} = {name}.addon:ADDON\n")


def slosh(folder, *words):
    """Runs the command with a folder of packages before the others."""
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "slosh_bringup.cli", *words]
    environment = {**os.environ, "PYTHONPATH": path}
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_an_installed_package_brings_a_command_and_a_node(tmp_path):
    files = {"hello/__init__.py": "", "hello/addon.py": HELLO, "hello/command.py": COMMAND}
    installed(tmp_path, "hello", files)
    done = slosh(tmp_path, "hello", "--name", "milk")
    assert (done.returncode, done.stdout, done.stderr) == (1, "hello milk\n", "")
    assert "  hello " in slosh(tmp_path, "--help").stdout
    assert "hi" not in known_nodes()
    assert " hi, " in slosh(tmp_path, "node", "--help").stdout


def test_one_that_cannot_be_imported_is_left_out_with_a_line(tmp_path):
    installed(tmp_path, "broken", {"broken/addon.py": "import nowhere_at_all\n"})
    done = slosh(tmp_path, "--help")
    assert done.returncode == 0
    assert done.stderr == "slosh: add-on broken left out: No module named 'nowhere_at_all'\n"
