"""Checks the installation on this machine and suggests how to fix problems."""

from __future__ import annotations

import importlib
import importlib.metadata
import importlib.util
import os
import platform
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROS = Path("/opt/ros/jazzy")
MINIMUM_SHARED_MEMORY = 128 * 2**20  # five participants with a 32 MiB segment each, in part
MINIMUM_DISK = 2 * 2**30
NOTHING_BACK = 3
"""Exit code of the loopback node whose message was lost; a failed start has Python's own, 1."""
OWN_PACKAGES = (
    "slosh_base",
    "slosh_msgs_py",
    "slosh_model",
    "slosh_motion",
    "slosh_camera",
    "slosh_report",
    "slosh_bag",
    "slosh_estimator",
    "slosh_plan",
    "slosh_replay",
    "slosh_discovery",
    "slosh_bringup",
)


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """Result of one check of the installation.

    Attributes:
        name: what was looked at.
        ok: True where it works.
        found: what was found.
        remedy: what to do where it does not work.
        required: False where the product runs without it.
    """

    name: str
    ok: bool
    found: str
    remedy: str = ""
    required: bool = True


def examine() -> Iterator[DoctorFinding]:
    """Runs all checks; yields one finding at a time."""
    yield python_version()
    for check in (ros_source, discovery, interfaces, workspace):
        yield guarded(check)
    for module, minimum in (("numpy", "1.26"), ("scipy", "1.10"), ("numba", "0.59")):
        yield library(module, module, minimum)
    yield library("cv2", "OpenCV", "4.6")
    yield library("mcap", "mcap", "1.5")
    yield library("rosbags", "rosbags", "0.10")
    yield library("distributed", "Dask distributed", "2025.1")
    yield optional("pinocchio", "Pinocchio", "motions of joints", "joints.txt")
    yield optional("duckdb", "DuckDB", "slosh query", "fleet.txt")
    yield optional("fpdf", "fpdf2", "slosh report as PDF", "pdf.txt")
    yield optional("asyncua", "asyncua", "slosh plc", "plc.txt")
    yield guarded(compiled_code)
    yield guarded(message_exchange)
    yield shared_memory()
    yield disk()
    yield tool("ros2", "only to use ros2 launch and ros2 bag; slosh needs neither")


def guarded(check: Callable[[], DoctorFinding]) -> DoctorFinding:
    """Runs a check of the installation; an exception becomes a failed result."""
    try:
        return check()
    except Exception as error:
        # Whatever goes wrong is what the user came here to read.
        name = check.__name__.replace("_", " ")
        text = f"{type(error).__name__}: {error}".splitlines()[0]
        return DoctorFinding(
            name, False, text, "run `make setup`, or source /opt/ros/jazzy/setup.bash"
        )


def python_version() -> DoctorFinding:
    """Checks that the Python version is 3.11 or 3.12."""
    ok = sys.version_info[:2] in ((3, 11), (3, 12))
    found = f"{platform.python_version()} at {sys.executable}"
    return DoctorFinding(
        "Python", ok, found, "use Python 3.11 or 3.12: SLOSH_PYTHON=python3.12 make setup"
    )


def ros_source() -> DoctorFinding:
    """Determines which ROS 2 installation is used."""
    rclpy = importlib.import_module("rclpy")
    path = Path(str(rclpy.__file__))
    kind = "installed" if path.is_relative_to(ROS) else "wheels"
    return DoctorFinding("ROS 2 Jazzy", True, f"{kind}, rclpy at {path.parent}")


def interfaces() -> DoctorFinding:
    """Checks that the message package has been built and can be imported."""
    module = importlib.import_module("slosh_msgs.msg")
    return DoctorFinding("slosh_msgs", True, f"built, at {Path(str(module.__file__)).parent}")


def workspace() -> DoctorFinding:
    """Checks that slosh's ROS packages can be imported."""
    for name in OWN_PACKAGES:
        importlib.import_module(name)
    return DoctorFinding("workspace", True, f"{len(OWN_PACKAGES)} packages import")


