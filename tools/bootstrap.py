"""Prepares this checkout for use: Python environment, ROS 2 Jazzy and built workspace.

    python3 tools/bootstrap.py [--tests]

Every step is done once and skipped as long as what it depends on is unchanged. With --tests also
the optional libraries that tests and measurements use. With /opt/ros/jazzy present that ROS is
used; otherwise ROS 2 Jazzy comes as wheels into the virtual environment.
Needs the standard library alone.

Environment variables: SLOSH_VENV (default .venv), SLOSH_PYTHON (an interpreter, 3.11 or 3.12),
SLOSH_NUMPY (a NumPy version in place of the pinned one), SLOSH_RUNTIME_ONLY (1: without
what tests, lint and documentation need).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / os.environ.get("SLOSH_VENV", ".venv")
WORKSPACE = ROOT / "ros2_ws"
REQUIREMENTS = ROOT / "requirements"
ROS = Path("/opt/ros/jazzy")
SUPPORTED = ((3, 11), (3, 12))
NOT_IN_PATHS = ':;"$`\\\n'
"""A colon ends a path in PATH, a semicolon in CMake; the others mean something to a shell."""
PLAIN = re.compile(r"[\w./+@-]+", re.ASCII)
"""Paths that the CMake files of ROS 2 take as they are."""
EXTRAS = ("joints", "plc", "fleet", "storage", "moto", "pdf", "deployment")
"""Requirement files that tests and benchmarks use beside those of every set-up."""
WITH_ROS = ("plan", "modes")
"""Further ones where ROS 2 is installed: the wheels' set-up has them."""
MESSAGES = "slosh_msgs"
STAND_INS = "tests/interfaces"
"""Messages that tests need and no wheel has: built where ROS 2 is not installed."""
COLCON = "import sys; from colcon_core.command import main; sys.exit(main())"
# What a command in the environment sees; everything else is inherited.
VARIABLES = ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "CMAKE_PREFIX_PATH")


class BootstrapError(Exception):
    """Error of something missing on this machine; the text is one line with the remedy."""


def main() -> int:
    """Brings the Python environment and the workspace up to date; returns the exit code."""
    try:
        python = find_python()
        check_place()
        check_tools()
        once("environment", VENV, environment_inputs(python), lambda: install_environment(python))
        # Neither needs the other, and each leaves cores idle for a while.
        together(
            lambda: once("workspace", WORKSPACE / "install", workspace_inputs(), build_workspace),
            lambda: once("compiled", VENV, compiled_inputs(), compile_functions),
        )
        if "--tests" in sys.argv[1:]:
            install_extras()
    except BootstrapError as error:
        print(f"setup: {error}", file=sys.stderr)
        return 1
    return 0


def find_python() -> Path:
    """Returns the Python for the environment: SLOSH_PYTHON, ROS's own, or the first suitable."""
    if chosen := os.environ.get("SLOSH_PYTHON"):
        candidates = [chosen]
    elif ROS.is_dir():
        candidates = ["/usr/bin/python3"]
    else:
        candidates = ["python3.12", "python3.11", "python3", sys.executable]
    for candidate in candidates:
        path = shutil.which(candidate)
        found = base_interpreter(path) if path else None
        if found and found.version in SUPPORTED:
            return found.path
    raise BootstrapError(
        f"Python 3.11 or 3.12 is needed, tried {', '.join(candidates)}; "
        "install one (apt install python3 python3-venv) or name it in SLOSH_PYTHON"
    )


class Interpreter(NamedTuple):
    """A Python interpreter outside of virtual environments, with its version (major, minor)."""

    path: Path
    version: tuple[int, int]


