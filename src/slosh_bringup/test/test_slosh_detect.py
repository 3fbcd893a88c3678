"""Tests `slosh detect`: sources, order, processes, pictures and invalid images."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from slosh_bag.bag_writer import BagWriter
from slosh_bag.definitions import Definitions
from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.cli.main import main
from slosh_bringup.detect.frame import SourceFrame
from slosh_bringup.detect.measuring import Result
from slosh_bringup.detect.pictures import PictureStrip, Worst
from slosh_bringup.detect.series import images_in, longest_series
from slosh_bringup.detect.source import open_source
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import format_calibration, read_calibration
from slosh_camera.measurement import Measurement
from slosh_camera.optics.box import Box, BoxView
from slosh_camera.optics.calibration import SideCalibration
from slosh_camera.optics.camera import Pose

CAMERA = str(config_folder() / "camera.yaml")
HEIGHTS = [0.004 + 0.002 * k for k in range(9)]
STORE = Definitions()


@pytest.fixture(scope="module")
def images():
    """Images of the simulated cup with the peak at the far side, at increasing heights."""
    renderer = CupRenderer(read_calibration(CAMERA).view)
    return [cv2.cvtColor(renderer.render(0.0, height), cv2.COLOR_GRAY2BGR) for height in HEIGHTS]


@pytest.fixture
def folder(tmp_path, images):
    path = tmp_path / "images"
    path.mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(path / f"frame_{number}.png"), image)
    return path


def detect(tmp_path, *words, camera=CAMERA):
    """Runs `slosh detect`; returns the exit code and the table."""
    output = tmp_path / "out.csv"
    code = main(["detect", *map(str, words), "--camera", str(camera), "-o", str(output)])
    table = np.genfromtxt(
        output, delimiter=",", names=True, dtype=None, encoding=None, ndmin=1, comments=None
    )
    return code, table


def refused(capsys, tmp_path, *words, camera=CAMERA):
    """Returns the one-line error of a failing `slosh detect` command."""
    output = tmp_path / "out.csv"
    words = ["detect", *map(str, words), "--camera", str(camera), "-o", str(output)]
    assert main(words) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = [line for line in captured.err.split("\n") if line.startswith("slosh")]
    (line,) = lines
    return line


def test_a_folder_gives_heights_in_natural_order(capsys, tmp_path, folder):
    for number in (9, 10):
        (folder / f"frame_{number}.png").write_bytes((folder / "frame_0.png").read_bytes())
    code, table = detect(tmp_path, folder, "--rate", "100")
    assert code == 0
    assert list(table["frame"]) == [f"frame_{number}.png" for number in range(11)]
    assert table["t"] == pytest.approx(np.arange(11) / 100)
    assert table["msh"][:9] == pytest.approx(HEIGHTS, abs=1e-3)
    assert table["fitted_msh"][:9] == pytest.approx(HEIGHTS, abs=1e-3)
    assert np.degrees(table["fitted_azimuth"][8]) == pytest.approx(90.0, abs=5.0)
    assert np.all(np.isnan(table["slope_angle"]))
    # The liquid cannot be back at rest within 10 ms.
    assert list(table["flags"]) == [""] * 9 + ["AMBIGUOUS", "FROZEN"]
    assert "11 of 11 images measured" in capsys.readouterr().out


@pytest.mark.long
def test_processes_do_not_change_a_number(tmp_path, folder, images):
    (folder / "frame_9.png").write_bytes(b"no image")
    cv2.imwrite(str(folder / "frame_10.png"), images[0])
    cv2.imwrite(str(folder / "frame_11.png"), images[0])
    tables = []
    for jobs in ("1", "2"):
        detect(tmp_path, folder, "--jobs", jobs)
        tables.append((tmp_path / "out.csv").read_text())
    assert tables[0] == tables[1]
    assert [line.split(",")[10] for line in tables[0].split()[-3:]] == ["BAD_IMAGE", "", "FROZEN"]


def test_the_longest_series_is_measured_and_the_rest_is_told(capsys, tmp_path, folder, images):
    for number in range(9):
        cv2.imwrite(str(folder / f"mask_{number}.png"), images[0])
    cv2.imwrite(str(folder / "calib.jpg"), images[0])
    _, table = detect(tmp_path, folder)
    assert list(table["frame"]) == [f"frame_{number}.png" for number in range(9)]
    told = capsys.readouterr().err
    assert "left out: 9 images mask_#.png, calib.jpg" in told


@pytest.mark.parametrize(
    ("names", "chosen"),
    [
        (["b_1.png", "b_2.png", "image_1.png", "image_2.png"], ["image_1.png", "image_2.png"]),
        (["cam1_1.png", "cam2_1.png", "cam2_2.png"], ["cam2_1.png", "cam2_2.png"]),
        (["a.png", "b.png"], ["a.png", "b.png"]),
        (["x 9.jpg", "x 10.jpg", ".x 11.jpg"], ["x 9.jpg", "x 10.jpg"]),
        (
            ["12-30-59 frame 1.png", "12-31-00 frame 2.png", "still.png"],
            ["12-30-59 frame 1.png", "12-31-00 frame 2.png"],
        ),
    ],
)
def test_files_that_belong_together(tmp_path, names, chosen):
    for name in names:
        (tmp_path / name).touch()
    files, note = longest_series(images_in(tmp_path))
    assert [file.name for file in files] == chosen
    assert bool(note) == (len(chosen) < len([name for name in names if name[0] != "."]))


def test_patterns_and_lists_of_images(tmp_path, folder):
    _, table = detect(tmp_path, folder / "frame_[123].png")
    assert list(table["frame"]) == ["frame_1.png", "frame_2.png", "frame_3.png"]
    _, table = detect(tmp_path, folder / "frame_3.png", folder / "frame_0.png")
    assert list(table["frame"]) == ["frame_0.png", "frame_3.png"]
    _, table = detect(tmp_path, folder / "frame_3.png")
    assert table["msh"] == pytest.approx([HEIGHTS[3]], abs=1e-3)


def write_video(path, images, codec="MJPG", rate=50.0):
    size = images[0].shape[1::-1]
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), rate, size)
    assert writer.isOpened()
    for image in images:
        writer.write(image)
    writer.release()
    return path


def test_a_video_and_what_is_left_of_one_that_was_cut(capsys, tmp_path, images):
    video = write_video(tmp_path / "movie.avi", images)
    code, table = detect(tmp_path, video)
    assert code == 0
    assert table["t"] == pytest.approx(np.arange(9) / 50)
    assert table["msh"] == pytest.approx(HEIGHTS, abs=1e-3)
    video.write_bytes(video.read_bytes()[: video.stat().st_size // 2])
    code, table = detect(tmp_path, video)
    assert code == 0
    assert 2 <= len(table) < 6
    assert table["msh"] == pytest.approx(HEIGHTS[: len(table)], abs=1e-3)
    assert "should have 9 images" in capsys.readouterr().err


def write_topics(folder, topics):
    """Writes a bag of images at 20 Hz; each topic has an encoding, pixel size and count."""
    make = STORE.typestore.types
    for name in ("std_msgs/msg/Header", "sensor_msgs/msg/Image"):
        STORE.hash(name)
    with BagWriter(folder) as bag:
        for topic, (encoding, size, stamped, images) in topics.items():
            bag.add_topic(topic, "sensor_msgs/msg/Image")
            for number, image in enumerate(images):
                at = 100 * 10**9 + number * 50_000_000
                sec, nanosec = divmod(at if stamped else 0, 10**9)
                stamp = make["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
                height, width = image.shape[:2]
                message = make["sensor_msgs/msg/Image"](
                    header=make["std_msgs/msg/Header"](stamp=stamp, frame_id="camera"),
                    height=height, width=width, encoding=encoding, is_bigendian=0,
                    step=size * width, data=np.frombuffer(image.tobytes(), np.uint8),
                )  # fmt: skip
                data = bytes(STORE.typestore.serialize_cdr(message, "sensor_msgs/msg/Image"))
                bag.write(topic, data, at)
    return folder


def test_images_without_a_stamp_have_the_recorders_time(capsys, tmp_path, images):
    bag = write_topics(tmp_path / "bag", {"/camera/image_raw": ("bgr8", 3, False, images)})
    code, table = detect(tmp_path, bag)
    assert code == 0
    assert table["t"] == pytest.approx(np.arange(9) / 20)
    assert "9 images have the stamp 0" in capsys.readouterr().err


def test_of_depth_and_colour_the_colours_are_measured(capsys, tmp_path, images):
    depth = [np.full(image.shape[:2], 900, "<u2") for image in images]
    topics = {
        "/camera/depth/image_raw": ("16UC1", 2, True, depth),
        "/camera/zcolor/image_raw": ("bgr8", 3, True, images),
    }
    bag = write_topics(tmp_path / "bag", topics)
    code, table = detect(tmp_path, bag)
    assert code == 0
    assert table["msh"] == pytest.approx(HEIGHTS, abs=1e-3)
    assert "left out: /camera/depth/image_raw (choose with --topic)" in capsys.readouterr().err
    code, table = detect(tmp_path, bag, "--topic", "/camera/depth/image_raw")
    assert code == 1
    assert np.isnan(table["msh"]).all()
    capsys.readouterr()
    line = refused(capsys, tmp_path, bag, "--topic", "/camera/image")
    assert "topics with images: /camera/depth/image_raw, /camera/zcolor/image_raw" in line


def write_bag(folder, images):
    """Writes a bag of images at 20 Hz, one of them invalid, and a second, shorter topic."""
    types = {
        name: STORE.hash(name) and STORE.typestore.types[name]
        for name in ("std_msgs/msg/Header", "sensor_msgs/msg/Image")
    }
    time = STORE.typestore.types["builtin_interfaces/msg/Time"]
    with BagWriter(folder) as bag:
        bag.add_topic("/camera/image_raw", "sensor_msgs/msg/Image")
        for number, image in enumerate(images):
            height, width = image.shape[:2]
            message = types["sensor_msgs/msg/Image"](
                header=types["std_msgs/msg/Header"](
                    stamp=time(sec=100, nanosec=number * 50_000_000), frame_id="camera"
                ),
                height=height,
                width=width,
                encoding="bgr8",
                is_bigendian=0,
                step=7 if number == 3 else 3 * width,
                data=np.ascontiguousarray(image).reshape(-1),
            )
            data = bytes(STORE.typestore.serialize_cdr(message, "sensor_msgs/msg/Image"))
            bag.write("/camera/image_raw", data, 10**11 + number)
    return folder


def test_a_bag_with_a_bad_message_and_a_damaged_one(capsys, tmp_path, images):
    bag = write_bag(tmp_path / "bag", images[:6])
    code, table = detect(tmp_path, bag)
    assert code == 0
    assert table["t"] == pytest.approx(np.arange(6) / 20)
    assert list(table["flags"]) == ["", "", "", "BAD_IMAGE", "", ""]
    assert table["msh"][[0, 1, 2, 4, 5]] == pytest.approx(
        np.array(HEIGHTS)[[0, 1, 2, 4, 5]], abs=1e-3
    )
    assert "step 7" in capsys.readouterr().err
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 3 // 4])
    output = tmp_path / "out.csv"
    code = main(["detect", str(bag), "--camera", CAMERA, "-o", str(output)])
    complaints = [
        line for line in capsys.readouterr().err.split("\n")
        if line.startswith("slosh detect") and "step 7" not in line
    ]  # fmt: skip
    assert code in (0, 2)
    assert len(complaints) == 1
    assert str(file.name) in complaints[0] or str(bag) in complaints[0]


@pytest.mark.long
def test_pictures_show_the_doubtful_ones_first(capsys, tmp_path, folder, images):
    cv2.imwrite(str(folder / "frame_4.png"), np.zeros_like(images[0]))
    words = ("--video", tmp_path / "v.mp4", "--strip", tmp_path / "s.png", "--worst")
    code, _ = detect(tmp_path, folder, *words, tmp_path / "w.png", 3)
    assert code == 0
    assert "9 images in" in capsys.readouterr().out
    capture = cv2.VideoCapture(str(tmp_path / "v.mp4"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == 9
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(60.0)
    strip, worst = (cv2.imread(str(tmp_path / name)) for name in ("s.png", "w.png"))
    assert strip.shape[1] == 4 * 480
    assert worst.shape[1] == 3 * 480
    # The black image comes first, the others show a bright background.
    centre = worst[worst.shape[0] // 3 : worst.shape[0] // 2]
    assert np.median(centre[:, 100:380]) < 20
    assert np.median(centre[:, 580:860]) > 100


class _Sheet:
    def write(self, results):
        self.names = [result.frame.name for result, _ in results]
        return ""


def test_sheets_hold_few_images_of_many(tmp_path):
    calibration = read_calibration(CAMERA)
    strip, worst = (kind(tmp_path / "x.png", calibration, 4) for kind in (PictureStrip, Worst))
    sheets = {strip: _Sheet(), worst: _Sheet()}
    for number in range(1001):
        measurement = Measurement(0, msh=0.0, msh_stddev=1e-3 * (number * 7 % 1000))
        result = Result(SourceFrame(0, str(number), Path("none")), measurement, "")
        for sink in (strip, worst):
            sink._sheet = sheets[sink]
            sink.add(result)
            assert len(getattr(sink, "_kept", getattr(sink, "_heap", ()))) <= 16
    strip.finish()
    worst.finish()
    places = [int(name) for name in sheets[strip].names]
    assert len(places) == 4
    assert places[0] == 0
    assert min(np.diff(places)) > 200
    assert sheets[worst].names == ["857", "714", "571", "428"]


def test_a_rectangular_container_seen_from_the_side(tmp_path):
    camera = read_calibration(CAMERA).view.camera
    pose = Pose(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), [0.0, 0.0, 0.45])
    view = BoxView(camera, pose, Box(0.1, 0.06, rim_height=0.12))
    folder = tmp_path / "side"
    folder.mkdir()
    slopes = [0.0, 0.1, -0.2]
    for number, slope in enumerate(slopes):
        x = np.array([-0.05, 0.05, 0.05, -0.05])
        corners = view.project_face(x, [-0.05 * slope, 0.05 * slope, -0.06, -0.06])
        image = np.full((4 * camera.height, 4 * camera.width), 200, np.uint8)
        cv2.fillPoly(image, [np.rint((corners + 0.5) * 4.0 - 0.5).astype(int)], 50)
        small = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        cv2.imwrite(str(folder / f"frame_{number}.png"), small)
    calibration = tmp_path / "side.yaml"
    calibration.write_text(format_calibration(SideCalibration(view)))
    code, table = detect(tmp_path, folder, "--strip", tmp_path / "s.png", camera=calibration)
    assert code == 0
    assert table["slope_angle"] == pytest.approx(np.arctan(slopes), abs=5e-3)
    assert table["msh"] == pytest.approx(0.05 * np.abs(slopes), abs=5e-4)
    assert table["sh_left"] == pytest.approx(-0.05 * np.array(slopes), abs=5e-4)
    assert cv2.imread(str(tmp_path / "s.png")) is not None


def test_the_summary_as_json(capsys, tmp_path, folder):
    (folder / "frame_9.png").write_bytes(b"")
    assert detect(tmp_path, folder, "--json")[0] == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["frames"] == 10
    assert facts["measured"] == 9
    assert facts["flags"] == {"BAD_IMAGE": 1}
    assert facts["msh_max"] == pytest.approx(HEIGHTS[-1], abs=1e-3)


def test_every_kind_of_garbage_is_flagged_with_one_line(capsys, tmp_path, images):
    folder = tmp_path / "garbage"
    folder.mkdir()
    good = cv2.imencode(".png", images[0])[1].tobytes()
    jpeg = cv2.imencode(".jpg", images[0])[1].tobytes()
    flipped = bytearray(good)
    flipped[len(good) // 2] ^= 255
    contents = {
        "0.png": good,
        "1.png": b"",
        "2.png": b"no image",
        "3.png": good[: len(good) // 2],
        "4.jpg": jpeg[: len(jpeg) // 2],
        "5.png": cv2.imencode(".png", np.zeros((1, 1), np.uint8))[1].tobytes(),
        "6.png": cv2.imencode(".png", images[0][:100])[1].tobytes(),
        "7.png": bytes(flipped),
    }
    for name, content in contents.items():
        (folder / name).write_bytes(content)
    capsys.readouterr()
    code, table = detect(tmp_path, *sorted(folder.iterdir()))
    assert code == 0
    assert list(table["flags"]) == [""] + ["BAD_IMAGE"] * 7
    assert np.isfinite(table["msh"]).tolist() == [True] + [False] * 7
    lines = capsys.readouterr().err.replace("\r", "\n").split("\n")
    told = [line for line in lines if line.startswith("slosh detect")]
    assert [any(name in line for line in told) for name in list(contents)[1:6]] == [True] * 5
    assert told[-1].endswith("see the table's flags")
    assert len(told) == 6


def test_a_source_without_images_is_named(capsys, tmp_path):
    (tmp_path / "texts").mkdir()
    (tmp_path / "texts" / "note.txt").write_text("no image")
    (tmp_path / "text.mp4").write_text("no movie")
    (tmp_path / "empty.mkv").touch()
    (tmp_path / "broken.mcap").write_bytes(b"\x89MCAP0\r\n" + b"\0" * 50)
    for name in ("texts", "nothing", "text.mp4", "empty.mkv", "broken.mcap", "none_*.png"):
        assert name in refused(capsys, tmp_path, tmp_path / name)


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (("--jobs", "0"), "--jobs 0"),
        (("--rate", "nan"), "--rate nan"),
        (("--rate", "-5"), "--rate -5"),
        (("--worst", "w.png", "none"), "--worst none"),
        (("--strip", "strip.txt"), "strip.txt"),
        (("--strip", "/nowhere/strip.png"), "/nowhere"),
        (("--video", "/nowhere/video.mp4"), "/nowhere"),
        (("--still", "/nowhere.png"), "/nowhere.png"),
    ],
)
def test_a_wrong_option_is_refused_before_the_work(capsys, tmp_path, folder, words, match):
    assert match in refused(capsys, tmp_path, folder, *words)


def test_a_source_is_read_as_it_is_needed(folder):
    source = open_source([str(folder)])
    assert source.total == 9
    (folder / "frame_8.png").unlink()
    assert next(source.frames).name == "frame_0.png"
