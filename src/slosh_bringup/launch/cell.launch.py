"""Starts the nodes of a slosh cell on a robot's topics.

ros2 launch slosh_bringup cell.launch.py
ros2 launch slosh_bringup cell.launch.py simulate:=true
ros2 launch slosh_bringup cell.launch.py model:=/path/model.yaml calibration:=/path/camera.yaml
"""

from pathlib import Path

from launch import LaunchContext, LaunchDescription, Substitution
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution, PythonExpression
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

from slosh_bringup.parameter_file import check_parameter_file


def check(context: LaunchContext) -> None:
    """Refuses a parameter file with names that no node has: ROS would say nothing of them."""
    parameters, namespace = (
        LaunchConfiguration(name).perform(context) for name in ("parameters", "namespace")
    )
    check_parameter_file(Path(parameters), namespace)


def generate_launch_description() -> LaunchDescription:
    """Declares the arguments and the nodes."""
    config = PathJoinSubstitution([FindPackageShare("slosh_bringup"), "config"])
    arguments = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, default, description in (
            ("namespace", "/slosh", "namespace of all nodes and topics"),
            (
                "parameters",
                [config, "/cell.yaml"],
                "ROS parameter file: what differs from the defaults",
            ),
            ("model", [config, "/model.yaml"], "model of the container and its liquid"),
            ("calibration", [config, "/camera.yaml"], "calibration of the camera"),
            ("output", "bag", "folder of the recorded bag"),
            ("record", "true", "record all topics of the cell"),
            ("predict", "false", "answer what planned motions will do: the service predict"),
            ("watch", "false", "serve the operator's page to this machine, on port 8765"),
            ("plan", "false", "plan motions: the service plan, the action plan_motion"),
            ("simulate", "false", "play a motion instead of listening to a robot"),
            ("motion", "c3", "motion of the simulated cell"),
        )
    ]
    parameters = LaunchConfiguration("parameters")
    simulate = IfCondition(LaunchConfiguration("simulate"))
    record = IfCondition(LaunchConfiguration("record"))
    predict = IfCondition(LaunchConfiguration("predict"))
    watch = IfCondition(LaunchConfiguration("watch"))
    plan = IfCondition(LaunchConfiguration("plan"))

    # The motion begins when those that are started are ready.
    is_recorded = ["'", LaunchConfiguration("record"), "'.lower() in ('true', '1')"]
    others = "estimator,camera,monitor"
    wait_for = PythonExpression([f"'recorder,{others}' if ", *is_recorded, f" else '{others}'"])
    readers = PythonExpression(["2 if ", *is_recorded, " else 1"])

    def node(
        package: str, name: str, condition: IfCondition | None = None, **own: Substitution
    ) -> Node:
        return Node(
            package=package,
            executable=name,
            name=name,
            namespace=LaunchConfiguration("namespace"),
            parameters=[parameters, own],
            condition=condition,
            output="screen",
        )

    model = LaunchConfiguration("model")
    calibration = LaunchConfiguration("calibration")
    return LaunchDescription(
        [
            *arguments,
            OpaqueFunction(function=check),
            node("slosh_bag", "recorder", record, output=LaunchConfiguration("output")),
            node("slosh_camera", "camera", calibration=calibration),
            node("slosh_estimator", "estimator", model=model),
            node("slosh_estimator", "monitor"),
            node("slosh_estimator", "predictor", predict, model=model),
            node("slosh_bringup", "watch", watch),
            node("slosh_estimator", "planner", plan, model=model),
            node(
                "slosh_bringup",
                "cell",
                simulate,
                motion=LaunchConfiguration("motion"),
                calibration=calibration,
                wait_for=wait_for,
                readers=readers,
            ),
        ]
    )
