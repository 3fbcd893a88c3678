"""Tests the camera node over DDS with raw, compressed and invalid images."""

import math

import cv2
import numpy as np
import pytest
import rclpy
import yaml
from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from hypothesis import given
from hypothesis import strategies as st
from rclpy.duration import Duration
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from slosh_base.files.nanoseconds import SECOND
from slosh_camera.errors import SloshCameraError
from slosh_camera.measurement import Flag, Measurement
from slosh_camera.nodes.camera_input import FrameGaps
from slosh_camera.nodes.camera_node import CameraNode, Complaints, surface_message
from slosh_msgs.msg import ContainerChange, FreeSurface
from slosh_msgs_py import images, qos, topics
from slosh_msgs_py.conversions import filled
from slosh_msgs_py.errors import SloshMessageError
from slosh_msgs_py.stamps import to_nanoseconds
from slosh_testing.hearing_robot import Graph

PATIENCE = 20.0
FRAME = SECOND // 60
# A height of the surface at the wall, towards the right of the image [m].
HEIGHT = 0.01


class Rig(Graph):
    """The camera node together with a node that acts as driver and as listener."""

    def __init__(self, calibration, **parameters):
        words = ["--ros-args", "-r", "__ns:=/rig", "-p", f"calibration:={calibration}"]
        for name, value in parameters.items():
            words += ["-p", f"{name}:={value}"]
        rclpy.init(args=words)
        super().__init__("rig")

    def start(self, kind=Image, topic=topics.IMAGE, quality=qos.IMAGE_OUT, container=""):
        node = self.add(CameraNode())
        surfaces = topics.of_container(topics.FREE_SURFACE, container)
        self.heights = self.listen(FreeSurface, surfaces)
        self.reports = self.listen(DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS)
        self.driver = self.node.create_publisher(kind, topic, quality)
        self.until(
            lambda: (
                self.driver.get_subscription_count() == 1
                and node.count_subscribers(surfaces) == 1
                and node._publisher.get_subscription_count() == 1
            )
        )

    def measure(self, message):
        """Publishes an image and returns the node's measurement."""
        self.heights.clear()
        self.driver.publish(message)
        self.until(lambda: self.heights)
        return self.heights[-1]

    def report(self, condition):
        """Returns values and status of the first diagnostics that meet a condition."""
        self.reports.clear()

        def found():
            return [
                (status, values)
                for report in self.reports
                for status in report.status
                if condition(status, values := {pair.key: pair.value for pair in status.values})
            ]

        self.until(found)
        return found()[0]

    def close(self):
        super().close()
        rclpy.shutdown()


@pytest.fixture
def make_rig(tmp_path, make_scene):
    scene = make_scene(camera_height=0.08)
    rotation, translation = scene.extrinsics()
    calibration = tmp_path / "camera.yaml"
    document = {
        "image_width": scene.width,
        "image_height": scene.height,
        "camera_name": "rig",
        "camera_matrix": {
            "rows": 3,
            "cols": 3,
            "data": [
                *(scene.focal, 0.0, 0.5 * (scene.width - 1)),
                *(0.0, scene.focal, 0.5 * (scene.height - 1)),
                *(0.0, 0.0, 1.0),
            ],
        },
        "distortion_model": "plumb_bob",
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": [0.0] * 5},
        "container": {
            "radius": scene.radius,
            "fill_height": scene.fill_height,
            "wall_thickness": 0.002,
            "wall_refractive_index": 1.0,
            "rim_height": scene.rim_height,
        },
        "pose": {"rotation": rotation.ravel().tolist(), "translation": translation.tolist()},
    }
    calibration.write_text(yaml.safe_dump(document))
    rigs = []

    def make(**parameters):
        rigs.append(Rig(parameters.pop("calibration", calibration), **parameters))
        return rigs[-1]

    yield make
    for rig in rigs:
        rig.close()


@pytest.fixture
def picture(make_scene):
    return make_scene(camera_height=0.08).draw(HEIGHT, 0.0)


