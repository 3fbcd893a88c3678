"""Starts and stops the ROS nodes as processes.

The same job as a launch file, for machines without `launch` and for runs that end by themselves.
A node that ends is started again, unless with EXIT_WRONG_INPUT: it refuses its configuration.
"""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import BinaryIO, NamedTuple

from slosh_bag.store.motion_ingest import LONGEST
from slosh_bag.store.motion_ingest import PARAMETER as MOTIONS
from slosh_base.addons import add_ons, cell_nodes
from slosh_base.files.installed import shared_folder
from slosh_bringup.errors import SloshBringupError
from slosh_msgs_py.node.lifeline import Lifelines
from slosh_msgs_py.node.network import network_environment

# Node name -> module with its main(); add-ons bring more, see `known_nodes`.
_OF_CORE = {
    "cell": "slosh_bringup.nodes.cell_node",
    "camera": "slosh_camera.nodes.camera_node",
    "estimator": "slosh_estimator.nodes.estimator_node",
    "markers": "slosh_bringup.nodes.markers_node",
    "monitor": "slosh_estimator.nodes.monitor_node",
    "planner": "slosh_plan.nodes.planner_node",
    "player": "slosh_bag.nodes.player_node",
    "predictor": "slosh_plan.nodes.predictor_node",
    "recorder": "slosh_bag.nodes.recorder_node",
    "sensor": "slosh_estimator.nodes.sensor_node",
    "watch": "slosh_bringup.nodes.watch_node",
}
# Those that end by themselves.
ENDING = ("cell", "player")
# What it records must have ended before it does.
LAST = "recorder"
# Long enough for the recorder to finish its last chunk on a busy machine.
STOP_TIMEOUT = 20.0
# Words, numbers and lists of them: what ROS reads as it stands.
_PLAIN = re.compile(r"[\w./+~-]*|\[[\w., +-]*\]", re.ASCII)

EXIT_WRONG_INPUT = 2
LONGEST_PAUSE = 30.0
"""Between two starts of a node [s]."""


@dataclass(frozen=True, slots=True)
class NodeProcess:
    """Settings with which one node process is started.

    Attributes:
        name: the ROS node's name: one of `known_nodes`, or such as camera_left; see `kind_of`.
        parameter_files: ROS parameter files, later ones win.
        parameters: single parameters, which win over the files.
        remappings: relative topic name -> the robot's topic.
        module: with its `main`; empty: that of `known_nodes`.
    """

    name: str
    parameter_files: Sequence[Path] = ()
    parameters: Mapping[str, str] = field(default_factory=dict)
    remappings: Mapping[str, str] = field(default_factory=dict)
    module: str = ""

    def command(self, namespace: str) -> list[str]:
        """Returns the command that starts the node, as a list of words."""
        words = [sys.executable, "-m", self.module or module_of(self.name), "--ros-args"]
        words += ["-r", f"__ns:={namespace}", "-r", f"__node:={self.name}"]
        for path in self.parameter_files:
            words += ["--params-file", str(path)]
        for name, value in self.parameters.items():
            words += ["-p", f"{name}:={_quoted(value)}"]
        for name, topic in self.remappings.items():
            words += ["-r", f"{name}:={topic}"]
        return words


@cache
def known_nodes() -> Mapping[str, str]:
    """Returns the modules of all nodes by name, with those of add-ons.

    Add-ons are looked for in the files of all installed packages, so not when this is imported.
    """
    return _OF_CORE | {name: module for one in add_ons() for name, module in one.nodes.items()}


def kind_of(name: str) -> str:
    """Returns a node's type in `known_nodes`; that of `camera_left` is `camera`."""
    return name if name in known_nodes() else name.partition("_")[0]


def module_of(name: str) -> str:
    """Returns the module of a node.

    Raises:
        SloshBringupError: no installed package has it.
    """
    kind = kind_of(name)
    if kind not in known_nodes():
        raise SloshBringupError(f"{name}: no installed package or add-on has this node")
    return known_nodes()[kind]


def _quoted(value: str) -> str:
    """Quotes a parameter's value as YAML for the ROS command line."""
    return value if _PLAIN.fullmatch(value) else json.dumps(value)


class NodeEnd(NamedTuple):
    """A node that has ended: its name, its exit code and its last output."""

    name: str
    code: int
    text: str


def node_environment(domain_id: int | None = None) -> dict[str, str]:
    """Returns the environment variables with which nodes are started.

    They hear this machine only, unless more is asked for, and import nothing from the folder that
    they are started in.
    """
    environment = {**os.environ, **network_environment(os.environ), "PYTHONSAFEPATH": "1"}
    environment.setdefault("PYTHONUNBUFFERED", "1")
    if domain_id is not None:
        environment.setdefault("ROS_DOMAIN_ID", str(domain_id))
    return environment


def config_folder() -> Path:
    """Returns the installed folder with parameters, models and calibrations.

    Raises:
        SloshBringupError: it is not installed.
    """
    folder = shared_folder("slosh_bringup")
    if folder is None:
        raise SloshBringupError("slosh_bringup is not installed here: run `make setup`")
    return folder / "config"


