"""Runs and records a cell's nodes for `slosh demo` and `slosh cell`."""

from __future__ import annotations

import math
import os
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from slosh_bringup.cell_watch import SILENT
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import CellSetup
from slosh_bringup.live.deafness import Deafness
from slosh_bringup.live.service_manager import ServiceManager
from slosh_bringup.live.watch import LiveWatch, Screen
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import (
    EXIT_WRONG_INPUT,
    LAST,
    NodeEnd,
    NodeGroup,
    NodeProcess,
    node_environment,
    restarted,
)
from slosh_bringup.stop_request import StopRequest
from slosh_bringup.watch import HOST
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_model.containers import PRISMATIC
from slosh_model.tray import read_tray
from slosh_msgs_py import topics
from slosh_msgs_py.node.dead_ports import DeadPorts
from slosh_msgs_py.node.domain import claimed_namespace, own_domain
from slosh_msgs_py.node.hardware import HARDWARE_ID
from slosh_msgs_py.node.rivals import FORGOTTEN
from slosh_msgs_py.node.shared_memory import remove_leftovers

PERIOD = 1.0
"""How often to look [s]."""


class OtherCells:
    """Compares the nodes found in the namespace with the nodes of this cell.

    The graph tells late on a busy machine, and the other cell may come later: it is asked as long
    as the cell runs, and nobody waits for the answer.
    """

    def __init__(self) -> None:
        self._starts: dict[str, deque[float]] = {}
        self._seen: frozenset[str] = frozenset()
        self._told: frozenset[str] = frozenset()

    def started(self, name: str, now: float) -> None:
        """Records the monotonic time [s] at which a node of this cell was started."""
        self._starts.setdefault(name, deque()).append(now)

    def look(self, running: Mapping[str, int], now: float) -> list[str]:
        """Returns names of newly found nodes in this namespace that are not of this cell.

        Two looks in a row have to agree: nodes appear one after the other, and are told together.

        Args:
            running: how often each name is in the graph.
            now: steady time [s].
        """
        foreign = frozenset(
            name for name, count in running.items() if count > self._own(name, now)
        )
        before, self._seen = self._seen, foreign
        if foreign != before or foreign == self._told:
            return []
        news, self._told = foreign - self._told, foreign
        return sorted(foreign) if news else []

    def _own(self, name: str, now: float) -> int:
        """Returns how many nodes of a name belong to this cell, counting recently killed ones."""
        starts = self._starts.get(name)
        if not starts:
            return 0
        while len(starts) > 1 and now - starts[1] > FORGOTTEN:
            starts.popleft()
        return len(starts)


ATTEMPTS, WITHIN = 5, 60.0
"""A node that ends so often within so long [s] is not started again."""
HANGS = 30.0
"""A process that says nothing for so long, though others are heard, is of no use [s].

It was stopped, it hangs, or nobody hears it since a neighbour was killed. A busy machine takes a
third of that to start one.
"""

POLL = 0.1
_WORTH_TELLING = 10_000_000  # bytes
# What a run writes into its folder.
BAG, LOGS, SETTINGS = "bag", "logs", "settings.yaml"


def check_files(setup: CellSetup) -> None:
    """Reads the cell's files once, so that errors are reported before any process starts.

    Raises:
        ValueError: of the package that reads the file; one line.
    """
    tray = read_tray(setup.model)
    first = {} if setup.calibration is None else {tray.first.name: setup.calibration}
    for one in tray.containers:
        calibration = {**setup.cameras, **first}.get(one.name)
        if calibration is None:
            continue
        read_any_calibration(calibration)
        if one.model.container.section == PRISMATIC:
            raise SloshBringupError(
                f"{setup.model}: the camera measures rectangles and round containers, not a "
                f"{one.model.container.shape}; write `camera: none` in place of the calibration"
            )
    check_parameter_file(setup.parameters, setup.namespace, setup.camera_nodes.values())


