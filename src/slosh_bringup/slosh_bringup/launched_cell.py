"""Chooses the nodes that `cell.launch.py` starts, and handles nodes that end.

Nothing here knows `launch`, so that the command line tools of ROS are not needed to test it.
"""

from __future__ import annotations

import importlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

from slosh_base.addons import cell_nodes
from slosh_base.files.errors import SloshFileError
from slosh_base.files.yaml_document import parse_yaml
from slosh_bringup.cell.motion_source import TABLE_ENDINGS
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import (
    NAMESPACE,
    CellSetup,
    default_setup,
    read_cameras,
    read_namespace,
    read_remap,
)
from slosh_bringup.live.run import BAG
from slosh_bringup.live.run_folder import new_run
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import (
    EXIT_WRONG_INPUT,
    LAST,
    STOP_TIMEOUT,
    NodeProcess,
    config_folder,
    module_of,
    pause,
    restarted,
)
from slosh_bringup.watch import PORT
from slosh_camera.calibrate.camera_file import read_any_calibration
from slosh_model.tray import read_tray
from slosh_motion.inputs.inputs import JOINTS
from slosh_msgs_py.node.dead_ports import DeadPorts
from slosh_msgs_py.topics import DRIVING

SETTLED = 60.0
"""An end that lies longer back than this is not counted any more [s]."""
WITHOUT = ("watch",)
"""Nodes without which the cell goes on where they refuse their parameters."""


class Argument(NamedTuple):
    """A launch argument with its name, default value and description."""

    name: str
    default: str
    description: str


ARGUMENTS = (
    Argument("namespace", NAMESPACE, "namespace of all nodes and topics"),
    Argument("parameters", "", "ROS parameter file; empty: config/cell.yaml of this package"),
    Argument("model", "", "model file of container and liquid; empty: the simulated cell's"),
    Argument("calibration", "", "calibration of the camera; empty: the simulated camera's"),
    Argument(
        "cameras",
        "{}",
        "calibration of each camera of a tray's container, as YAML: "
        "'{left: /path/left.yaml, right: /path/right.yaml}'; in place of calibration",
    ),
    Argument(
        "input",
        "",
        f"input of the estimator: {', '.join(DRIVING)}; empty: as in the parameter file",
    ),
    Argument("remap", "{}", "robot's topic for each cell topic, as YAML: '{imu: /arm/imu}'"),
    Argument("camera", "true", "measure with a camera; false: estimate only"),
    Argument(
        "force",
        "",
        "identification.json of `slosh identify --force`: measure with a force sensor, beside the "
        "camera or with camera:=false in its place",
    ),
    Argument("record", "true", "record to OUTPUT/DATE-TIME/bag"),
    Argument("output", "out/cell", "folder of the recordings, with the link `latest`"),
    Argument("predict", "false", "predict planned motions: the service predict"),
    Argument("urdf", "", "robot description, for joint states and predictions of joint motions"),
    Argument("tool_frame", "", "link of the robot that carries the container"),
    Argument("plan", "false", "plan motions: the service plan, the action plan_motion"),
    Argument("watch", "false", f"serve the operator's page on this machine, port {PORT}"),
    Argument("markers", "false", "publish the surface for RViz and Foxglove"),
    Argument("simulate", "false", "play a motion instead of reading a robot's topics"),
    Argument("motion", "c3", "motion of the simulated cell: a name or a motion table"),
    *(
        Argument(key, "", f"{one.summary}: {', '.join(one.choices)}; empty: no {one.node}")
        if one.choices
        else Argument(key, "false", one.summary)
        for key, one in cell_nodes().items()
    ),
)


class Restart(NamedTuple):
    """A planned restart: node name, delay [s] and a line to log."""

    process: NodeProcess
    delay: float
    text: str


