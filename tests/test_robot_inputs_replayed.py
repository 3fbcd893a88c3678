"""Tests replays of robots' bags without a cell: transforms, odometry, twists, joints."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bag.reader import BagReader
from slosh_bringup.cli.main import main
from slosh_estimator.monitor_settings import MonitorSettings
from slosh_estimator.validity import settling_seconds
from slosh_model.model_text import parse_model
from slosh_model.simulate import Inputs, simulate
from slosh_motion.inputs.robot import available
from slosh_motion.recorded.sources import find_sources
from slosh_motion.tables.motion_table import read_motion_table
from slosh_replay.replay import replay_bag
from slosh_replay.split import split_bag
from slosh_testing.joint_driver import (
    JOINTS,
    RAIL_URDF,
    acceleration,
    cup_position,
    quaternion,
    swung,
)

BEGIN = 1_700_000_000_000_000_000
TEXT = """
container: {shape: cylinder, radius: 0.05, fill_height: 0.07}
effects: [{name: vertical_acceleration}, {name: surface_nonlinearity, alpha: 0.58}]
"""
TIMES = np.arange(-0.5, 2.8, 0.004)
STEP = 1e-5
Message = tuple[str, str, int, Any]


class Maker:
    """Creates messages of the types that a robot's bag may contain."""

    def __init__(self) -> None:
        self.definitions = Definitions()
        for kind in (
            "sensor_msgs/msg/JointState", "tf2_msgs/msg/TFMessage", "nav_msgs/msg/Odometry",
            "geometry_msgs/msg/TwistStamped", "std_msgs/msg/String", "sensor_msgs/msg/Imu",
            "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/AccelStamped",
        ):  # fmt: skip
            self.definitions.hash(kind)
        self._types = self.definitions.typestore.types

    def header(self, t: float, frame: str = "") -> Any:
        stamp = BEGIN + round(t * 1e9)
        time = self._types["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
        return self._types["std_msgs/msg/Header"](time, frame)

    def vector(self, x: float, y: float, z: float, kind: str = "Vector3") -> Any:
        return self._types[f"geometry_msgs/msg/{kind}"](x, y, z)

    def turn(self, x: float, y: float, z: float, w: float) -> Any:
        return self._types["geometry_msgs/msg/Quaternion"](x, y, z, w)

    def twist(self, t: float) -> Any:
        """Returns the velocity message of the cup, in world axes."""
        before, after = (cup_position(*swung(t + k * STEP)) for k in (-1, 1))
        yaw = [float(swung(t + k * STEP)[1:3].sum()) for k in (-1, 1)]
        linear = ((after - before) / (2 * STEP)).tolist()
        rate = (yaw[1] - yaw[0]) / (2 * STEP)
        return self._types["geometry_msgs/msg/Twist"](
            self.vector(*linear), self.vector(0.0, 0.0, rate)
        )

    def joints(self) -> Iterator[Message]:
        text = self._types["std_msgs/msg/String"](RAIL_URDF.replace('"cup"', '"container"'))
        yield "/robot_description", "std_msgs/msg/String", BEGIN - 10**9, text
        for t in TIMES.tolist():
            kind = "sensor_msgs/msg/JointState"
            none, at = np.empty(0), swung(t)
            state = self._types[kind](self.header(t), list(JOINTS), at, none, none)
            yield "/joint_states", kind, BEGIN + round(t * 1e9), state

    def transforms(self) -> Iterator[Message]:
        kind = "tf2_msgs/msg/TFMessage"

        def link(t: float, parent: str, child: str, place: Any, turn: Any) -> Any:
            moved = self._types["geometry_msgs/msg/Transform"](
                self.vector(*place), self.turn(*turn)
            )
            stamped = self._types["geometry_msgs/msg/TransformStamped"]
            return stamped(self.header(t, parent), child, moved)

        straight = (0.0, 0.0, 0.0, 1.0)
        fixed = link(0.0, "tool", "container", (0.0, 0.0, 0.1), straight)
        # It is recorded late, as by a recorder that hears latched messages last.
        yield "/tf_static", kind, BEGIN + 10**9, self._types[kind]([fixed])
        for t in TIMES.tolist():
            rail, *angles = swung(t).tolist()
            x, y, z = cup_position(0.0, *angles).tolist()
            links = [
                link(t, "carriage", "tool", (x, y, z - 0.1), quaternion(*angles)),
                link(t, "world", "carriage", (0.0, rail, 0.0), straight),
            ]
            yield "/tf", kind, BEGIN + round(t * 1e9), self._types[kind](links)

    def twists(self) -> Iterator[Message]:
        kind = "geometry_msgs/msg/TwistStamped"
        for t in TIMES.tolist():
            message = self._types[kind](self.header(t, "world"), self.twist(t))
            yield "/robot/twist", kind, BEGIN + round(t * 1e9), message

    def poses(self) -> Iterator[Message]:
        """Yields the cup's poses in the frame of the robot's base, turned by 0.7 rad."""
        kind, half = "geometry_msgs/msg/PoseStamped", 0.35
        transform = self._types["geometry_msgs/msg/Transform"](
            self.vector(1.0, 2.0, 0.0), self.turn(0.0, 0.0, np.sin(half), np.cos(half))
        )
        link = self._types["geometry_msgs/msg/TransformStamped"](
            self.header(0.0, "world"), "base", transform
        )
        fixed = "tf2_msgs/msg/TFMessage"
        yield "/tf_static", fixed, BEGIN, self._types[fixed]([link])
        c, s = np.cos(2 * half), np.sin(2 * half)
        for t in TIMES.tolist():
            x, y, z = (cup_position(*swung(t)) - (1.0, 2.0, 0.0)).tolist()
            place = self.vector(c * x + s * y, c * y - s * x, z, "Point")
            pose = self._types["geometry_msgs/msg/Pose"](place, self.turn(0.0, 0.0, 0.0, 1.0))
            message = self._types[kind](self.header(t, "base"), pose)
            yield "/slosh/pose", kind, BEGIN + round(t * 1e9), message

    def riding(self) -> Iterator[Message]:
        """Yields transforms of a moving carriage, and the cup's poses in its frame."""
        kind, tree = "geometry_msgs/msg/PoseStamped", "tf2_msgs/msg/TFMessage"
        straight = self.turn(0.0, 0.0, 0.0, 1.0)
        for t in TIMES.tolist():
            rail, *angles = swung(t).tolist()
            transform = self._types["geometry_msgs/msg/Transform"](
                self.vector(0.0, rail, 0.0), straight
            )
            link = self._types["geometry_msgs/msg/TransformStamped"](
                self.header(t, "world"), "carriage", transform
            )
            stamp = BEGIN + round(t * 1e9)
            yield "/tf", tree, stamp, self._types[tree]([link])
            place = self.vector(*cup_position(0.0, *angles).tolist(), "Point")
            pose = self._types["geometry_msgs/msg/Pose"](place, straight)
            message = self._types[kind](self.header(t, "carriage"), pose)
            yield "/slosh/pose", kind, stamp, message

    def imu(self) -> Iterator[Message]:
        """Yields messages of an IMU that is mounted upside down and turned."""
        kind, half = "sensor_msgs/msg/Imu", 0.35
        # Container <- sensor: a half turn about x, then 0.7 rad about z.
        turn = self.turn(np.cos(half), np.sin(half), 0.0, 0.0)
        transform = self._types["geometry_msgs/msg/Transform"](self.vector(0.0, 0.0, 0.1), turn)
        link = self._types["geometry_msgs/msg/TransformStamped"](
            self.header(0.0, "container"), "imu_link", transform
        )
        fixed = "tf2_msgs/msg/TFMessage"
        yield "/tf_static", fixed, BEGIN, self._types[fixed]([link])
        none = np.zeros(9)
        felt = acceleration(TIMES) + np.array([0.0, 0.0, 9.81])
        rotation = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w])
        for t, force in zip(TIMES.tolist(), rotation.inv().apply(felt).tolist(), strict=True):
            message = self._types[kind](
                self.header(t, "imu_link"), self.turn(0.0, 0.0, 0.0, 1.0), none,
                self.vector(0.0, 0.0, 0.0), none, self.vector(*force), none,
            )  # fmt: skip
            yield "/imu/data/imu", kind, BEGIN + round(t * 1e9), message

    def beside(self) -> Iterator[Message]:
        """Yields messages of an accelerometer beside the cup, and transforms at half its rate."""
        kind, tree = "geometry_msgs/msg/AccelStamped", "tf2_msgs/msg/TFMessage"
        arm, turned = np.array([0.1, -0.05, 0.08]), Rotation.from_euler("xyz", [np.pi, 0.0, 0.5])
        moved, none = self._types["geometry_msgs/msg/Transform"], self.vector(0.0, 0.0, 0.0)
        stamped = self._types["geometry_msgs/msg/TransformStamped"]
        mount = moved(self.vector(*arm.tolist()), self.turn(*turned.as_quat().tolist()))
        fixed = stamped(self.header(0.0, "container"), "sensor", mount)
        yield "/tf_static", tree, BEGIN, self._types[tree]([fixed])

        def place(t: float) -> Any:
            return cup_position(*swung(t)) + cup_turn(t).apply(arm)

        for k, t in enumerate(TIMES.tolist()):
            stamp = BEGIN + round(t * 1e9)
            if k % 2 == 0:
                x, y, z = cup_position(*swung(t)).tolist()
                pose = moved(self.vector(x, y, z), self.turn(*quaternion(*swung(t)[1:])))
                link = stamped(self.header(t, "world"), "container", pose)
                yield "/tf", tree, stamp, self._types[tree]([link])
            change = (place(t - 1e-4) - 2.0 * place(t) + place(t + 1e-4)) / 1e-8
            felt = (cup_turn(t) * turned).inv().apply(change)
            accel = self._types["geometry_msgs/msg/Accel"](self.vector(*felt.tolist()), none)
            yield "/slosh/accel", kind, stamp, self._types[kind](self.header(t, "sensor"), accel)

    def odometry(self) -> Iterator[Message]:
        kind, none = "nav_msgs/msg/Odometry", np.zeros(36)
        for t in TIMES.tolist():
            twist, yaw = self.twist(t), float(swung(t)[1:3].sum())
            c, s, v = np.cos(yaw), np.sin(yaw), twist.linear
            own = self.vector(float(c * v.x + s * v.y), float(c * v.y - s * v.x), v.z)
            twist = self._types["geometry_msgs/msg/Twist"](own, twist.angular)
            pose = self._types["geometry_msgs/msg/Pose"](
                self.vector(*cup_position(*swung(t)).tolist(), "Point"),
                self.turn(0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)),
            )
            with_ = self._types["geometry_msgs/msg/PoseWithCovariance"](pose, none)
            moved = self._types["geometry_msgs/msg/TwistWithCovariance"](twist, none)
            message = self._types[kind](self.header(t, "odom"), "base_link", with_, moved)
            yield "/odom", kind, BEGIN + round(t * 1e9), message


