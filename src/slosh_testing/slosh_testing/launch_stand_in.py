"""Replacement for `launch` and `launch_ros`, which have no Python wheels.

It takes what `ros2 launch` takes, with the same names, and runs the nodes as real processes:
their installed programs, with parameters in files. What it does when a node ends, when a timer is
due, and when a handler raises is what launch 3.4 (Jazzy) does.
"""

import importlib.util
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import ModuleType, SimpleNamespace

import yaml
from ament_index_python.packages import get_package_prefix

LAUNCH_FILE = Path(__file__).resolve().parents[2] / "slosh_bringup/launch/cell.launch.py"
PATIENCE = 60.0


class Entity:
    """Base class of everything that a launch description can contain."""


class LaunchDescription(Entity):
    def __init__(self, initial_entities=None):
        self.entities = list(initial_entities or [])


class DeclareLaunchArgument(Entity):
    def __init__(self, name, *, default_value=None, description=None, choices=None):
        self.name, self.default_value, self.description = name, default_value, description


class LogInfo(Entity):
    def __init__(self, *, msg):
        self.msg = msg


class OpaqueFunction(Entity):
    def __init__(self, *, function, args=None, kwargs=None):
        self.function = function


class TimerAction(Entity):
    def __init__(self, *, period, actions, cancel_on_shutdown=True):
        assert isinstance(period, float)
        self.period, self.actions = period, actions


class Node(Entity):
    def __init__(
        self, *, executable, package=None, name=None, namespace=None, parameters=None,
        remappings=None, output="log", on_exit=None, sigterm_timeout="5",
    ):  # fmt: skip
        self.executable, self.package, self.name, self.namespace = (
            executable, package, name, namespace
        )  # fmt: skip
        self.parameters, self.remappings = parameters or [], remappings or []
        self.on_exit, self.sigterm_timeout = on_exit, float(sigterm_timeout)


class ParameterValue:
    def __init__(self, value, *, value_type=None):
        assert value_type is None or isinstance(value, value_type)
        self.value = value


class LaunchConfiguration:
    def __init__(self, variable_name, *, default=None):
        self.name = variable_name

    def perform(self, context):
        return context.launch_configurations[self.name]


MODULES = {
    "launch": {
        "LaunchContext": SimpleNamespace,
        "LaunchDescription": LaunchDescription,
        "LaunchDescriptionEntity": Entity,
    },
    "launch.actions": {
        "DeclareLaunchArgument": DeclareLaunchArgument,
        "LogInfo": LogInfo,
        "OpaqueFunction": OpaqueFunction,
        "TimerAction": TimerAction,
    },
    "launch.events": {},
    "launch.events.process": {"ProcessExited": SimpleNamespace},
    "launch.substitutions": {"LaunchConfiguration": LaunchConfiguration},
    "launch_ros": {},
    "launch_ros.actions": {"Node": Node},
    "launch_ros.parameter_descriptions": {"ParameterValue": ParameterValue},
}


def read_launch_file(monkeypatch):
    """Imports the launch file and returns its module."""
    for name, content in MODULES.items():
        module = ModuleType(name)
        vars(module).update(content)
        monkeypatch.setitem(sys.modules, name, module)
    spec = importlib.util.spec_from_file_location("cell_launch", LAUNCH_FILE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class Launch:
    """Runs `ros2 launch slosh_bringup cell.launch.py NAME:=VALUE…` in a folder.

    Attributes:
        said: what launch would print.
        nodes: running nodes, with their processes, by name.
        declared: the arguments, by name.
        started: each node that was started.
    """

    def __init__(self, module, folder, **arguments):
        self._folder = folder
        self._timers = []
        self._context = SimpleNamespace(launch_configurations=dict(arguments), is_shutdown=False)
        self.said, self.nodes, self.declared, self.started = [], {}, {}, []
        self.exit_code = 0
        self._handle(lambda: module.generate_launch_description().entities)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.shut_down()

    def until(self, condition):
        """Runs until a condition is met; fails after a timeout."""
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, self.said
            self._look()
            time.sleep(0.02)

    def shut_down(self):
        """Stops the launch as Ctrl-C does; returns the exit codes of the nodes by name."""
        self._context.is_shutdown = True
        self._timers.clear()
        for _, process in self.nodes.values():
            process.send_signal(signal.SIGINT)
        codes = {}
        for name, (node, process) in [*self.nodes.items()]:
            codes[name] = self._ended(process, node.sigterm_timeout)
        self._look()
        return codes

    @staticmethod
    def _ended(process, timeout):
        """Waits for a node to end; one that hangs is terminated, then killed, as launch does."""
        for send in (process.terminate, process.kill):
            try:
                return process.wait(timeout)
            except subprocess.TimeoutExpired:
                send()
        return process.wait()

    def _look(self):
        now = time.monotonic()
        for name, (node, process) in [*self.nodes.items()]:
            if process.poll() is not None and self.nodes.get(name, (0, 0))[1] is process:
                del self.nodes[name]
                event = SimpleNamespace(returncode=process.returncode)
                self._handle(lambda n=node, e=event: n.on_exit(e, self._context) or [])
        for due, actions in [*self._timers]:
            if due <= now:
                self._timers.remove((due, actions))
                self._handle(lambda a=actions: a)

    def _handle(self, make):
        try:
            for entity in make():
                self._visit(entity)
        except Exception as error:
            self.said.append(f"Caught exception in launch (see debug for traceback): {error}")
            self.exit_code = 1
            self.shut_down()

    def _visit(self, entity):
        if isinstance(entity, DeclareLaunchArgument):
            self.declared[entity.name] = entity
            self._context.launch_configurations.setdefault(entity.name, entity.default_value)
        elif isinstance(entity, LogInfo):
            self.said.append(entity.msg)
        elif isinstance(entity, OpaqueFunction):
            for one in entity.function(self._context):
                self._visit(one)
        elif isinstance(entity, TimerAction):
            self._timers.append((time.monotonic() + entity.period, entity.actions))
        else:
            self._start(entity)

    def _start(self, node):
        program = Path(get_package_prefix(node.package)) / "lib" / node.package / node.executable
        words = [str(program), "--ros-args", "-r", f"__node:={node.name}"]
        words += ["-r", f"__ns:={node.namespace}"]
        for number, entry in enumerate(node.parameters):
            words += ["--params-file", self._parameter_file(node, number, entry)]
        for pair in node.remappings:
            words += ["-r", ":=".join(pair)]
        self.started.append(node)
        with (self._folder / f"{node.name}.log").open("ab") as log:
            process = subprocess.Popen(words, stdout=log, stderr=log, cwd=self._folder)
        self.nodes[node.name] = node, process

    def _parameter_file(self, node, number, entry):
        if isinstance(entry, str):
            return entry
        values = {
            name: value.value if isinstance(value, ParameterValue) else value
            for name, value in entry.items()
        }
        path = self._folder / f"launch_params_{node.name}_{number}_{len(self.started)}"
        path.write_text(yaml.dump({"/**": {"ros__parameters": values}}))
        return str(path)