class LaunchedCell:
    """The nodes that one launch of `cell.launch.py` starts.

    Args:
        given: the arguments by name, as text; those that are not given have their defaults.
        now: local time of the start; the folder of the recording is named after it.
        tell: gets a line of what is worth knowing.

    Attributes:
        namespace: of all nodes.
        processes: the nodes, in the order of their start.

    Raises:
        ValueError: of ours: an argument or a file that does not fit; one line.
        OSError: the folder of the recording cannot be made.
    """

    def __init__(
        self, given: Mapping[str, str], now: datetime, tell: Callable[[str], object]
    ) -> None:
        self._given = {one.name: given.get(one.name) or one.default for one in ARGUMENTS}
        self._ends: dict[str, list[float]] = {}
        self._dead_ports = DeadPorts()
        wanted = {"camera": self._flag("camera"), LAST: self._flag("record")}
        self._absent = [name for name, there in wanted.items() if not there]
        setup = self._setup()
        self.namespace = setup.namespace
        processes = [*self._own(setup, Path(BAG)), *self._services(setup)]
        if self._flag("simulate"):
            processes.append(self._simulated(setup))
        for process in processes:
            typed_parameters(process)
        if LAST not in self._absent:
            folder = new_run(Path(self._given["output"]).absolute(), now, tell)
            tell(f"this run is in {folder}")
            processes = [_recording_to(process, folder / BAG) for process in processes]
        self.processes: Sequence[NodeProcess] = processes
        self._first = {process.name: process for process in processes}

    def ended(self, name: str, code: int, now: float) -> Restart | None:
        """Decides whether to restart a node that has ended while the launch is running.

        Args:
            name: of the node.
            code: its exit code; negative: the signal that ended it.
            now: steady time [s].

        Returns:
            how it is started again; None: the launch goes on without it.

        Raises:
            SloshBringupError: the launch has to end; one line that says why.
        """
        if name == "cell":
            if code != 0:
                raise SloshBringupError(
                    f"node cell ended with exit code {code}: nothing is played"
                )
            return None
        if code == EXIT_WRONG_INPUT and name in WITHOUT:
            return None
        if code == EXIT_WRONG_INPUT:
            raise SloshBringupError(
                f"node {name} refuses its parameters or files (exit code {code}); see its last "
                "line above. All nodes are stopped"
            )
        if code < 0:  # killed: what still writes to it would wait for its answer
            self._dead_ports.look(close=True)
        ends = self._ends.setdefault(name, [])
        ends.append(now)
        delay = pause(sum(now - at < SETTLED for at in ends))
        process = restarted(self._first[name], len(ends))
        where = f", recording to {process.parameters['output']}" if name == LAST else ""
        text = f"node {name} ended with exit code {code}; it is restarted in {delay:g} s"
        return Restart(process, delay, text + where)

    def _flag(self, name: str) -> bool:
        text = self._given[name].lower()
        if text not in ("true", "1", "false", "0"):
            raise SloshBringupError(f"{name}:={self._given[name]}: must be true or false")
        return text in ("true", "1")

    def _added(self) -> dict[str, str]:
        """Returns what is given for the nodes of add-ons that are started, by key."""
        return {
            key: self._given[key]
            for key, one in cell_nodes().items()
            if (self._given[key] if one.choices else self._flag(key))
        }

    def _setup(self) -> CellSetup:
        """Creates the cell's set-up from the launch arguments and checks its files."""
        default, given = default_setup(), self._given
        # As a cell file, so that both take the same and refuse the same.
        text = (
            f"namespace: {json.dumps(given['namespace'])}\nremap:\n  {given['remap']}\n"
            f"calibration:\n  {given['cameras']}\n"
        )
        try:
            source = parse_yaml(text, "launch arguments")
        except SloshFileError as error:
            wrong = "remap" if given["cameras"] == "{}" else "cameras"
            raise SloshBringupError(f"{wrong}:={given[wrong]}: {error}") from None
        namespace = read_namespace(source, source.value["namespace"])
        model = Path(given["model"] or default.model).absolute()
        calibration: Path | None = self._calibration()
        cameras = read_cameras(source, model)
        if cameras:
            calibration = cameras.pop("", None)
        setup = CellSetup(
            model=model,
            calibration=None if "camera" in self._absent else calibration,
            parameters=Path(given["parameters"] or default.parameters).absolute(),
            namespace=namespace,
            remap=read_remap(source, namespace, source.value["remap"], tuple(cameras)),
            force=Path(given["force"]).absolute() if given["force"] else None,
            cameras=cameras,
            added=self._added(),
        )
        if setup.force is not None and not setup.force.is_file():
            raise SloshBringupError(f"force:={given['force']}: no such file")
        read_tray(setup.model)
        first = [calibration] if calibration and "camera" not in self._absent else []
        for path in (*first, *cameras.values()):
            read_any_calibration(path)
        check_parameter_file(setup.parameters, namespace, setup.camera_nodes.values())
        return setup

    def _calibration(self) -> Path:
        """Returns the camera's calibration, also of a camera that only the simulated cell has."""
        return Path(self._given["calibration"] or config_folder() / "camera.yaml").absolute()

    def _own(self, setup: CellSetup, bag: Path) -> list[NodeProcess]:
        """Returns the enabled processes among recorder, estimator, camera and monitor."""
        more: dict[str, dict[str, str]] = {}
        if self._given["input"]:
            more["estimator"] = {"input": self._given["input"]}
        if self._given["input"] == JOINTS:
            more["estimator"] |= self._robot()
        for key in setup.added:
            node = cell_nodes()[key]
            robot = self._robot().items()
            more[node.node] = {name: given for name, given in robot if name in node.takes}
        return [
            _with(process, more.get(process.name, {}))
            for process in setup.processes(bag)
            if process.name not in self._absent
        ]

    def _services(self, setup: CellSetup) -> list[NodeProcess]:
        """Returns the processes of the enabled services and web pages."""
        model = {"model": str(setup.model)}
        robot = self._robot()
        used = self._flag("predict") or any(
            "urdf" in cell_nodes()[key].takes for key in setup.added
        )
        if self._given["input"] != JOINTS and (len(robot) == 1 or (robot and not used)):
            raise SloshBringupError(
                "urdf:=, tool_frame:= and predict:=true must be given together"
            )
        if len(robot) == 1:  # the joints' robot is described by a topic
            robot = {}
        own = {"predict": ("predictor", model | robot), "watch": ("watch", {})}
        own |= {"plan": ("planner", model), "markers": ("markers", {})}
        return [
            NodeProcess(name, [setup.parameters], parameters, setup.remap)
            for argument, (name, parameters) in own.items()
            if self._flag(argument)
        ]

    def _robot(self) -> dict[str, str]:
        """Returns the launch arguments that describe the robot."""
        found = {name: self._given[name] for name in ("urdf", "tool_frame") if self._given[name]}
        if "urdf" in found:
            found["urdf"] = str(Path(found["urdf"]).absolute())
        return found

    def _simulated(self, setup: CellSetup) -> NodeProcess:
        """Returns the simulated cell's process, which waits until other nodes are ready."""
        motion = self._given["motion"]
        if motion.endswith(TABLE_ENDINGS):
            motion = str(Path(motion).absolute())
        return NodeProcess(
            "cell",
            [setup.parameters],
            {
                "motion": motion,
                "calibration": str(self._calibration()),
                "wait_for": ",".join(
                    one.name for one in setup.processes(Path()) if one.name not in self._absent
                ),
                "readers": str(2 - len(self._absent)),
            },
            setup.remap,
        )