def cup_turn(t: float) -> Rotation:
    """Returns the attitude of the cup, world ← cup."""
    return Rotation.from_quat(quaternion(*swung(t)[1:]))


def write(folder: Path, made: Callable[[Maker], Iterator[Message]]) -> Path:
    maker = Maker()
    entries = sorted(made(maker), key=lambda entry: entry[2])
    with BagWriter(folder, maker.definitions, {}) as writer:
        for topic, kind, log_ns, message in entries:
            writer.add_topic(topic, kind)
            data = bytes(maker.definitions.typestore.serialize_cdr(message, kind))
            writer.write(topic, data, log_ns)
    return folder


def truth() -> float:
    """Returns the highest wave [m] that the true acceleration causes."""
    fine = np.arange(TIMES[0], TIMES[-1], 0.001)
    response, _ = simulate(parse_model(TEXT), Inputs(fine, acceleration(fine)))
    return float(response.msh.max())


ROBOTS = [
    pytest.param(
        Maker.joints, "joints", "/joint_states",
        marks=pytest.mark.skipif(not available(), reason="no Pinocchio (requirements/joints.txt)"),
    ),
    (Maker.transforms, "tf", "/tf"),
    (Maker.odometry, "odometry", "/odom"),
    (Maker.twists, "twist", "/robot/twist"),
    (Maker.poses, "pose", "/slosh/pose"),
    (Maker.riding, "pose", "/slosh/pose"),
    (Maker.imu, "imu", "/imu/data/imu"),
    (Maker.beside, "accel", "/slosh/accel"),
]  # fmt: skip


