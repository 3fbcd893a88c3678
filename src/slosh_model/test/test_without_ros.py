"""Tests that the model package works without ROS, with only its base package."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGES = [Path(__file__).parents[2] / name for name in ("slosh_base", "slosh_model")]
SCRIPT = """
import sys

class Refused:
    def find_spec(self, name, *_):
        if name.split(".")[0] in ("rclpy", "slosh_msgs", "slosh_msgs_py"):
            raise ImportError(name + " is not installed")

sys.meta_path.insert(0, Refused())
import numpy as np
import slosh_model
from slosh_model import Cylinder, Inputs, Model, simulate

assert slosh_model.__file__.startswith(sys.argv[1]), slosh_model.__file__
t = np.arange(0.0, 0.5, 0.005)
inputs = Inputs(t, np.outer(np.sin(15.0 * t), [2.0, 0.0, 0.0]))
model = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
assert simulate(model, inputs)[0].msh.max() > 0.0
print("done")
"""


@pytest.mark.long
def test_the_models_install_and_run_without_anything_else(tmp_path):
    target = tmp_path / "installed"
    sources = [tmp_path / package.name for package in PACKAGES]
    for package, source in zip(PACKAGES, sources, strict=True):
        shutil.copytree(package, source, ignore=shutil.ignore_patterns("build", "*.egg-info"))
    subprocess.run(
        [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation",
         "--target", str(target), *map(str, sources)],
        check=True,
    )  # fmt: skip
    environment = {**os.environ, "PYTHONPATH": str(target)}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(target)], cwd=tmp_path, env=environment, text=True,
        capture_output=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "done\n"), done.stderr