@pytest.mark.parametrize("executor", ["events", "single"])
@pytest.mark.parametrize("encoding", ["mono8", "bgr8"])
def test_a_raw_image_is_measured(make_rig, picture, monkeypatch, encoding, executor):
    monkeypatch.setenv("SLOSH_EXECUTOR", executor)
    rig = make_rig(container_frame="cup")
    rig.start()
    pixels = picture if encoding == "mono8" else cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR)
    answer = rig.measure(images.image_message(pixels, encoding, 5 * SECOND + 7, "camera_optical"))
    assert to_nanoseconds(answer.header.stamp) == 5 * SECOND + 7
    assert answer.header.frame_id == "cup"
    assert answer.flags == Flag.NONE
    assert answer.msh == pytest.approx(HEIGHT, abs=5e-4)
    assert answer.fitted_msh == pytest.approx(HEIGHT, abs=5e-4)
    assert answer.fitted_msh_stddev > 0.0
    assert answer.sh_right == pytest.approx(HEIGHT, abs=1e-3)
    assert answer.sh_left == pytest.approx(-HEIGHT, abs=1e-3)
    assert len(answer.profile_height) == len(answer.profile_azimuth) > 100


def test_the_distance_to_the_rim_is_told_where_it_is_known():
    found = Measurement(0, msh=0.012)
    assert surface_message(found, "container", 0.05).distance_to_rim == pytest.approx(0.038)
    assert math.isnan(surface_message(found, "container", None).distance_to_rim)


def test_a_driver_that_speaks_of_another_lens_is_told(make_rig, picture):
    rig = make_rig()
    rig.start()
    heard, camera = rig.nodes[-1]._driver, rig.nodes[-1]._calibration.view.camera
    driver = rig.nodes[0].create_publisher(CameraInfo, topics.CAMERA_INFO, qos.IMAGE_OUT)
    rig.until(lambda: driver.get_subscription_count() == 1)
    longer = f"camera_info gives fx = {1.1 * camera.fx:.6g} px, the calibration {camera.fx:.6g} px"
    wide = {"distortion_model": "rational_polynomial", "d": [-0.3] + [0.0] * 7}
    for width, k, lens, words in (
        (
            80,
            camera.matrix,
            {},
            f"camera_info gives 80 x {camera.height} pixels, the calibration ",
        ),
        (camera.width, camera.matrix, {}, ""),
        (camera.width, camera.matrix * 1.1, {}, longer),
        (camera.width, camera.matrix * 0.0, {}, ""),  # not calibrated
        (
            camera.width,
            camera.matrix,
            wide,
            "camera_info gives a lens plumb_bob that moves pixels",
        ),
    ):
        info = CameraInfo(width=width, height=camera.height, k=k.ravel(), **lens)
        driver.publish(info)
        rig.until(lambda words=words: bool(heard.contradiction) == bool(words))
        rig.measure(images.image_message(picture, "mono8", SECOND, "camera_optical"))
        status, _ = rig.report(lambda status, _, words=words: words in status.message)
        if words:
            assert status.level == DiagnosticStatus.WARN
            assert "calibrate again" in status.message


def test_a_compressed_image_is_measured(make_rig, picture):
    rig = make_rig(transport="compressed")
    rig.start(CompressedImage, topics.IMAGE_COMPRESSED)
    data = cv2.imencode(".jpg", picture)[1].tobytes()
    answer = rig.measure(images.compressed_message(data, "jpeg", SECOND, "camera_optical"))
    assert answer.msh == pytest.approx(HEIGHT, abs=1e-3)
    answer = rig.measure(images.compressed_message(data[:-500], "jpeg", SECOND, "camera_optical"))
    assert answer.flags == FreeSurface.BAD_IMAGE


def broken(picture, change):
    message = images.image_message(picture, "mono8", 2 * SECOND, "camera_optical")
    change(message)
    return message


def _cut(message):
    message.data = message.data[:-1]


def _empty(message):
    message.height = message.width = message.step = 0
    message.data = []


def _one_pixel(message):
    message.height = message.width = message.step = 1
    message.data = [0]


BROKEN = {
    "cut": _cut,
    "empty": _empty,
    "one pixel": _one_pixel,
    "encoding": lambda message: setattr(message, "encoding", "16UC1"),
    "step": lambda message: setattr(message, "step", 7),
    "huge": lambda message: setattr(message, "height", 2**32 - 1),
}