class NodeGroup:
    """Node processes that start and stop together; use it as a context manager.

    They end with this process, too, where it is killed.

    Args:
        namespace: ROS namespace of all nodes.
        log_folder: each node's output goes to <log_folder>/<name>.log.
        environment: environment of the processes.
    """

    def __init__(self, namespace: str, log_folder: Path, environment: Mapping[str, str]) -> None:
        self._namespace = namespace
        self._log_folder = log_folder
        self._environment = dict(environment)
        self._running: dict[str, subprocess.Popen[bytes]] = {}
        # Kept open: they can be read although somebody has deleted them.
        self._logs: dict[str, BinaryIO] = {}
        self._patience = STOP_TIMEOUT

    def __enter__(self) -> NodeGroup:
        self._log_folder.mkdir(parents=True, exist_ok=True)
        self._lifelines = Lifelines()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()
        self._lifelines.close()
        for log in self._logs.values():
            log.close()

    def start(self, process: NodeProcess) -> None:
        """Starts a node's process; a restarted node appends to its log."""
        if MOTIONS in process.parameters:  # at its end it waits for `slosh ingest`
            self._patience = STOP_TIMEOUT + LONGEST
        inherited = self._lifelines.of_node(last=process.name == LAST)
        # Its own session: Ctrl-C reaches this process alone, which stops the nodes in order.
        self._running[process.name] = subprocess.Popen(
            process.command(self._namespace),
            stdout=self._log(process.name),
            stderr=subprocess.STDOUT,
            env={**self._environment, **inherited.environment},
            pass_fds=inherited.descriptors,
            start_new_session=True,
        )

    def _log(self, name: str) -> BinaryIO:
        """Opens a node's log file for appending and reading."""
        self._log_folder.mkdir(parents=True, exist_ok=True)
        log = (self._log_folder / f"{name}.log").open("ab+")
        if name in self._logs:
            self._logs[name].close()
        self._logs[name] = log
        return log

    def last_line(self, name: str) -> str:
        """Returns the last line that a node printed, even if its log file was deleted."""
        self._logs[name].seek(0)
        said = self._logs[name].read().decode(errors="replace")
        lines = [line for line in said.splitlines() if line.strip()]
        return lines[-1].strip() if lines else "no output"

    def ended(self) -> dict[str, int]:
        """Returns the exit codes, by name, of nodes that have ended by themselves."""
        codes = {name: process.poll() for name, process in self._running.items()}
        return {name: code for name, code in codes.items() if code is not None}

    def pid(self, name: str) -> int:
        """Returns the process id of a running node."""
        return self._running[name].pid

    def kill(self, name: str) -> bool:
        """Kills a node's process; returns whether it was running."""
        process = self._running.get(name)
        if process is None or process.poll() is not None:
            return False
        process.kill()
        return True

    def failed(self) -> NodeEnd | None:
        """Returns the first node that has ended unexpectedly; None if there is no such node."""
        for name, code in self.ended().items():
            if code != 0 or name not in ENDING:
                log = self._log_folder / f"{name}.log"
                # Who is killed has not said why.
                said = signal.strsignal(-code) if code < 0 else self.last_line(name)
                text = f"node {name} ended with exit code {code}: {said} (see {log})"
                return NodeEnd(name, code, text)
        return None

    def forget(self, name: str) -> None:
        """Removes a node that has ended from the group."""
        self._running.pop(name).wait()

    def check(self) -> None:
        """Raises SloshBringupError for the first node that has ended unexpectedly."""
        end = self.failed()
        if end is not None:
            raise SloshBringupError(end.text)

    def stop(self) -> dict[str, int]:
        """Stops all nodes and returns their exit codes; the recorder is stopped last.

        Returns:
            exit code by node; a node that had to be killed has -9.
        """
        running, self._running = self._running, {}
        others = {name: process for name, process in running.items() if name != LAST}
        last = {name: process for name, process in running.items() if name == LAST}
        return stop_processes(others) | stop_processes(last, self._patience)


def stop_processes(
    processes: Mapping[str, subprocess.Popen[bytes]], patience: float = STOP_TIMEOUT
) -> dict[str, int]:
    """Interrupts processes as Ctrl-C does, and kills those that do not end in time.

    Args:
        processes: by name.
        patience: time for all of them [s].

    Returns:
        exit code by name.
    """
    for process in processes.values():
        process.send_signal(signal.SIGINT)  # not sent to one that has ended
    deadline = time.monotonic() + patience
    for process in processes.values():
        try:
            process.wait(max(deadline - time.monotonic(), 0.0))
        except subprocess.TimeoutExpired:
            process.kill()
    return {name: process.wait() for name, process in processes.items()}


def pause(recent: int) -> float:
    """Returns the delay before a node is restarted [s], doubled for each recent restart.

    Args:
        recent: how often it has ended of late, this time included.
    """
    return min(2.0 ** (recent - 1), LONGEST_PAUSE)


def _begins() -> set[str]:
    """Names the nodes of add-ons that may be told that the liquid is at rest when they start."""
    return {one.node for one in cell_nodes().values() if one.begins}


def restarted(process: NodeProcess, ends: int) -> NodeProcess:
    """Returns the start settings for restarting a node in the middle of a motion.

    Args:
        process: how it was started first.
        ends: how often it has ended so far.
    """
    own: Mapping[str, str] = process.parameters
    if process.name == "estimator" or process.name in _begins():
        own = {**own, "starts_at_rest": "false"}
    if process.name == LAST:
        # What has been recorded stays as it is.
        own = {**own, "output": f"{own['output']}_{ends + 1}"}
    return replace(process, parameters=own)