@pytest.mark.parametrize(("made", "kind", "topic"), ROBOTS)
def test_the_input_of_a_bag_is_found_and_gives_the_true_motion(
    tmp_path, made, kind, topic, capsys
):
    bag = write(tmp_path / "bag", made)
    table = tmp_path / "motion.csv"
    assert main(["export", str(bag), "--motion", "--absolute", "-o", str(table)]) == 0
    assert f"from {topic}, no heights" in capsys.readouterr().out
    motion = read_motion_table(table)
    true = acceleration(motion.t - BEGIN * 1e-9)
    assert np.abs(motion.acceleration - true).max() < 0.01 * np.abs(true).max()
    shifted = Inputs(motion.t - motion.t[0], motion.acceleration)
    found = simulate(parse_model(TEXT), shifted)[0].msh.max()
    assert found == pytest.approx(truth(), rel=0.01)
    result = replay_bag(bag, parse_model(TEXT))
    assert result.counters["samples_used"] > 0.97 * len(TIMES)
    assert [line for line in result.warnings if "no measured" not in line] == []


def test_a_bag_with_joints_and_without_a_description_says_what_to_give(tmp_path, capsys):
    bag = write(
        tmp_path / "bag",
        lambda maker: (one for one in maker.joints() if one[0] != "/robot_description"),
    )
    (tmp_path / "model.yaml").write_text(TEXT)
    words = ["replay", str(bag), "--model", str(tmp_path / "model.yaml")]
    assert main(words) == 2
    said = capsys.readouterr().err
    assert "holds joint states in /joint_states and no robot description" in said
    if not available():
        return
    (tmp_path / "robot.urdf").write_text(RAIL_URDF)
    robot = ["--urdf", str(tmp_path / "robot.urdf")]
    assert main([*words, *robot, "--tool-frame", "spoon"]) == 2
    assert "no link 'spoon' (it has world" in capsys.readouterr().err
    assert main([*words, *robot, "--tool-frame", "cup"]) == 0


