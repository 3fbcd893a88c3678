"""Tests that parameters of a node mean the same live and in a replay."""

from slosh_estimator.limits import Hysteresis
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.nodes import estimator_node, monitor_node
from slosh_motion.inputs.frames import SensorTransform
from slosh_motion.inputs.gate import GateSettings
from slosh_motion.inputs.inputs import InputSettings


def defaults(specs):
    return {spec.name: spec.default for spec in specs}


def test_parameters_mean_what_the_settings_hold():
    given = defaults(estimator_node.PARAMETERS)
    assert InputSettings.from_parameters(given) == InputSettings("accel", GateSettings())
    changed = {
        **given, "input": "imu", "max_gap": 0.1, "max_age": 0.2, "max_jump": 3.0, "pose_window": 7,
        "sensor_rotation": [0.1, 0.2, 0.3], "sensor_to_origin": [1.0, 2.0, 3.0],
        "world_frame": "map", "container_frame": "cup",
    }  # fmt: skip
    assert InputSettings.from_parameters(changed) == InputSettings(
        "imu",
        GateSettings(0.1, 0.2, 3.0),
        SensorTransform(0.1, 0.2, 0.3, (1.0, 2.0, 3.0)),
        7,
        ("map", "cup"),
    )


def test_the_monitors_parameters_mean_what_its_settings_hold():
    given = defaults(monitor_node.PARAMETERS)
    limits = {"measured_limit": 0.02, "estimated_limit": 0.02, "disagreement_limit": 0.01}
    assert MonitorSettings.from_parameters(given) == MonitorSettings(**limits)
    changed = {
        **given,
        "warn_share": 0.5,
        "release": 0.7,
        "hold": 0.3,
        "timeout": 0.2,
        "buffer": 1.0,
    }
    assert MonitorSettings.from_parameters(changed) == MonitorSettings(
        **limits, warn_share=0.5, hysteresis=Hysteresis(0.7, 300_000_000), timeout=0.2, buffer=1.0
    )
