"""Tests that processes share cached code and use it only if it is complete and their own."""

import hashlib
import json
import os
import pickle
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

PATIENCE = 120.0
MODULE = """
import numpy as np
from numba.types import float64
from slosh_base.compiled.compilation import compiled, entry_point, given

K = 2.0

@compiled
def scaled(x):
    return K * x

@entry_point(float64(float64))
def one(x):
    return scaled(x) + 1.0

@entry_point(float64(float64))
def two(x):
    return scaled(x) + 2.0

@entry_point(float64(float64))
def three(x):
    return scaled(x) + 3.0
"""
ANSWERS = {"one": 11.0, "two": 12.0, "three": 13.0}
PROGRAM = """
import json, sys
import throwaway
from slosh_base.compiled.compilation import EntryPoint
points = {name: one for name, one in vars(throwaway).items() if isinstance(one, EntryPoint)}
BEFORE
answers = {name: one(5.0) for name, one in points.items()}
stats = {name: one.load().stats for name, one in points.items()}
print(json.dumps({
    "answers": answers,
    "loaded": sorted(name for name, one in stats.items() if sum(one.cache_hits.values())),
    "compiled": sorted(name for name, one in stats.items() if sum(one.cache_misses.values())),
}))
"""
NAMES = sorted(ANSWERS)


