"""Tests who can receive from and send to a cell: this machine, not another network."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from slosh_bringup.processes import NodeProcess, config_folder, node_environment
from slosh_msgs_py.node.network import (
    PROFILES,
    RANGE,
    TRANSPORTS,
    is_local,
    network_environment,
)
from slosh_testing.who_hears import ENOUGH

HERE, THERE = "10.213.77.1", "10.213.77.2"
# An estimator starts slowly on a busy machine [s]; who hears nothing is given less time.
ROBOT_WAITS, STRANGER_WAITS = 60.0, 6.0


def ip(*words: str) -> subprocess.CompletedProcess[bytes]:
    """Runs the program `ip` with arguments."""
    return subprocess.run(["ip", *words], capture_output=True, check=False)


@pytest.fixture
def networks() -> Iterator[tuple[str, str]]:
    """Creates two connected network namespaces: the cell's and a stranger's."""
    if os.getuid() != 0 or not shutil.which("ip") or not shutil.which("unshare"):
        pytest.skip("needs root, ip and unshare to make networks")
    names = (f"slosh{os.getpid()}a", f"slosh{os.getpid()}b")
    ends = tuple(f"s{os.getpid()}{end}"[-15:] for end in "ab")
    try:
        if any(ip("netns", "add", name).returncode for name in names):
            pytest.skip("this machine lets nobody make networks")
        made = ip("link", "add", ends[0], "type", "veth", "peer", "name", ends[1])
        if made.returncode:
            pytest.skip("this machine has no virtual cables")
        for name, end, address in zip(names, ends, (HERE, THERE), strict=True):
            ip("link", "set", end, "netns", name)
            ip("-n", name, "addr", "add", f"{address}/24", "dev", end)
            for device in (end, "lo"):
                assert ip("-n", name, "link", "set", device, "up").returncode == 0
        yield names
    finally:
        for name in names:
            ip("netns", "del", name)


@contextmanager
def process(words: list[str], environment: Mapping[str, str]) -> Iterator[subprocess.Popen[str]]:
    """Runs a process until the `with` block ends."""
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment) as running:
        try:
            yield running
        finally:
            running.terminate()


def listener(role: str, seconds: float) -> list[str]:
    """Returns the command line that starts a listening process."""
    return [sys.executable, "-m", "slosh_testing.who_hears", role, str(seconds)]


def answer_of(listening: subprocess.Popen[str]) -> dict[str, Any]:
    """Returns the JSON result that a listening process prints at its end."""
    assert listening.stdout
    # The middleware may say things before.
    said = next(line for line in listening.stdout if line.startswith("{"))
    answer: dict[str, Any] = json.loads(said)
    return answer


@pytest.mark.long
@pytest.mark.parametrize(
    ("reach", "expected"),
    [("LOCALHOST", False), pytest.param("SUBNET", True, marks=pytest.mark.long)],
)
@pytest.mark.timeout(120)
def test_a_stranger_hears_a_cell_only_where_it_was_let_out(
    reach: str, expected: bool, networks: tuple[str, str], domain: int
) -> None:
    cell_network, other = networks
    inside = ["ip", "netns", "exec", cell_network]
    given = {**os.environ, "ROS_AUTOMATIC_DISCOVERY_RANGE": reach}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", reach)
        environment = node_environment(domain)
    model = {"model": str(config_folder() / "model.yaml")}
    estimator = NodeProcess("estimator", parameters=model).command("/slosh")
    # The stranger knows the address and tries to reach it; of this machine's memory it sees none.
    alone = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /dev/shm; exec "$@"', "sh"]
    strange = {**given, "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET", "ROS_STATIC_PEERS": HERE}
    elsewhere = ["ip", "netns", "exec", other, *alone]
    robot, stranger = listener("robot", ROBOT_WAITS), listener("stranger", STRANGER_WAITS)
    with (
        process([*inside, *estimator], environment),
        process([*inside, *robot], given) as robots,
    ):
        ours = answer_of(robots)
        # Only now is it sure that there is something to hear.
        with process([*elsewhere, *stranger], strange) as strangers:
            theirs = answer_of(strangers)
    assert ours["heard"] > ENOUGH
    assert ours["answered"]
    assert (theirs["heard"] > 0, theirs["answered"]) == (expected, expected)


@pytest.mark.parametrize(
    ("given", "reach", "profile", "local"),
    [
        ({}, "LOCALHOST", "this_machine.xml", True),
        ({RANGE: "SUBNET"}, "SUBNET", "network.xml", False),
        ({TRANSPORTS: "UDPv4"}, "SUBNET", "this_machine_udp.xml", True),
        ({TRANSPORTS: "UDPv4", RANGE: "OFF"}, "OFF", "this_machine_udp.xml", True),
        ({TRANSPORTS: "UDPv4", RANGE: "SUBNET"}, "SUBNET", None, False),
        ({TRANSPORTS: "UDPv4", PROFILES[0]: "/own.xml"}, "LOCALHOST", "own.xml", True),
    ],
)
def test_variables_choose_range_and_profile(
    given: dict[str, str], reach: str, profile: str | None, local: bool
) -> None:
    found = {**given, **network_environment(given)}
    assert found[RANGE] == reach
    assert Path(found.get(PROFILES[0], "")).name == (profile or "")
    assert is_local(given) == local
    assert {**found, **network_environment(found)} == found, "a process that it starts"
    assert is_local(found) == local


@pytest.mark.parametrize("transports", ["UDPv4", pytest.param("DEFAULT", marks=pytest.mark.long)])
@pytest.mark.timeout(120)
def test_a_robot_without_the_cells_shared_memory_needs_udp(transports: str, domain: int) -> None:
    """As in another container, or of another user: the variable is for the cell alone."""
    apart = ["unshare", "--mount", "sh", "-c", 'mount -t tmpfs none /dev/shm && exec "$@"', "sh"]
    if not shutil.which("unshare") or subprocess.run([*apart, "true"], check=False).returncode:
        pytest.skip("needs unshare and the right to mount")
    environment = {**node_environment(domain), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(TRANSPORTS, transports)
        own = node_environment(domain)
    model = {"model": str(config_folder() / "model.yaml")}
    estimator = NodeProcess("estimator", parameters=model).command("/slosh")
    reached = transports == "UDPv4"
    robot = listener("robot", ROBOT_WAITS if reached else STRANGER_WAITS)
    with process(estimator, own), process([*apart, *robot], environment) as robots:
        answer = answer_of(robots)
    assert (answer["heard"] > ENOUGH) is reached
    assert answer["answered"] is reached


@pytest.mark.long
def test_modules_of_the_current_folder_are_not_run(tmp_path: Path) -> None:
    for name in ("yaml", "numpy", "rclpy", "socket"):
        (tmp_path / f"{name}.py").write_text("import os\nopen('ran', 'a').close()\n")
    environment = node_environment()
    node = NodeProcess("monitor", parameters={"timeout": "7.0"}).command("/slosh")
    slosh = [sys.executable, shutil.which("slosh") or "slosh", "doctor"]
    for words in (node, slosh):
        done = subprocess.run(
            words, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert "Traceback" not in done.stderr
    assert not (tmp_path / "ran").exists()