def package_of(process: NodeProcess) -> str:
    """Returns the name of the ROS package that contains a node's program."""
    return module_of(process.name).partition(".")[0]


def time_to_stop(process: NodeProcess) -> float:
    """Returns how long a node may take to end before it is killed [s]."""
    return STOP_TIMEOUT if process.name == LAST else 5.0


def typed_parameters(process: NodeProcess) -> dict[str, Any]:
    """Returns the parameters set for a node, converted to their declared types.

    Raises:
        SloshBringupError: a value is refused; one line.
    """
    specs = {
        spec.name: spec for spec in importlib.import_module(module_of(process.name)).PARAMETERS
    }
    values: dict[str, Any] = {}
    for name, text in process.parameters.items():
        spec = specs.get(name)
        if text in ("true", "false"):
            values[name] = text == "true"
        else:
            values[name] = text if spec is None else type(spec.default)(text)
        reason = spec.refusal(values[name]) if spec else None
        if reason:
            raise SloshBringupError(f"{process.name}: {reason}")
    return values


def _with(process: NodeProcess, more: Mapping[str, str]) -> NodeProcess:
    return replace(process, parameters={**process.parameters, **more})


def _recording_to(process: NodeProcess, bag: Path) -> NodeProcess:
    return _with(process, {"output": str(bag)}) if process.name == LAST else process