class Process:
    """A process that imports a module and calls its compiled functions."""

    def __init__(self, folder, before="", **environment):
        self._process = subprocess.Popen(
            [sys.executable, "-c", PROGRAM.replace("BEFORE", before)],
            env=surroundings(folder) | environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def line(self):
        return self._process.stdout.readline().strip()

    def kill(self):
        self._process.kill()
        return self.ended()

    def ended(self, text=None):
        out, self.err = self._process.communicate(text, PATIENCE)
        self.out = out
        return self._process.returncode

    def result(self, text=None):
        assert self.ended(text) == 0, self.err
        assert "Traceback" not in self.err
        return json.loads(self.out)


def surroundings(folder):
    names = "NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "NUMBA_DISABLE_JIT"
    kept = {name: value for name, value in os.environ.items() if name not in names}
    path = os.pathsep.join([str(folder), kept.get("PYTHONPATH", "")])
    return kept | {
        "PYTHONPATH": path,
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_CACHE_DIR": str(folder.parent / "cache"),
    }


@pytest.fixture
def folder(tmp_path):
    return checkout(tmp_path / "here")


def checkout(folder, text=MODULE):
    folder.mkdir()
    (folder / "throwaway.py").write_text(text)
    return folder


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A cache that contains all compiled functions of the test."""
    place = tmp_path_factory.mktemp("compiled")
    assert Process(checkout(place / "here")).result()["compiled"] == NAMES
    return place / "cache"


@pytest.fixture
def with_code(folder, compiled):
    """A folder and a cache that contains all compiled functions of the test."""
    shutil.copytree(compiled, folder.parent / "cache")
    return folder


def kept(folder):
    return {
        re.match(r"throwaway\.(\w+)_\w{16}-", path.name)[1]: path
        for path in (folder.parent / "cache").rglob("*.code")
    }


@pytest.mark.long
def test_checkouts_share_what_is_equal_and_leave_each_other_the_rest(tmp_path, with_code):
    folder = with_code
    other = checkout(tmp_path / "there", "# Another branch.\n" + MODULE.replace("3.0", "4.0"))
    assert Process(other).result() == {
        "answers": {**ANSWERS, "three": 14.0}, "loaded": ["one", "two"], "compiled": ["three"],
    }  # fmt: skip
    for one in (folder, other):
        assert Process(one).result()["compiled"] == []


@pytest.mark.long
def test_an_edit_is_followed_even_where_the_files_time_and_size_stay(with_code):
    folder = with_code
    source = folder / "throwaway.py"
    before = source.stat()
    source.write_text(MODULE.replace("K = 2.0", "K = 7.0"))
    os.utime(source, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert source.stat().st_size == before.st_size
    assert Process(folder).result() == {
        "answers": {"one": 36.0, "two": 37.0, "three": 38.0}, "loaded": [], "compiled": NAMES,
    }  # fmt: skip


# Damage.

DAMAGES = {
    "not whole": {
        "one": lambda data: b"",
        "two": lambda data: data[: len(data) // 2],
        "three": lambda data: data[:8192] + bytes(4096) + data[12288:],
    },
    "not the same": {
        "one": lambda data: bytes(len(data)),
        "two": lambda data: hashlib.shake_128(data).digest(len(data)),
        "three": lambda data: data[:9000] + bytes([data[9000] ^ 4]) + data[9001:],
    },
}


@pytest.mark.long
@pytest.mark.parametrize(
    "damages",
    [
        pytest.param(DAMAGES["not whole"], marks=pytest.mark.long, id="not whole"),
        pytest.param(DAMAGES["not the same"], id="not the same"),
    ],
)
def test_damaged_code_is_thrown_away_with_a_warning_and_compiled_anew(with_code, damages):
    whole = {path: path.read_bytes() for path in kept(with_code).values()}
    for name, path in kept(with_code).items():
        path.write_bytes(damages[name](whole[path]))
        assert path.read_bytes() != whole[path]
    process = Process(with_code)
    assert process.result() == {"answers": ANSWERS, "loaded": [], "compiled": NAMES}
    assert len(process.err.splitlines()) == len(damages)
    for name, path in kept(with_code).items():
        assert f"throwaway.{name}: compiled again, {path} is damaged: " in process.err
        assert len(path.read_bytes()) == pytest.approx(len(whole[path]), rel=0.1)


# Processes that are killed, and that meet.

KILLED = {
    "before it compiles": """
from numba.core import event
class Killer(event.Listener):
    def on_start(self, event): os.kill(os.getpid(), 9)
    def on_end(self, event): pass
event.register("numba:compile", Killer())
""",
    "while it writes": """
whole = Path.write_bytes
def half(path, data):
    whole(path, data[: len(data) // 2])
    os.kill(os.getpid(), 9)
Path.write_bytes = half
""",
    "before it names what it wrote": """
Path.replace = lambda *_: os.kill(os.getpid(), 9)
""",
}


@pytest.mark.long
@pytest.mark.parametrize(
    "moment",
    [
        pytest.param(text, marks=() if name == "while it writes" else pytest.mark.long, id=name)
        for name, text in KILLED.items()
    ],
)
def test_a_process_that_is_killed_leaves_a_cache_that_works(folder, moment):
    process = Process(folder, "import os\nfrom pathlib import Path\n" + moment)
    assert process.ended() == -signal.SIGKILL
    assert kept(folder) == {}
    assert Process(folder).result() == {"answers": ANSWERS, "loaded": [], "compiled": NAMES}


def test_of_processes_that_start_at_once_one_compiles_each_function(folder):
    # Each compiles nothing before all of them are ready to.
    wait = "print('ready', flush=True)\nsys.stdin.readline()"
    processes = [Process(folder, wait) for _ in range(3)]
    for process in processes:
        assert process.line() == "ready"
    for process in processes:
        process._process.stdin.write("\n")
        process._process.stdin.flush()
    results = [process.result() for process in processes]
    for result in results:
        assert result["answers"] == ANSWERS
    assert sorted(name for result in results for name in result["compiled"]) == NAMES
    assert len([name for result in results for name in result["loaded"]]) == 2 * len(NAMES)


@pytest.mark.long
def test_a_process_that_waits_goes_on_when_the_one_that_compiles_is_killed(folder):
    stuck = """
from numba.core import event
class Stuck(event.Listener):
    def on_start(self, event):
        print("compiling", flush=True)
        sys.stdin.readline()
    def on_end(self, event): pass
event.register("numba:compile", Stuck())
"""
    first = Process(folder, stuck)
    assert first.line() == "compiling"
    second = Process(folder, "print('ready', flush=True)")
    assert second.line() == "ready"
    assert first.kill() == -signal.SIGKILL
    assert second.result()["compiled"] == NAMES


@pytest.mark.long
def test_a_child_that_was_forked_meanwhile_holds_no_lock(folder):
    forks = """
import os
from numba.core import event
class Forks(event.Listener):
    def on_start(self, event):
        if os.fork() == 0:
            os.closerange(1, 3)
            os.read(0, 1)
            os._exit(0)
    def on_end(self, event): pass
event.register("numba:compile", Forks())
"""
    first = Process(folder, forks)
    assert json.loads(first.line())["compiled"] == NAMES
    # The children of the first still live.
    assert Process(folder).result()["loaded"] == NAMES
    assert first.ended() == 0


# Places where nothing can be kept.


@pytest.mark.long
def test_a_full_disk_costs_a_warning_and_nothing_else(folder, monkeypatch):
    # `make coverage` would write to that disk, too, and complain.
    monkeypatch.delenv("COVERAGE_PROCESS_CONFIG", raising=False)
    full = "import resource\nresource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))"
    process = Process(folder, full)
    assert process.result() == {"answers": ANSWERS, "loaded": [], "compiled": NAMES}
    assert process.err.count("compiled, but not cached: ") == 3
    assert not [
        path
        for path in (folder.parent / "cache").rglob("*")
        if path.suffix != ".lock" and path.is_file()
    ]
    assert Process(folder).result()["compiled"] == NAMES


class Planted:
    """Pickled object that writes a file when it is unpickled."""

    def __init__(self, path):
        self._path = path

    def __reduce__(self):
        return Path.touch, (self._path,)


@pytest.mark.first(1)
@pytest.mark.parametrize("trusted", [True, False], ids=["our folder", "a folder open to all"])
def test_code_that_others_may_have_planted_is_not_run(with_code, tmp_path, trusted):
    folder = with_code
    (tmp_path / "tmp").mkdir()
    temporary = {"TMPDIR": str(tmp_path / "tmp")}
    path, mark = kept(folder)["two"], tmp_path / "mark"
    code = pickle.dumps(Planted(mark))
    path.write_bytes(hashlib.sha256(code).digest() + code)
    path.parent.chmod(0o700 if trusted else 0o777)
    assert Process(folder, **temporary).result()["answers"] == ANSWERS
    # In a folder of ours it is run: it is the folder that counts.
    assert mark.exists() == trusted


# Numba's own functions.
