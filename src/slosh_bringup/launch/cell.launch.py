"""Starts the nodes of a slosh cell on a robot's topics, with an installation of ROS 2.

Without one, `slosh cell --config cell.yaml` starts the same nodes.

ros2 launch slosh_bringup cell.launch.py
ros2 launch slosh_bringup cell.launch.py simulate:=true
ros2 launch slosh_bringup cell.launch.py model:=/path/model.yaml calibration:=/path/camera.yaml
ros2 launch slosh_bringup cell.launch.py model:=/path/model.yaml camera:=false input:=imu

A node that ends is started again, after a longer pause each time. One that refuses its parameters
or files ends the launch.
"""

from __future__ import annotations

import time
from datetime import datetime

from launch import LaunchContext, LaunchDescription, LaunchDescriptionEntity
from launch.actions import DeclareLaunchArgument, LogInfo, OpaqueFunction, TimerAction
from launch.events.process import ProcessExited
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from slosh_bringup.launched_cell import (
    ARGUMENTS,
    LaunchedCell,
    package_of,
    time_to_stop,
    typed_parameters,
)
from slosh_bringup.processes import NodeProcess


def start(context: LaunchContext) -> list[LaunchDescriptionEntity]:
    """Creates the launch actions from the arguments; an invalid argument ends the launch."""
    given = {one.name: LaunchConfiguration(one.name).perform(context) for one in ARGUMENTS}
    told: list[str] = []
    cell = LaunchedCell(given, datetime.now(), told.append)
    return [
        *(LogInfo(msg=line) for line in told),
        *(node(cell, process) for process in cell.processes),
    ]


def node(cell: LaunchedCell, process: NodeProcess) -> Node:
    """Creates a launch action that runs a node and restarts it when it ends."""

    def ended(event: ProcessExited, context: LaunchContext) -> list[LaunchDescriptionEntity]:
        if context.is_shutdown:
            return []
        restart = cell.ended(process.name, event.returncode, time.monotonic())
        if restart is None:
            return [LogInfo(msg=f"the cell goes on without node {process.name}")]
        again = TimerAction(period=restart.delay, actions=[node(cell, restart.process)])
        return [LogInfo(msg=restart.text), again]

    # launch would read a file that is called 2026 as a number.
    own = {
        name: ParameterValue(value, value_type=str) if isinstance(value, str) else value
        for name, value in typed_parameters(process).items()
    }
    return Node(
        package=package_of(process),
        executable=process.name,
        name=process.name,
        namespace=cell.namespace,
        parameters=[*map(str, process.parameter_files), own],
        remappings=list(process.remappings.items()),
        output="screen",
        on_exit=ended,
        sigterm_timeout=str(time_to_stop(process)),
    )


def generate_launch_description() -> LaunchDescription:
    """Declares the arguments and starts the nodes."""
    arguments = [
        DeclareLaunchArgument(one.name, default_value=one.default, description=one.description)
        for one in ARGUMENTS
    ]
    return LaunchDescription([*arguments, OpaqueFunction(function=start)])
