"""Tests a copy of this checkout in a workspace whose path has blanks and umlauts."""

import shutil
import signal
import subprocess
import time
from pathlib import Path

import bootstrap
import pytest
import rclpy

ROOT = Path(__file__).resolve().parents[1]
PATIENCE = 1200.0
"""The messages take a busy machine minutes [s]."""
LEFT_OUT = shutil.ignore_patterns(
    ".*", "__pycache__", "build", "install", "log", "out", "bags", "tests", "_build"
)
pytestmark = [pytest.mark.long, pytest.mark.timeout(PATIENCE)]


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """Builds a workspace behind a link; returns it with its environment before sourcing."""
    folder = tmp_path_factory.mktemp("home")
    shutil.copytree(ROOT, folder / "Wörk späce/src/slosh", symlinks=True, ignore=LEFT_OUT)
    (folder / "lïnk to it").symlink_to(folder / "Wörk späce")
    environment = bootstrap.base_environment()
    # As a user has it, who knows nothing of this checkout's own workspace.
    del environment["COLCON_DEFAULTS_FILE"]
    libraries = environment.get("LD_LIBRARY_PATH", "").split(":")
    others = [path for path in libraries if not Path(path).is_relative_to(bootstrap.WORKSPACE)]
    environment["LD_LIBRARY_PATH"] = ":".join(others)
    flags = ["--cmake-args", "-DBUILD_TESTING=OFF", "-Wno-dev"]
    done = subprocess.run(
        ["colcon", "build", *flags],
        cwd=folder / "lïnk to it",
        env=environment,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    count = len(list(ROOT.glob("*/slosh*/package.xml")))
    assert f"Summary: {count} packages finished" in done.stdout
    return folder / "lïnk to it", environment


def in_workspace(workspace, *words):
    """Returns the command line that runs a command in the sourced workspace."""
    folder, environment = workspace
    script = '. install/setup.bash && exec "$@"'
    return ["bash", "-c", script, "bash", *words], {"cwd": folder, "env": environment}


def test_a_command_runs_with_the_packages_of_the_workspace(workspace):
    words, more = in_workspace(workspace, "slosh", "explain", "gravity_tilt")
    done = subprocess.run(words, capture_output=True, text=True, **more)
    assert (done.returncode, done.stderr) == (0, "")
    assert "gravity_tilt" in done.stdout
    where = "import slosh_bringup; print(slosh_bringup.__file__)"
    words, more = in_workspace(workspace, "python3", "-c", where)
    found = subprocess.run(words, capture_output=True, text=True, check=True, **more).stdout
    assert Path(found).is_relative_to(workspace[0].resolve() / "install/slosh_bringup")


def test_a_node_runs_as_ros2_run_starts_it(workspace, domain):
    program = "install/slosh_estimator/lib/slosh_estimator/monitor"
    words, more = in_workspace(workspace, program)
    assert (workspace[0] / program).read_text().startswith("#!/usr/bin/env python3\n")
    rclpy.init()
    listener = rclpy.create_node("listener")
    try:
        with subprocess.Popen(words, **more) as node:
            deadline = time.monotonic() + 60.0
            while "monitor" not in listener.get_node_names():
                assert node.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.05)
            node.send_signal(signal.SIGINT)
            assert node.wait(60.0) == 0
    finally:
        listener.destroy_node()
        rclpy.shutdown()
