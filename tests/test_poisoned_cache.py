"""Compiled code that is not the program's is found before a height is computed from it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

import slosh_estimator
import slosh_model
from slosh_bringup.processes import config_folder

PACKAGES = [Path(str(module.__file__)).parent for module in (slosh_model, slosh_estimator)]
MODEL = config_folder() / "model.yaml"
MOTION = "t,ax,ay,az\n0,0,0,0\n0.01,1,0,0\n0.02,1,0,0\n"
RIGHT, WRONG = "gx = fx + 2.0 *", "gx = fx - 2.0 *"
PATIENCE = 240.0
pytestmark = pytest.mark.timeout(3 * PATIENCE)

# What each kind of process does; all of them compute heights.
PROGRAMS: Mapping[str, tuple[str, ...]] = {
    "estimator": (
        "-m", "slosh_estimator.nodes.estimator_node", "--ros-args", "-p", f"model:={MODEL}",
    ),
    "simulate": (
        "-m", "slosh_bringup.cli", "simulate", str(MODEL), "motion.csv", "-o", "response.csv",
    ),
    "replay": ("-m", "slosh_bringup.cli", "replay", str(Path(__file__).parents[1] / "bags/cut")),
}  # fmt: skip


@pytest.fixture(scope="module")
def poisoned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copies of the packages, whose cache holds code of one effect with a wrong sign."""
    folder = tmp_path_factory.mktemp("poisoned")
    for package in PACKAGES:
        shutil.copytree(package, folder / package.name)
    (folder / "motion.csv").write_text(MOTION)
    effect = folder / "slosh_model" / "effects" / "gravity_tilt.py"
    kept, text = effect.stat(), effect.read_text()
    fill(folder, "cache")
    effect.write_text(text.replace(RIGHT, WRONG))
    assert effect.read_text() != text
    fill(folder, "wrong", checked=False)
    effect.write_text(text)
    os.utime(effect, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    wrong = {name_of(file): file for file in (folder / "wrong").rglob("*.code")}
    for file in (folder / "cache").rglob("*.code"):
        shutil.copyfile(wrong[name_of(file)], file)
    return folder


def name_of(file: Path) -> str:
    """The function's name, without the digest of its code."""
    return file.name.rsplit("_", 1)[0]


def fill(folder: Path, cache: str, *, checked: bool = True) -> None:
    """Compiles all functions of the copies."""
    program = "import slosh_estimator.estimator, slosh_model.compilation as c\n"
    if not checked:
        program += "[o._checks.clear() for o in c.entry_points()]\n"
    done = run(folder, cache, "-c", program + "c.load_all()")
    assert done.returncode == 0, done.stderr


def run(folder: Path, cache: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Python with the copies in place of the packages."""
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    surroundings = {"PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / cache)}
    return subprocess.run(
        [sys.executable, *words],
        env={**os.environ, **surroundings},
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )


@pytest.mark.parametrize("name", list(PROGRAMS))
def test_a_process_that_computes_heights_refuses_to(poisoned: Path, name: str) -> None:
    done = run(poisoned, "cache", *PROGRAMS[name])
    assert done.returncode == 2, done.stdout + done.stderr
    (line,) = [line for line in done.stderr.splitlines() if "self-test" in line]
    assert "delete that folder and start again" in line
    assert str(poisoned / "cache") in line
    assert "Traceback" not in done.stderr
    assert not (poisoned / "response.csv").exists()