def test_transforms_are_taken_before_joints_that_nobody_describes(tmp_path):
    def both(maker: Maker) -> Iterator[Message]:
        yield from (one for one in maker.joints() if one[0] == "/joint_states")
        yield from maker.transforms()

    bag = write(tmp_path / "bag", both)
    assert find_sources(bag, BagReader(bag)).kind == "tf"


def test_a_chain_that_is_not_in_the_bag_is_told(tmp_path, capsys):
    bag = write(
        tmp_path / "bag", lambda maker: (one for one in maker.transforms() if one[0] == "/tf")
    )
    (tmp_path / "model.yaml").write_text(TEXT)
    assert main(["replay", str(bag), "--model", str(tmp_path / "model.yaml")]) == 2
    assert "the transforms do not connect 'world' with 'container'" in capsys.readouterr().err


def unfilled(message: Any) -> None:
    message.twist.twist.linear.x = message.twist.twist.linear.y = 0.0


def in_the_parent_s_axes(message: Any) -> None:
    linear, turn = message.twist.twist.linear, message.pose.pose.orientation
    x, y, _ = Rotation.from_quat([0.0, 0.0, turn.z, turn.w]).apply([linear.x, linear.y, 0.0])
    linear.x, linear.y = float(x), float(y)


def in_another_unit(message: Any) -> None:
    linear = message.twist.twist.linear
    linear.x, linear.y = 3.28 * linear.x, 3.28 * linear.y


def spoiled(folder: Path, spoil: Callable[[Any], None]) -> Path:
    """Writes a bag of odometry whose messages were changed."""

    def made(maker: Maker) -> Iterator[Message]:
        for entry in maker.odometry():
            spoil(entry[3])
            yield entry

    return write(folder, made)


@pytest.mark.parametrize(
    ("spoil", "word"),
    [(unfilled, "stays zero"), (in_the_parent_s_axes, "axes of header.frame_id")],
)
def test_odometry_is_read_by_its_pose_where_the_twist_is_wrong(tmp_path, spoil, word, capsys):
    bag, table, model = (tmp_path / name for name in ("bag", "motion.csv", "model.yaml"))
    model.write_text(TEXT)
    spoiled(bag, spoil)
    assert main(["export", str(bag), "--motion", "-o", str(table)]) == 0
    assert f"{word}" in capsys.readouterr().err
    (remark,) = read_motion_table(table).remarks
    assert word in remark.text
    assert remark.text.endswith("its poses are used")
    assert not remark.wrong
    words = ["simulate", str(model), str(table), "-o", str(tmp_path / "heights.csv"), "--json"]
    assert main(words) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["peak"] == pytest.approx(truth(), rel=0.01)
    assert f"note: {table}: the twist of the odometry" in said.err
    assert word in said.err
    result = replay_bag(bag, parse_model(TEXT))
    assert any(word in line for line in result.warnings), result.warnings
    assert result.counters["samples_used"] > 0.97 * len(TIMES)


