"""Tests that every benchmark runs at its smallest size, without a look at its times."""

import os
import re
import subprocess
import sys
from pathlib import Path

import bench_bag_reading
import bench_export
import bench_replay
import numpy as np
import pytest

from slosh_bag.definitions import Definitions

FOLDER = Path(__file__).resolve().parents[1] / "benchmarks"
FILES = sorted(FOLDER.glob("bench_*.py"))
QUICK = {"bench_observer", "bench_shapes"}
"""Those of a few seconds, which `make test` runs; the others' imports and messages are below."""
MISSING = re.compile(
    r"bench_\w+: needs \w+, which is not installed: .* -r requirements/\w+\.txt\n"
)


def run(words, **variables):
    return subprocess.run(
        [sys.executable, *map(str, words)],
        cwd=FOLDER, env={**os.environ, **variables}, capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "path",
    [pytest.param(one, marks=() if one.stem in QUICK else pytest.mark.long) for one in FILES],
    ids=lambda path: path.stem,
)
def test_it_runs_at_its_smallest_size(path):
    """Exit code 1 is a missed goal: at this size, on a busy machine, it says nothing."""
    done = run([path, "--smallest"])
    if done.returncode == 2 and MISSING.fullmatch(done.stderr):
        pytest.skip(done.stderr.strip())
    assert done.returncode in (0, 1), done.stderr
    assert "Traceback" not in done.stdout + done.stderr, done.stderr
    assert done.stdout


def test_every_benchmark_can_be_imported():
    done = run(["-c", f"import {', '.join(path.stem for path in FILES)}"])
    assert done.returncode == 0, done.stderr


def test_messages_have_all_fields_of_today():
    definitions, rng = Definitions(), np.random.default_rng(0)
    for kind in {*bench_bag_reading.TOPICS.values(), *bench_replay.TYPES.values()}:
        definitions.hash(kind)
    for kind in bench_bag_reading.TOPICS.values():
        message = bench_bag_reading.filled(definitions.typestore, kind, 10**18, rng)
        assert message.header.stamp.sec == 10**9
    for data in bench_export.serialised(definitions, 1):
        assert len(data) > 50
    packer = bench_replay.Packer(definitions)
    stamps = np.array([10**18, 10**18 + 7])
    for topic in set(bench_replay.TYPES) - {"/slosh/settings"}:
        assert [at for at, _, _ in packer.pack(topic, stamps, 0, {})] == stamps.tolist()
    assert len(packer.settings()) == len(bench_replay.PARAMETERS)


@pytest.mark.parametrize(
    ("name", "module", "file"),
    [("bench_fleet", "duckdb", "fleet"), ("bench_governor", "pinocchio", "joints")],
)
def test_what_is_missing_is_told_in_one_line(name, module, file):
    hide = (
        "import importlib.util, runpy, sys\n"
        f"found = importlib.util.find_spec\n"
        f"importlib.util.find_spec = lambda n, *a: None if n == {module!r} else found(n, *a)\n"
        f"sys.argv = [{name + '.py'!r}, '--smallest']\n"
        f"runpy.run_path({name + '.py'!r}, run_name='__main__')\n"
    )
    done = run(["-c", hide], PYTHONPATH=f"{FOLDER}:{os.environ.get('PYTHONPATH', '')}")
    assert done.returncode == 2, done.stderr
    assert MISSING.fullmatch(done.stderr), done.stderr
    assert f"needs {module}," in done.stderr
    assert done.stderr.endswith(f"requirements/{file}.txt\n")