@dataclass(frozen=True, slots=True)
class LiveRun:
    """Settings of a live run: its nodes, its folder and its options.

    Attributes:
        command: the subcommand.
        setup: the cell.
        folder: its own; the results go there.
        title: of the report.
        simulated: the simulated cell; None: a robot speaks.
        watch: port of the operator's page; None: there is none.
    """

    command: str
    setup: CellSetup
    folder: Path
    title: str
    simulated: NodeProcess | None = None
    watch: int | None = None


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """How a live run ended: its problem, if any, and the exit code.

    Attributes:
        problem: what went wrong, or ended the run before its time; empty: nothing did.
        exit_code: 0, or the one that fits the problem.
        began: whether all nodes were at work before.
    """

    problem: str = ""
    exit_code: int = 0
    began: bool = True


def run_nodes(run: LiveRun, screen: Screen, stop: StopRequest) -> RunOutcome:
    """Runs the nodes until the simulated motion is over or a stop is requested.

    Args:
        run: the cell, and where the bag, the logs and what is in force go.
        screen: of whoever watches.
        stop: asks for the end.
    """
    if stop.reason:
        return RunOutcome(
            f"the run was stopped ({stop.reason}) before any node was started", 1, False
        )
    # With ROS, which a wrong option need not wait for.
    from slosh_bringup.nodes.cell_listener import CellListener

    processes = run.setup.processes(run.folder / BAG)
    ready = f"ready: recording to {run.folder / BAG}"
    if run.watch is not None:
        given = {"host": HOST, "port": str(run.watch)}
        setup = run.setup
        processes.append(NodeProcess("watch", [setup.parameters], given, setup.remap))
        ready += f", operator's page: http://{HOST}:{run.watch}/"
    if run.simulated is not None:
        processes.append(run.simulated)
        ready += ", the motion starts"
    names = [process.name for process in processes]
    watch = LiveWatch(run.folder / SETTINGS, names, screen, ready)
    namespace, remap = run.setup.namespace, run.setup.remap
    diagnostics = remap.get(topics.DIAGNOSTICS, topics.DIAGNOSTICS)
    manager = ServiceManager()
    with ExitStack() as stack:
        environment = node_environment()
        environment.update(_domain(run, stack, watch.tell))
        if run.setup.hardware_id:
            environment[HARDWARE_ID] = run.setup.hardware_id
        # The listener below speaks as the nodes do.
        os.environ.update(environment)
        group = stack.enter_context(NodeGroup(namespace, run.folder / LOGS, environment))
        listener = stack.enter_context(
            CellListener(namespace, watch, remap.get(topics.COMPARISON), diagnostics)
        )
        others, deafness = OtherCells(), Deafness(listener.probe)
        supervision = Supervision(group, processes, watch.tell, others)
        freed = remove_leftovers()
        if freed > _WORTH_TELLING:
            watch.tell(f"freed {1e-6 * freed:.0f} MB of shared memory left by killed nodes")
        for process in processes:
            group.start(process)
            others.started(process.name, time.monotonic())
        end, look_at = None, time.monotonic()
        while not (stop.reason or watch.given_up or end or "cell" in group.ended()):
            watch.look()
            manager.look(is_ready=watch.began, status=watch.waits_for)
            listener.listen(POLL)
            if time.monotonic() >= look_at:
                look_at += PERIOD
                found = others.look(listener.running(names), time.monotonic())
                _tell_of_another(found, namespace, watch)
                supervision.end_deaf(deafness.look(watch.unheard, time.monotonic()))
            end = supervision.look(began=watch.began, silences=watch.silences)
        manager.stopping()
        problems = supervision.problems
        if group.stop().get(LAST) == 1:
            problems.append(group.last_line(LAST))
        return _outcome(stop, watch, None if stop.reason else end, problems)


def _domain(run: LiveRun, stack: ExitStack, tell: Callable[[str], None]) -> dict[str, str]:
    """Chooses the nodes' DDS domain: the user's, or an unused one for a demonstration.

    A demonstration keeps to itself: it takes the user's domain only where one is set and no other
    run on this machine has the same namespace in it. A cell talks to the robot on the user's.

    Args:
        run: that begins.
        stack: holds the claims until the run ends.
        tell: prints a line.
    """
    given = os.environ.get("ROS_DOMAIN_ID", "")
    is_set = given.isdecimal()
    if is_set or run.simulated is None:
        claim = claimed_namespace(int(given) if is_set else 0, run.setup.namespace)
        is_own = stack.enter_context(claim)
        if is_own or run.simulated is None:
            return {}
    domain = str(stack.enter_context(own_domain()))
    if is_set:
        tell(
            f"another run uses {run.setup.namespace} in ROS_DOMAIN_ID {given}: this demonstration "
            f"runs in ROS_DOMAIN_ID {domain}"
        )
    return {"ROS_DOMAIN_ID": domain}