def discovery() -> DoctorFinding:
    """Checks by the DDS settings which hosts can discover this machine's topics."""
    network = importlib.import_module("slosh_msgs_py.node.network")
    who = "this machine only"
    if not network.is_local(os.environ):
        who = "every network: see docs/security.md"
    reach = os.environ.get(network.RANGE) or "LOCALHOST"
    domain = os.environ.get("ROS_DOMAIN_ID", "0")
    return DoctorFinding("discovery", True, f"range {reach}, {who}; domain {domain}")


def library(module: str, name: str, minimum: str) -> DoctorFinding:
    """Compares a library's version with the lowest supported version."""
    try:
        imported = importlib.import_module(module)
    except ImportError as error:
        return DoctorFinding(name, False, str(error), "run `make setup`")
    version = getattr(imported, "__version__", None) or importlib.metadata.version(module)
    ok = numbers(version) >= numbers(minimum)
    return DoctorFinding(name, ok, version, f"at least {minimum} is needed: run `make setup`")


def numbers(version: str) -> tuple[int, ...]:
    """Returns the leading numbers of a version: '5.0.0.93' -> (5, 0, 0, 93)."""
    parts = []
    for word in version.split("."):
        if not word.isdigit():
            break
        parts.append(int(word))
    return tuple(parts)


def compiled_code() -> DoctorFinding:
    """Checks that all compiled functions load and that those for heights match their source."""
    compiling = importlib.import_module("slosh_bringup.compiling")
    return DoctorFinding("compiled code", True, compiling.load_everything())


def message_exchange() -> DoctorFinding:
    """Sends a message through the ROS middleware in a separate process and checks its arrival."""
    command = [sys.executable, "-m", "slosh_bringup.nodes.loopback_node"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    ok = done.returncode == 0
    lines = (done.stdout if ok else done.stderr).strip().splitlines()
    last = lines[-1] if lines else "no output"
    lost = "look for a firewall on the loopback interface or a full /dev/shm"
    # Where nothing was sent at all, the reason itself tells what to do.
    return DoctorFinding(
        "messages over DDS", ok, last, lost if done.returncode == NOTHING_BACK else ""
    )


def shared_memory() -> DoctorFinding:
    """Checks the free space for the image transport's shared memory."""
    folder = Path("/dev/shm")
    if not folder.is_dir():
        return DoctorFinding(
            "shared memory", False, "no /dev/shm", "mount a tmpfs there", required=False
        )
    free = shutil.disk_usage(folder).free
    remedy = "give the container more: docker run --shm-size=512m"
    return DoctorFinding(
        "shared memory",
        free >= MINIMUM_SHARED_MEMORY,
        f"{free / 2**20:.0f} MiB free",
        remedy,
        required=False,
    )


def disk() -> DoctorFinding:
    """Checks the free disk space for bags in the current folder."""
    free = shutil.disk_usage(".").free
    found = f"{free / 2**30:.1f} GiB free here"
    return DoctorFinding(
        "disk", free >= MINIMUM_DISK, found, "record elsewhere: -o DIR", required=False
    )


def optional(module: str, name: str, purpose: str, file: str) -> DoctorFinding:
    """Checks whether an optional library is installed.

    Args:
        module: its import name.
        name: its name for people.
        purpose: what needs it.
        file: requirements file that installs it.
    """
    if importlib.util.find_spec(module) is None:
        remedy = f"only for {purpose}: pip install -r requirements/{file}"
        return DoctorFinding(name, False, "not found", remedy, required=False)
    try:
        importlib.import_module(module)
    except ImportError as error:
        remedy = f"only for {purpose}: install the package of the system that has it"
        return DoctorFinding(name, False, f"cannot be loaded: {error}", remedy, required=False)
    return DoctorFinding(name, True, "found", "", required=False)


def tool(name: str, remark: str) -> DoctorFinding:
    """Checks whether an optional program is installed."""
    path = shutil.which(name)
    return DoctorFinding(name, path is not None, path or "not found", remark, required=False)