def test_what_a_bag_s_input_contradicts_is_told_of_its_table_too(tmp_path, capsys):
    bag, table, model = (tmp_path / name for name in ("bag", "motion.csv", "model.yaml"))
    model.write_text(TEXT)
    spoiled(bag, in_another_unit)
    assert main(["export", str(bag), "--motion", "-o", str(table)]) == 0
    assert "unit, axes or clock" in capsys.readouterr().err
    assert main(["simulate", str(model), str(table), "-o", str(tmp_path / "h.csv")]) == 1
    assert "warning" in (said := capsys.readouterr().err)
    assert "unit, axes or clock" in said
    assert main(["import", "table", str(table), "-o", str(tmp_path / "again")]) == 0
    assert "unit, axes or clock" in capsys.readouterr().err
    warnings = replay_bag(bag, parse_model(TEXT)).warnings
    assert any("unit, axes or clock" in line for line in warnings), warnings


def test_a_bag_that_begins_in_motion_says_for_how_long_nothing_is_known(tmp_path, capsys):
    bag, table, model = (tmp_path / name for name in ("bag", "motion.csv", "model.yaml"))
    model.write_text(TEXT)
    begin = BEGIN + 400_000_000
    write(bag, lambda maker: (one for one in maker.odometry() if one[2] >= begin))
    assert main(["export", str(bag), "--motion", "-o", str(table)]) == 0
    assert "begins in motion" in capsys.readouterr().err
    assert main(["simulate", str(model), str(table), "-o", str(tmp_path / "h.csv")]) == 1
    seconds = round(settling_seconds(parse_model(TEXT)))
    assert f"the first {seconds} s with this model" in capsys.readouterr().err
    result = replay_bag(bag, parse_model(TEXT))
    assert any("begins in motion" in line for line in result.warnings), result.warnings


def counted(message: Any) -> None:
    """Stamps a message by a count at a period that is a quarter too long."""
    since = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec - BEGIN
    stamp = BEGIN + since * 5 // 4
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)


def stuck(message: Any) -> None:
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(BEGIN, 10**9)


def test_stamps_that_do_not_run_as_the_log_times_are_named(tmp_path, capsys):
    table, model = tmp_path / "motion.csv", tmp_path / "model.yaml"
    model.write_text(TEXT)
    bag = spoiled(tmp_path / "bag", counted)
    assert main(["export", str(bag), "--motion", "-o", str(table)]) == 0
    assert "counted at a rate that is not real" in capsys.readouterr().err
    assert main(["simulate", str(model), str(table), "-o", str(tmp_path / "h.csv")]) == 1
    assert "counted at a rate that is not real" in capsys.readouterr().err
    warnings = replay_bag(bag, parse_model(TEXT)).warnings
    assert any("counted at a rate that is not real" in line for line in warnings), warnings
    bag = spoiled(tmp_path / "stuck", stuck)
    assert main(["export", str(bag), "--motion", "-o", str(tmp_path / "no.csv")]) == 2
    assert "have the same stamp" in capsys.readouterr().err


def test_stamps_that_were_never_filled_are_refused(tmp_path, capsys):
    def made(maker: Maker) -> Iterator[Message]:
        for topic, kind, log_ns, message in maker.odometry():
            message.header.stamp.sec = message.header.stamp.nanosec = 0
            yield topic, kind, log_ns, message

    bag, model = write(tmp_path / "bag", made), tmp_path / "model.yaml"
    model.write_text(TEXT)
    assert main(["replay", str(bag), "--model", str(model)]) == 2
    assert "stamped 0" in capsys.readouterr().err
    assert main(["export", str(bag), "--motion", "-o", str(tmp_path / "motion.csv")]) == 2
    assert "stamped 0" in capsys.readouterr().err