def _tell_of_another(running: Sequence[str], namespace: str, watch: LiveWatch) -> None:
    """Warns of another running cell whose messages are mixed with those of this one."""
    if running:
        watch.tell(
            f"another cell's {', '.join(running)} run in {namespace}, too: their messages are "
            "mixed, and recordings of them cannot be replayed; stop one cell or give it "
            "another namespace (a killed cell disappears after half a minute)"
        )


def _outcome(
    stop: StopRequest, watch: LiveWatch, end: NodeEnd | None, problems: Sequence[str]
) -> RunOutcome:
    if end is not None:
        return RunOutcome(end.text, end.code if end.code == 2 else 1, watch.began)
    if watch.began:
        return RunOutcome("; ".join(problems), int(bool(problems)))
    if stop.reason:
        problem = f"the run was stopped ({stop.reason}) before all nodes were ready"
        return RunOutcome(f"{problem}: {watch.waits_for}", 1, began=False)
    if watch.given_up:
        return RunOutcome(f"not all nodes became ready: {watch.given_up}", 1, began=False)
    return RunOutcome()  # the motion is over: it began, whatever was heard here


class Supervision:
    """Monitors the node processes of a live run and restarts them.

    Args:
        group: the nodes.
        processes: how they were started.
        tell: is told what has happened, in a line.
        others: is told of each start.

    Attributes:
        problems: what was told, for the report.
    """

    def __init__(
        self,
        group: NodeGroup,
        processes: Sequence[NodeProcess],
        tell: Callable[[str], None],
        others: OtherCells,
    ) -> None:
        self._group, self._tell, self._others = group, tell, others
        self._processes = {process.name: process for process in processes}
        self._ends: dict[str, list[float]] = {}
        self._started: dict[str, float] = {}
        self._dead_ports = DeadPorts()
        self.problems: list[str] = []

    def look(self, *, began: bool, silences: Mapping[str, float]) -> NodeEnd | None:
        """Restarts a node that has ended and kills one that hangs; call it regularly.

        Args:
            began: whether all were at work before; if not, what keeps one from it keeps it again.
            silences: for how long each node has said nothing [s].

        Returns:
            an end that ends the run: of a node that was not at work yet or that refuses its
            parameters; None: the run goes on.
        """
        now = time.monotonic()
        end = self._group.failed()
        if end is None and began:
            self._end_hanging(silences, now)
        if end is None or not began or end.code == EXIT_WRONG_INPUT:
            return end
        self._dead_ports.look(close=True)
        self._ends.setdefault(end.name, []).append(now)
        recent = sum(now - at < WITHIN for at in self._ends[end.name])
        self._group.forget(end.name)
        if recent > ATTEMPTS:
            self._say(f"{end.text}; for the {recent}th time: the cell continues without it")
            return None
        process = restarted(self._processes[end.name], len(self._ends[end.name]))
        self._group.start(process)
        self._started[process.name] = now
        self._others.started(process.name, now)
        where = f", recording to {process.parameters['output']}" if end.name == LAST else ""
        self._say(f"{end.text}; it is restarted{where}")
        return None

    def end_deaf(self, deaf: Mapping[str, str]) -> None:
        """Kills nodes that fail to receive a topic that other subscribers receive.

        Args:
            deaf: the topic, by node.
        """
        for name, topic in deaf.items():
            if self._group.kill(name):
                self._say(
                    f"node {name} receives nothing on {topic}, although other nodes do: "
                    "it is killed"
                )

    def _end_hanging(self, silences: Mapping[str, float], now: float) -> None:
        """Kills nodes without recent diagnostics, unless none are received from any node."""
        if all(silence > SILENT for silence in silences.values()):
            return
        for name, silence in silences.items():
            mute = min(silence, now - self._started.get(name, -math.inf))
            if mute > HANGS and self._group.kill(name):
                # It counts from here, however long the end takes.
                self._started[name] = now
                self._say(
                    f"node {name} runs but has sent no diagnostics for {mute:.0f} s: it is killed"
                )

    def _say(self, line: str) -> None:
        self.problems.append(line)
        self._tell(line)