def test_the_node_lives_on_with_bad_images(make_rig, picture):
    rig = make_rig()
    rig.start()
    for name, change in BROKEN.items():
        answer = rig.measure(broken(picture, change))
        assert answer.flags == FreeSurface.BAD_IMAGE, name
        assert np.isnan(answer.msh), name
        assert to_nanoseconds(answer.header.stamp) == 2 * SECOND
    good = images.image_message(picture, "mono8", 3 * SECOND, "camera_optical")
    assert rig.measure(good).flags == Flag.NONE
    status, values = rig.report(lambda status, values: "measurement total" in values)
    assert values["flag BAD_IMAGE"] == str(len(BROKEN))
    assert status.level == DiagnosticStatus.ERROR
    assert status.message.startswith("image:")


def test_an_impossible_stamp_is_dropped_and_counted(make_rig, picture):
    rig = make_rig()
    rig.start()
    wild = images.image_message(picture, "mono8", 0, "camera_optical")
    wild.header.stamp = Time(sec=-1, nanosec=5)
    rig.driver.publish(wild)
    status, _ = rig.report(lambda status, values: values.get("dropped: impossible stamp") == "1")
    assert status.level == DiagnosticStatus.ERROR
    good = images.image_message(picture, "mono8", SECOND, "camera_optical")
    assert to_nanoseconds(rig.measure(good).header.stamp) == SECOND
    _, values = rig.report(lambda status, values: values.get("image total") == "2")
    assert values["measurement total"] == "1"


@pytest.mark.parametrize("executor", ["events", "single"])
def test_the_newest_image_is_measured_and_the_others_give_way(
    make_rig, picture, monkeypatch, executor
):
    monkeypatch.setenv("SLOSH_EXECUTOR", executor)
    rig = make_rig()
    rig.start()
    for number in range(1, 7):
        shown = cv2.add(picture, number)  # no two alike: they would pass for frozen
        rig.driver.publish(images.image_message(shown, "mono8", number * FRAME, "optical"))
        if number == 1:
            rig.until(lambda: rig.heights)
    # All have arrived before the node gets to see any.
    assert rig.driver.wait_for_all_acked(Duration(seconds=PATIENCE))
    rig.until(lambda: to_nanoseconds(rig.heights[-1].header.stamp) == 6 * FRAME)
    assert [to_nanoseconds(answer.header.stamp) for answer in rig.heights] == [FRAME, 6 * FRAME]
    status, values = rig.report(lambda status, values: values.get("measurement total") == "2")
    assert values["dropped images"] == "4"
    assert status.level == DiagnosticStatus.WARN
    assert "they arrive faster than they can be measured" in status.message


def test_images_offered_as_best_effort_are_read(make_rig, picture):
    rig = make_rig()
    rig.start(quality=qos.IMAGE_IN)
    answer = rig.measure(images.image_message(picture, "mono8", SECOND, "camera_optical"))
    assert answer.msh == pytest.approx(HEIGHT, abs=1e-3)


def test_a_still_image_is_learnt_at_start(make_rig, make_scene, tmp_path):
    scene = make_scene(camera_height=0.08)
    still = tmp_path / "still.png"
    cv2.imwrite(str(still), scene.draw(0.0, 0.0, level=0.002))
    rig = make_rig(still_image=still)
    rig.start()
    raised = scene.draw(HEIGHT, 0.0, level=0.002)
    answer = rig.measure(images.image_message(raised, "mono8", SECOND, "camera_optical"))
    assert answer.msh == pytest.approx(HEIGHT, abs=1e-3)


def test_a_level_that_has_changed_is_told(make_rig, make_scene, tmp_path):
    """Regression test: 2 mm of added liquid were measured as a wave of 17 mm."""
    scene, still = make_scene(camera_height=0.08), tmp_path / "still.png"
    cv2.imwrite(str(still), scene.draw())
    rig = make_rig(still_image=still)
    rig.start()
    filled = images.image_message(scene.draw(level=0.002), "mono8", SECOND, "camera_optical")
    answer = rig.measure(filled)
    assert answer.flags == FreeSurface.LEVEL_CHANGED
    assert answer.msh == pytest.approx(0.002, abs=3e-4)
    status, values = rig.report(lambda status, _: "level has changed" in status.message)
    assert status.level == DiagnosticStatus.WARN
    assert "by +2.0 ± 0.1 mm since the still image" in status.message
    assert values["flag LEVEL_CHANGED"] == "1"


