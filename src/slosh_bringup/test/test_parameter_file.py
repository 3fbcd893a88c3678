"""Tests a cell's parameter file: its effect and errors for invalid entries."""

import pytest
import rclpy

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import read_setup
from slosh_bringup.parameter_file import check_parameter_file
from slosh_bringup.processes import config_folder
from slosh_estimator.nodes.monitor_node import MonitorNode

DOMAIN = 36


@pytest.fixture
def write(tmp_path):
    """Returns a function that writes a parameter file and a cell file that refers to it."""

    def write(text, namespace="/slosh"):
        config = config_folder()
        (tmp_path / "parameters.yaml").write_text(text)
        (tmp_path / "cell.yaml").write_text(
            f"model: {config / 'model.yaml'}\ncalibration: {config / 'camera.yaml'}\n"
            f"parameters: parameters.yaml\nnamespace: {namespace}\n"
        )
        return tmp_path / "cell.yaml"

    return write


FORMS = [
    ("/slosh", "/**: {ros__parameters: {hold: 0.7}}"),
    ("/slosh", "/**: {monitor: {ros__parameters: {hold: 0.7}}}"),
    ("/slosh", "/**/monitor: {ros__parameters: {hold: 0.7}}"),
    ("/slosh", "/slosh/monitor: {ros__parameters: {hold: 0.7}}"),
    ("/slosh", "slosh: {monitor: {ros__parameters: {hold: 0.7}}}"),
    ("/slosh", "/slosh: {'*': {ros__parameters: {hold: 0.7}}}"),
    ("/slosh", "/*/monitor: {ros__parameters: {hold: 0.7}}"),
    ("/slosh", "/slosh/**: {ros__parameters: {hold: 0.7}}"),
    ("/", "monitor: {ros__parameters: {hold: 0.7}}"),
    ("/left/cell", "/left/**/monitor: {ros__parameters: {hold: 0.7}}"),
    # ROS takes them in the order in which they stand.
    (
        "/slosh",
        "/**: {ros__parameters: {hold: 0.5}}\n/**/monitor: {ros__parameters: {hold: 0.7}}",
    ),
]


@pytest.mark.parametrize(("namespace", "text"), FORMS)
def test_a_file_sets_what_it_names_and_leaves_the_rest(write, namespace, text):
    setup = read_setup(write(text, namespace))
    check_parameter_file(setup.parameters, setup.namespace)
    values = started(setup)
    assert values["hold"] == 0.7
    assert (values["measured_limit"], values["estimated_limit"]) == (0.02, 0.02)
    assert values["timeout"] == 0.3


def test_a_value_of_another_type_is_refused_and_not_the_default(write):
    setup = read_setup(write("/**/monitor: {ros__parameters: {measured_limit: '1'}}"))
    with pytest.raises(ValueError, match=r"measured_limit = '1': type double is needed"):
        started(setup)


def started(setup):
    """Returns the parameters of a monitor node started as the cell starts it."""
    (process,) = (one for one in setup.processes(config_folder()) if one.name == "monitor")
    words = process.command(setup.namespace)
    rclpy.init(args=words[words.index("--ros-args") :], domain_id=DOMAIN)
    try:
        node = MonitorNode()
        values = {name: value.value for name, value in node.get_parameters_by_prefix("").items()}
        node.destroy_node()
        return values
    finally:
        rclpy.shutdown()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("/**:\n  monitr: {ros__parameters: {hold: 0.7}}", "2: /**/monitr: no such node"),
        ("monitor: {ros__parameters: {hold: 0.7}}", "1: /monitor: no such node (known: /slosh/"),
        ("/other/**: {ros__parameters: {hold: 0.7}}", "1: /other/**: no such node"),
        (
            "/**/monitor:\n  ros__parameters:\n    measured_limt: 0.01",
            "3: /**/monitor: unknown parameter 'measured_limt' (meant measured_limit?)",
        ),
        ("/**/camera: {ros__parameters: {hold: 0.7}}", "unknown parameter 'hold' (known: cal"),
        ("/**: {ros__parameters: {a: {b: 1}}}", "unknown parameter 'a.b'"),
        (
            "/**/monitor: {ros__parameters: {hold: 1.0}}\n"
            "/**/monitor: {ros__parameters: {timeout: 1.0}}",
            "2: /**/monitor: given twice",
        ),
        (
            "/**/monitor:\n  ros__parameters:\n    hold: 0.7\n    hold: 0.8",
            "4: /**/monitor.ros__parameters.hold: given twice",
        ),
        (
            "/**/estimator:\n  ros__parameters:\n    sensor_rotation: [0, 0.5, 0]",
            "3: sensor_rotation: ROS does not accept a list of integers and floats; write 0.0",
        ),
        ("/**/recorder: {ros__parameters: {output: /data}}", "output has no effect here"),
        ("/**: {ros__parameters: {model: x.yaml}}", "model has no effect here"),
        ("ros__parameters: {hold: 0.7}", "1: ros__parameters needs a node's name above it"),
        ("/**/monitor: {hold: 0.7}", "1: a mapping from node names with ros__parameters"),
        ("/**/monitor:\n  ros__parameters:", "2: a mapping from names of parameters is needed"),
        ("[1, 2]", "1: a mapping from node names"),
        ("{? [a] : 1}", "1: a key is a collection; keys are names"),
        ("/**: {", "not YAML"),
    ],
)
def test_what_would_do_nothing_is_refused_with_its_line(write, text, said):
    setup = read_setup(write(text))
    with pytest.raises(SloshBringupError) as caught:
        check_parameter_file(setup.parameters, setup.namespace)
    assert str(caught.value).startswith(str(setup.parameters))
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "/**: {ros__parameters: {use_sim_time: true}}",
        "/**/camera: {ros__parameters: {qos_overrides: {/x: {publisher: {depth: 5}}}}}",
        (config_folder() / "cell.yaml").read_text(),
    ],
)
def test_what_ros_itself_knows_and_a_copy_of_the_shipped_file_pass(write, text):
    setup = read_setup(write(text))
    check_parameter_file(setup.parameters, setup.namespace)


def test_a_topic_that_no_node_knows_is_not_remapped(write):
    path = write("")
    text = path.read_text()
    path.write_text(text + "remap: {acel: /arm/accel}")
    with pytest.raises(SloshBringupError, match=r"no such topic: 'acel' \(known: accel, "):
        read_setup(path)
    path.write_text(text + "remap: {/slosh/accel: /arm/accel}")
    assert read_setup(path).remap == {"/slosh/accel": "/arm/accel"}
