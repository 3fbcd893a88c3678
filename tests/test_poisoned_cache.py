"""Tests that wrong compiled code in the cache is found before it computes a height."""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest

import slosh_estimator
import slosh_model
from slosh_base.compiled.compile_cache import cache_folder
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


# What they load first of what computes heights.
FIRST = ("slosh_model.kernel.advance_many", "slosh_estimator.estimate_kernel.step")


@pytest.fixture(scope="module")
def poisoned(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copies the packages with a cache that holds wrong code of one effect."""
    folder = tmp_path_factory.mktemp("poisoned")
    for package in PACKAGES:
        shutil.copytree(package, folder / package.name)
    # What the set-up compiled serves here too: equal code has equal names.
    shutil.copytree(cache_folder(), folder / "cache" / "slosh")
    (folder / "motion.csv").write_text(MOTION)
    effect = folder / "slosh_model" / "effects" / "gravity_tilt.py"
    kept, text = effect.stat(), effect.read_text()
    right = code_files(folder)
    effect.write_text(text.replace(RIGHT, WRONG))
    assert effect.read_text() != text
    wrong = code_files(folder, "one._checks.clear(); one.load()")
    effect.write_text(text)
    os.utime(effect, ns=(kept.st_atime_ns, kept.st_mtime_ns))
    for name in FIRST:
        assert wrong[name] != right[name]
        wrong[name].replace(right[name])
    return folder


def code_files(folder: Path, work: str = "pass") -> dict[str, Path]:
    """Returns the cache files of each compiled function, after some work with the cache."""
    program = f"""
import slosh_estimator.estimator, slosh_base.compiled.compilation
for one in slosh_base.compiled.compilation.entry_points():
    if one.name in {FIRST}:
        {work}
        print(one.name, one._file().path)
"""
    done = run(folder, "cache", "-c", program)
    assert done.returncode == 0, done.stderr
    return {name: Path(path) for name, path in map(str.split, done.stdout.splitlines())}


def run(folder: Path, cache: str, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs Python with the copied packages."""
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


@pytest.mark.long
@pytest.mark.parametrize("name", list(PROGRAMS))
def test_a_process_that_computes_heights_refuses_to(poisoned: Path, name: str) -> None:
    done = run(poisoned, "cache", *PROGRAMS[name])
    assert done.returncode == 2, done.stdout + done.stderr
    (line,) = [line for line in done.stderr.splitlines() if "self-test" in line]
    assert "delete that folder and start again" in line
    assert str(poisoned / "cache") in line
    assert "Traceback" not in done.stderr
    assert not (poisoned / "response.csv").exists()