def test_a_doubtful_still_image_is_told_of_at_start(make_rig, make_scene, tmp_path, capfd):
    """The liquid has the same grey level as the surroundings of the container."""
    scene, still = make_scene(camera_height=0.08), tmp_path / "still.png"
    image = scene.draw()
    image[scene.height // 2 :][image[scene.height // 2 :] == scene.background] = scene.liquid
    cv2.imwrite(str(still), image)
    rig = make_rig(still_image=still)
    rig.start()
    assert "dye the liquid" in capfd.readouterr().err


def test_complaints_do_not_flood():
    lines = []
    complaints = Complaints(lines.append)
    for number in range(600):
        complaints.add("wrong encoding", number * FRAME)
        complaints.add("wrong step", number * FRAME)
    assert lines == ["wrong encoding", "wrong step"] * 2
    assert complaints.last == "wrong step"
    for number in range(600):
        complaints.add(f"{number} bytes", 20 * SECOND + number)
    assert len(lines) == 9


def test_missing_images_are_told(make_rig, picture):
    rig = make_rig(frame_rate=60.0)
    rig.start()
    for number in (1, 2, 5, 6):
        rig.measure(images.image_message(picture, "mono8", number * FRAME, "camera_optical"))
    _, values = rig.report(lambda status, values: values.get("image total") == "4")
    assert values["missing images"] == "2"


@pytest.mark.parametrize(
    ("parameters", "error", "match"),
    [
        ({"calibration": "/nowhere.yaml"}, SloshCameraError, "/nowhere.yaml"),
        ({"still_image": "/nowhere.png"}, SloshCameraError, "/nowhere.png"),
        ({"transport": "theora"}, SloshMessageError, "one of raw, compressed"),
        ({"frame_rate": "fast"}, SloshMessageError, "type double is needed, not string"),
        ({"frame_rate": "-1.0"}, SloshMessageError, r"must lie in \[0, 1000\]"),
    ],
)
def test_a_wrong_parameter_is_refused_in_one_line(make_rig, parameters, error, match):
    rig = make_rig(**parameters)
    with pytest.raises(error, match=match) as caught:
        rig.start()
    assert "\n" not in str(caught.value)


@given(
    st.integers(20, 200),
    st.lists(st.tuples(st.integers(0, 10), st.integers(-1, 1)), min_size=9, max_size=60),
)
def test_learnt_or_stated_the_missing_frames_are_counted(rate, frames):
    """The frame rate is known after forty periods; later, frames are dropped."""
    period = SECOND // rate
    learnt, stated = FrameGaps(), FrameGaps(float(rate))
    number = 0
    gaps = [0] * 40 + [lost if index % 2 else 0 for index, (lost, _) in enumerate(frames)]
    jitters = [0] * 40 + [jitter for _, jitter in frames]
    expected = 0
    for lost, jitter in zip(gaps, jitters, strict=True):
        number += 1 + lost
        expected += lost
        stamp = number * period + jitter * period // 50
        learnt.add(stamp)
        stated.add(stamp)
    assert learnt.missing == stated.missing == expected


@pytest.mark.parametrize("jump", [-5 * SECOND, 0, 2 * SECOND])
def test_pauses_and_clocks_that_jump_are_no_loss(jump):
    gaps = FrameGaps(60.0)
    stamp = 10 * SECOND
    for step in (FRAME, FRAME, jump, FRAME, FRAME):
        stamp += step
        gaps.add(stamp)
    assert gaps.missing == 0


def container(scene, stamp_ns, rise=0.0, **fields):
    """Returns the estimator's message about a cup that is filled higher by `rise` [m]."""
    fill = scene.fill_height + rise
    text = f"container: {{shape: cylinder, radius: {scene.radius}, fill_height: {fill}}}"
    told = {"present": True, "model": text, "fill_height": fill, **fields}
    return filled(ContainerChange, stamp_ns=stamp_ns, **told)


def test_heights_are_above_the_level_of_the_fill_that_is_told(make_rig, make_scene):
    scene = make_scene(camera_height=0.08)
    rig = make_rig()
    rig.start()
    changes = rig.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    refilled = scene.draw(HEIGHT, 0.0, level=0.008)
    answer = rig.measure(images.image_message(refilled, "mono8", SECOND, "camera_optical"))
    assert answer.msh == pytest.approx(HEIGHT + 0.008, abs=1e-3)
    changes.publish(container(scene, 2 * SECOND, 0.008))
    rig.until(lambda: rig.nodes[-1]._looking._next_ns == 2 * SECOND)
    before = rig.measure(images.image_message(refilled, "mono8", 2 * SECOND, "camera_optical"))
    after = rig.measure(images.image_message(refilled, "mono8", 2 * SECOND + 1, "camera_optical"))
    assert before.msh == pytest.approx(HEIGHT + 0.008, abs=1e-3)
    assert after.msh == pytest.approx(HEIGHT, abs=5e-4)
    changes.publish(container(scene, 3 * SECOND, present=False))
    rig.until(lambda: rig.nodes[-1]._looking._next_ns == 3 * SECOND)
    empty = rig.measure(images.image_message(refilled, "mono8", 4 * SECOND, "camera_optical"))
    assert empty.flags == Flag.NOT_FOUND
    status, _ = rig.report(lambda status, values: "gripper is empty" in status.message)
    assert status.level == DiagnosticStatus.OK


@pytest.mark.parametrize(
    "text", ["container: 7", "container: {shape: cylinder, radius: 0.6, fill_height: 0.07}"]
)
def test_a_container_that_cannot_be_measured_is_said_so(make_rig, make_scene, picture, text):
    rig = make_rig()
    rig.start()
    changes = rig.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    changes.publish(container(make_scene(camera_height=0.08), SECOND, model=text))
    rig.until(lambda: rig.nodes[-1]._looking._next_ns == SECOND)
    answer = rig.measure(images.image_message(picture, "mono8", 2 * SECOND, "camera_optical"))
    assert answer.flags == Flag.NOT_FOUND
    status, _ = rig.report(lambda status, values: "cannot be measured" in status.message)
    assert status.level == DiagnosticStatus.ERROR
    changes.publish(container(make_scene(camera_height=0.08), 3 * SECOND))
    rig.until(lambda: rig.nodes[-1]._looking._next_ns == 3 * SECOND)
    answer = rig.measure(images.image_message(picture, "mono8", 4 * SECOND, "camera_optical"))
    assert answer.msh == pytest.approx(HEIGHT, abs=5e-4)


def tray_change(scene, stamp_ns, place, **rises):
    """Returns a change of a place on a tray whose containers are filled higher by some metres."""
    models = {
        name: f"container: {{shape: cylinder, radius: {scene.radius}, "
        f"fill_height: {scene.fill_height + rise}, rim_height: {scene.rim_height}}}"
        for name, rise in rises.items()
    }
    entries = "".join(f"- {{name: {name}, model: {{{text}}}}}\n" for name, text in models.items())
    return filled(
        ContainerChange, stamp_ns=stamp_ns, present=True, model=models["left"], tray_place=place,
        tray=f"containers:\n{entries}",
    )  # fmt: skip


def test_a_camera_of_a_further_container_has_its_topics_and_follows_its_place(
    make_rig, make_scene
):
    scene = make_scene(camera_height=0.08)
    rig = make_rig(container="right")
    rig.start(topic="camera_right/image_raw", container="right")
    changes = rig.publisher(ContainerChange, topics.CONTAINER, qos.LATCHED_STREAM)
    looking = rig.nodes[-1]._looking

    def change(stamp_ns, place, **rises):
        changes.publish(tray_change(scene, stamp_ns, place, **rises))

    refilled = scene.draw(HEIGHT, 0.0, level=0.008)
    changes.publish(filled(ContainerChange, present=True))
    rig.until(lambda: not looking._is_first)
    answer = rig.measure(images.image_message(refilled, "mono8", SECOND, "camera_optical"))
    assert answer.header.frame_id == "right"
    assert answer.msh == pytest.approx(HEIGHT + 0.008, abs=1e-3)
    change(2 * SECOND, "left", left=0.008, right=0.001)  # another camera's
    change(3 * SECOND, "right", left=0.008, right=0.008)
    rig.until(lambda: looking._next_ns == 3 * SECOND)
    assert looking._now is looking._start
    after = rig.measure(images.image_message(refilled, "mono8", 4 * SECOND, "camera_optical"))
    assert after.msh == pytest.approx(HEIGHT, abs=5e-4)


def test_a_container_that_no_topic_can_carry_is_refused(make_rig):
    rig = make_rig(container="cup-2")
    with pytest.raises(SloshMessageError, match=r"rename it in tray\.yaml"):
        rig.start()