def tilting(maker: Maker) -> Iterator[Message]:
    """Yields transforms of a container that tilts by 14 degrees where it stands."""
    kind = "tf2_msgs/msg/TFMessage"
    for t in TIMES.tolist():
        half = 0.5 * np.radians(14.0) * min(max(t / 0.5, 0.0), 1.0)
        turn = maker.turn(0.0, float(np.sin(half)), 0.0, float(np.cos(half)))
        moved = maker._types["geometry_msgs/msg/Transform"](maker.vector(0.0, 0.0, 0.8), turn)
        stamped = maker._types["geometry_msgs/msg/TransformStamped"]
        link = stamped(maker.header(t, "world"), "container", moved)
        yield "/tf", kind, BEGIN + round(t * 1e9), maker._types[kind]([link])


def test_a_replay_feels_the_tilt_as_the_live_cell_does(tmp_path):
    plain = parse_model(TEXT)
    bag = write(tmp_path / "bag", tilting)
    blind = MonitorSettings(camera=False)
    found = replay_bag(bag, plain, blind)
    told = replay_bag(bag, plain.with_gravity_tilt(), blind)
    assert found.model == told.model
    heights = [np.nanmax(one.heights[one.model.name]) for one in (found, told)]
    assert heights[0] == heights[1] > 0.005
    assert any("gravity_tilt is added" in line for line in found.warnings), found.warnings
    assert not any("gravity_tilt" in line for line in told.warnings)


def test_transforms_whose_clock_was_set_back_are_split(tmp_path):
    """The fixed transforms count for both parts, whatever the recorder noted of them."""

    def twice(maker: Maker) -> Iterator[Message]:
        for shift in (0, 5 * 10**9):
            for topic, kind, log_ns, message in maker.transforms():
                if topic == "/tf" or not shift:
                    yield topic, kind, log_ns + shift * (topic == "/tf"), message

    bag = write(tmp_path / "bag", twice)
    parts = split_bag(bag, tmp_path / "parts", lambda count: None)
    assert len(parts) == 2
    used = [replay_bag(part, parse_model(TEXT)).counters["samples_used"] for part in parts]
    assert used[1] > 0.9 * used[0] > 500


@pytest.mark.parametrize("ahead", [0.0, 0.3])
def test_a_slow_localisation_neither_leads_nor_holds_up(tmp_path, ahead):
    """World to odom comes at 10 Hz, stamped ahead, and is corrected once at rest."""

    def made(maker: Maker) -> Iterator[Message]:
        kind = "tf2_msgs/msg/TFMessage"
        yield from (one for one in maker.transforms() if one[0] == "/tf_static")
        frames = [one for one in maker.transforms() if one[0] == "/tf"]
        for k, (topic, _, log_ns, message) in enumerate(frames):
            message.transforms[1].header.frame_id = "odom"
            if k % 25 == 0:
                moved = maker._types["geometry_msgs/msg/Transform"](
                    maker.vector(0.0, 0.0, 0.0), maker.turn(0.0, 0.0, 0.0, 1.0)
                )
                stamped = maker._types["geometry_msgs/msg/TransformStamped"]
                t = 1e-9 * (log_ns - BEGIN) + ahead
                link = stamped(maker.header(t, "world"), "odom", moved)
                yield topic, kind, log_ns, maker._types[kind]([link])
            yield topic, kind, log_ns + 1, message

    bag, model = write(tmp_path / "bag", made), parse_model(TEXT)
    result = replay_bag(bag, model, MonitorSettings(camera=False))
    assert np.nanmax(result.heights[result.model.name]) == pytest.approx(truth(), rel=0.02)
    assert result.counters["gaps"] == 0


@pytest.mark.parametrize("made", [Maker.riding, Maker.beside])
def test_transforms_stamped_ahead_of_what_they_place_are_named(tmp_path, made, capsys):
    def ahead(maker: Maker) -> Iterator[Message]:
        for topic, kind, log_ns, message in made(maker):
            if topic == "/tf":
                (link,) = message.transforms
                link.header = maker.header(1e-9 * (log_ns - BEGIN) + 0.1, link.header.frame_id)
            yield topic, kind, log_ns, message

    bag, table, model = (tmp_path / name for name in ("bag", "motion.csv", "model.yaml"))
    model.write_text(TEXT)
    write(bag, ahead)
    assert main(["export", str(bag), "--motion", "-o", str(table)]) == 0
    assert "are stamped 100 ms ahead of their arrival" in capsys.readouterr().err
    assert main(["simulate", str(model), str(table), "-o", str(tmp_path / "h.csv")]) == 1
    assert "are stamped 100 ms ahead of their arrival" in capsys.readouterr().err