def base_interpreter(python: str) -> Interpreter | None:
    """Returns the base interpreter of a Python that may belong to a virtual environment.

    Whether that environment is on PATH makes no difference then.

    Returns:
        None where it cannot run or cannot make environments.
    """
    probe = (
        "import json, os, sys, venv, ensurepip\n"
        "base = getattr(sys, '_base_executable', '') or sys.executable\n"
        "print(json.dumps([os.path.realpath(base), *sys.version_info[:2]]))"
    )
    done = subprocess.run([python, "-c", probe], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        return None
    path, major, minor = json.loads(done.stdout)
    return Interpreter(Path(path), (major, minor))


def check_place() -> None:
    """Raises BootstrapError if the checkout's path has characters that PATH cannot contain."""
    odd = sorted(set(f"{ROOT}{VENV}") & set(NOT_IN_PATHS))
    if odd:
        raise BootstrapError(
            f"{str(ROOT)!r}: a path with {' '.join(map(repr, odd))} cannot be set up; "
            "move the checkout to another folder"
        )


def check_tools() -> None:
    """Raises BootstrapError, with the install command, for each missing compiler."""
    needed = {"g++": ("c++", "g++"), "gcc": ("cc", "gcc"), "make": ("make",)}
    missing = [package for package, names in needed.items() if not any(map(shutil.which, names))]
    if missing:
        raise BootstrapError(
            f"missing {', '.join(missing)}: run `apt install {' '.join(missing)}` and try again"
        )


def once(name: str, folder: Path, inputs: Iterable[bytes], action: Callable[[], None]) -> None:
    """Runs an action that fills a folder, unless it was already run with the same inputs."""
    digest = hashlib.sha256()
    for item in inputs:
        digest.update(hashlib.sha256(item).digest())
    stamp = folder / f".{name}"
    if stamp.is_file() and stamp.read_text() == digest.hexdigest():
        return
    stamp.unlink(missing_ok=True)
    started = time.monotonic()
    print(f"setup: {name} ...", flush=True)
    action()
    stamp.write_text(digest.hexdigest())
    print(f"setup: {name} ready after {time.monotonic() - started:.0f} s", flush=True)


# --- the virtual environment ---------------------------------------------------------------------


def requirement_files() -> list[Path]:
    """Returns the files with pinned package versions to install, in order."""
    names = ["runtime.txt"]
    if not os.environ.get("SLOSH_RUNTIME_ONLY"):
        names.append("development.txt")
    return [
        REQUIREMENTS / name
        for name in (names if ROS.is_dir() else ["ros.txt", *names, "plan.txt", "modes.txt"])
    ]


def environment_inputs(python: Path) -> list[bytes]:
    """Returns the data on which the virtual environment depends, for detecting changes."""
    choices = f"{python} {os.environ.get('SLOSH_NUMPY', '')} {ROS.is_dir()} {VENV}"
    return [choices.encode(), *(path.read_bytes() for path in requirement_files())]


def install_environment(python: Path) -> None:
    """Creates the virtual environment anew and installs the pinned package versions."""
    system = ["--system-site-packages"] if ROS.is_dir() else []
    run([str(python), "-m", "venv", "--clear", *system, str(VENV)])
    pip = [str(VENV / "bin/python"), "-m", "pip", "install", "--quiet", "--no-input"]
    # pip would turn everything to bytecode, the packages' own tests too, on one core.
    pip += ["--disable-pip-version-check", "--no-compile"]
    if ROS.is_dir():
        # The system's NumPy stays: ROS 2's own binaries are built with it.
        constraint = ["-c", str(REQUIREMENTS / "constraints-jazzy.txt")]
        inputs = [path.with_suffix(".in") for path in requirement_files()]
        run([*pip, *constraint, *flatten("-r", inputs)])
        to_bytecode([site_packages()])
        return
    # The locks are complete, so nothing is left for pip to resolve, and no two name the same.
    installs = [[*pip, "--no-deps", "-r", str(path)] for path in requirement_files()]
    together(*(partial(run, install) for install in installs))
    if version := os.environ.get("SLOSH_NUMPY"):
        run([*pip, "--no-deps", f"numpy=={version}"])
    mend_wheels()
    to_bytecode([site_packages()])


def install_extras() -> None:
    """Installs the optional libraries; tells in one line which of them cannot be had."""
    before = sorted(VENV.glob(".extra-*"))
    for name in (*EXTRAS, *(WITH_ROS if ROS.is_dir() else ())):
        path = REQUIREMENTS / f"{name}.txt"
        inputs = [(VENV / ".environment").read_bytes(), path.read_bytes()]
        try:
            once(f"extra-{name}", VENV, inputs, partial(install_extra, path))
        except BootstrapError as error:
            why = next(
                (line for line in str(error).splitlines() if line.startswith("ERROR:")),
                str(error).splitlines()[0],
            )
            print(
                f"setup: requirements/{name}.txt could not be installed, its tests are skipped: "
                f"{why.removeprefix('ERROR: ')}",
                file=sys.stderr,
            )
    if sorted(VENV.glob(".extra-*")) != before:
        to_bytecode([site_packages()])


def install_extra(path: Path) -> None:
    """Installs the exact versions of a file; where ROS 2 is installed, what fits to its NumPy."""
    # Without a network the tests have to begin soon.
    pip = [str(VENV / "bin/python"), "-m", "pip", "install", "--quiet", "--no-input"]
    pip += ["--disable-pip-version-check", "--no-compile", "--retries", "1", "--timeout", "15"]
    wishes = path.with_suffix(".in")
    if ROS.is_dir() and wishes.exists():
        run([*pip, "-c", str(REQUIREMENTS / "constraints-jazzy.txt"), "-r", str(wishes)])
    else:
        run([*pip, "--no-deps", "-r", str(path)])


def mend_wheels() -> None:
    """Corrects paths in the ROS wheels' CMake files, which name their build machine's folders."""
    query = (
        "import sysconfig, numpy; print(sysconfig.get_path('include')); print(numpy.get_include())"
    )
    done = subprocess.run(
        [str(VENV / "bin/python"), "-c", query], capture_output=True, text=True, check=True
    )
    python_include, numpy_include = done.stdout.splitlines()
    python_path = re.compile(r"/opt/python/cp3\d+-cp3\d+/include/python3\.\d+")
    numpy_path = re.compile(r"[^;\"\s]*/site-packages/numpy/_?core/include")
    for cmake in (VENV / "share").rglob("*.cmake"):
        text = cmake.read_text(errors="surrogateescape")
        mended = python_path.sub(lambda _: python_include, text)
        mended = numpy_path.sub(lambda _: numpy_include, mended)
        if mended != text:
            cmake.write_text(mended, errors="surrogateescape")
    for suffix in ("sh", "bash", "zsh"):
        (VENV / f"local_setup.{suffix}").touch()  # colcon looks for them in every prefix


def flatten(option: str, paths: Iterable[Path]) -> list[str]:
    """Returns command-line words with the same option before each path."""
    return [word for path in paths for word in (option, str(path))]


# --- the workspace -------------------------------------------------------------------------------


def workspace_inputs() -> list[bytes]:
    """Returns the data on which the workspace build depends, for detecting changes."""
    patterns = [f"slosh*/{name}" for name in ("package.xml", "*setup.py", "setup.cfg")]
    patterns.append("slosh*/CMakeLists.txt")
    patterns += ["slosh_msgs/msg/*", "slosh_msgs/srv/*", "slosh_msgs/action/*"]
    files = sorted(path for pattern in patterns for path in ROOT.glob(f"*/{pattern}"))
    linked = sorted(
        str(path)
        for folder in ("launch", "config", "bin")
        for path in ROOT.glob(f"*/slosh*/{folder}/*")
        if path.is_file()  # Python keeps the code of a launch file beside it, in a folder
    )
    files.append(WORKSPACE / "colcon-defaults.yaml")
    files += sorted(path for path in (ROOT / STAND_INS).rglob("*") if path.is_file())
    environment = (VENV / ".environment").read_bytes()
    return [environment, "\n".join(linked).encode(), *(path.read_bytes() for path in files)]


def build_workspace() -> None:
    """Builds every package with colcon and writes the environment file for tools/run."""
    for folder in ("build", "install", "log"):
        shutil.rmtree(WORKSPACE / folder, ignore_errors=True)
    environment = base_environment()
    places, skipped = ["src", "addons"], []
    if not PLAIN.fullmatch(f"{ROOT}{VENV}"):
        build_messages_elsewhere(environment)
        skipped = ["--packages-skip", MESSAGES]
    elif not ROS.is_dir():
        places.append(str(ROOT / STAND_INS))
    colcon(["--base-paths", *places, *skipped], WORKSPACE, environment)
    to_bytecode((WORKSPACE / "install").glob("lib/python3*"))
    write_environment(environment)


def build_messages_elsewhere(environment: dict[str, str]) -> None:
    """Builds the messages in a folder with a plain path, and copies them to the workspace.

    The CMake files of ROS 2 do not quote all paths. A link leads to the environment.
    """
    with tempfile.TemporaryDirectory(prefix="slosh_") as name:
        place = Path(name)
        shutil.copytree(ROOT / "src" / MESSAGES, place / "src" / MESSAGES)
        (place / "venv").symlink_to(VENV)
        plain = {
            name: value.replace(str(VENV), str(place / "venv"))
            for name, value in environment.items()
            if name != "COLCON_DEFAULTS_FILE"
        }
        flags = ["-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF", "-Wno-dev"]
        colcon(["--base-paths", "src", "--merge-install", "--cmake-args", *flags], place, plain)
        shutil.copytree(place / "install", WORKSPACE / "install", symlinks=True)
        for script in (WORKSPACE / "install").rglob("*.sh"):
            text = script.read_text("utf-8")
            moved = text.replace(str(place / "install"), str(WORKSPACE / "install"))
            script.write_text(moved, "utf-8")


def colcon(arguments: list[str], folder: Path, environment: dict[str, str]) -> None:
    """Runs `colcon build` in a folder; raises an error if the build fails.

    Raises:
        BootstrapError: it failed; the text has the first error and names the log.
    """
    log = VENV / "colcon.log"
    # Not its own script: the first line of a script holds no blank.
    command = [str(VENV / "bin/python"), "-c", COLCON, "build", *arguments]
    with log.open("w") as output:
        done = subprocess.run(
            command,
            cwd=folder,
            env=environment,
            stdout=output,
            stderr=subprocess.STDOUT,
            check=False,
        )
    if done.returncode != 0:
        raise BootstrapError(f"colcon build failed, see {log}: {first_error(log.read_text())}")


def compiled_inputs() -> list[bytes]:
    """Returns the data on which compiled functions depend: sources, environment, cache paths."""
    environment = (VENV / ".environment").read_bytes()
    variables = ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME")
    places = [os.environ.get(name, "").encode() for name in variables]
    files = sorted(ROOT.glob("*/slosh_*/slosh_*/**/*.py"))
    return [environment, *places, *(path.read_bytes() for path in files)]


def compile_functions() -> None:
    """Compiles all Numba functions in advance, so that no node has to wait for them."""
    # To bytecode first: where Python may write nothing, each process would do it anew.
    to_bytecode(ROOT.glob("*/slosh*/slosh*"))
    # What computes knows nothing of ROS 2, and does without the built workspace.
    packages = ":".join(str(path.parent) for path in ROOT.glob("*/slosh_*/setup.py"))
    add_ons = sorted(path.parent.name for path in ROOT.glob("addons/slosh_*/*/addon.py"))
    command = [str(VENV / "bin/python"), "-m", "slosh_bringup.compiling", *add_ons]
    environment = {**os.environ, "PYTHONPATH": packages}
    done = subprocess.run(command, cwd=ROOT, env=environment, check=False)
    if done.returncode != 0:
        raise BootstrapError(f"`{shlex.join(command)}` failed with exit code {done.returncode}")


def to_bytecode(folders: Iterable[Path]) -> None:
    """Compiles Python modules to bytecode on all cores, except tests of installed packages."""
    tests = "/site-packages/(.*/)?tests?/"
    command = [str(VENV / "bin/python"), "-m", "compileall", "-q", "-j", "0", "-x", tests]
    run([*command, *map(str, folders)])


def first_error(text: str) -> str:
    """Returns the first line of a build's output that contains an error message."""
    lines = [line.strip() for line in text.splitlines() if "rror" in line]
    return lines[0] if lines else "no error line found"


def base_environment() -> dict[str, str]:
    """Returns the environment variables for colcon: virtual environment first, then ROS 2."""
    environment = dict(os.environ)
    environment.pop("PYTHONPATH", None)
    if ROS.is_dir():
        environment = sourced(ROS / "setup.bash", environment)
    else:
        environment["AMENT_PREFIX_PATH"] = str(VENV)
        environment["CMAKE_PREFIX_PATH"] = str(VENV)
        environment["SLOSH_MSGS_PYTHON_ONLY"] = "1"  # the wheels bring no C++ program
    environment["VIRTUAL_ENV"] = str(VENV)
    environment["PATH"] = f"{VENV / 'bin'}:{environment['PATH']}"
    environment["COLCON_DEFAULTS_FILE"] = str(WORKSPACE / "colcon-defaults.yaml")
    # colcon's ament_python builds run setup.py in the environment, with its own setuptools.
    environment["SETUPTOOLS_USE_DISTUTILS"] = "local"
    return environment


def sourced(script: Path, environment: dict[str, str]) -> dict[str, str]:
    """Returns the environment variables after a shell has sourced a script."""
    command = f"source {shlex.quote(str(script))} >/dev/null && env -0"
    done = subprocess.run(
        ["bash", "-c", command], env=environment, capture_output=True, check=False
    )
    if done.returncode != 0:
        raise BootstrapError(f"{script} cannot be sourced: {done.stderr.decode().strip()}")
    pairs = (item.split("=", 1) for item in done.stdout.decode().split("\0") if "=" in item)
    return dict(pairs)


def write_environment(environment: dict[str, str]) -> None:
    """Writes the built workspace's environment variables, and the `slosh` command."""
    script = WORKSPACE / "install" / "setup.bash"
    # colcon's script does not quote its Python; a link in the environment leads to the base.
    python = os.path.realpath(VENV / "bin/python")
    result = sourced(script, {**environment, "COLCON_PYTHON_EXECUTABLE": python})
    if str(script.parent) not in result["AMENT_PREFIX_PATH"].split(":"):
        raise BootstrapError(f"{script} does not add the workspace; source it to see why")
    added = {
        name: new_entries(result.get(name, ""), os.environ.get(name, "")) for name in VARIABLES
    }
    lines = [
        f'export {name}={shlex.quote(entries)}"${{{name}:+:${name}}}"'
        for name, entries in added.items()
        if entries
    ]
    (VENV / "environment.sh").write_text("\n".join(lines) + "\n", encoding="utf-8")
    # So that the environment's own interpreter, a notebook's too, finds the packages by itself.
    paths = added["PYTHONPATH"].split(":")
    (site_packages() / "slosh_workspace.pth").write_text("\n".join(paths) + "\n", "utf-8")
    command = VENV / "bin" / "slosh"
    target = WORKSPACE / "install" / "bin" / "slosh"
    # -S: the script loads `site` itself, when Ctrl-C no longer ends in a traceback.
    words = shlex.join([str(ROOT / "tools/run"), "python", "-S", str(target)])
    runner = f'#!/bin/sh\nexec {words} "$@"\n'
    command.write_text(runner)
    command.chmod(0o755)


def site_packages() -> Path:
    """Returns the folder with the virtual environment's installed packages."""
    (found,) = (VENV / "lib").glob("python3*/site-packages")
    return found


def new_entries(after: str, before: str) -> str:
    """Returns those entries of a path variable that were added to it, in order.

    Those of this checkout are new, whether they were there or not: they may be gone next time.
    """
    own = tuple(f"{folder}/" for folder in (VENV, WORKSPACE))
    known = {entry for entry in before.split(":") if not f"{entry}/".startswith(own)}
    return ":".join(
        dict.fromkeys(entry for entry in after.split(":") if entry and entry not in known)
    )


def together(*actions: Callable[[], None]) -> None:
    """Runs actions in parallel; raises the first failure's error after all have ended."""
    with ThreadPoolExecutor(len(actions)) as pool:
        for done in [pool.submit(action) for action in actions]:
            done.result()


def run(command: list[str]) -> None:
    """Runs a command; raises BootstrapError with its output if it fails."""
    done = subprocess.run(
        command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False
    )
    if done.returncode != 0:
        raise BootstrapError(
            f"`{shlex.join(command)}` failed with exit code {done.returncode}:\n"
            f"{done.stdout[-2000:]}"
        )


if __name__ == "__main__":
    sys.exit(main())
