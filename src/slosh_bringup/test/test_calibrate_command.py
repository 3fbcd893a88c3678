"""Tests that `slosh calibrate` writes a camera.yaml that `slosh detect` can read."""

import json
import struct
from dataclasses import replace

import cv2
import numpy as np
import pytest

from slosh_bringup.cell.renderer import CupRenderer
from slosh_bringup.cli.main import main
from slosh_bringup.processes import config_folder
from slosh_camera.calibrate.camera_file import read_calibration
from slosh_camera.calibrate.tuning import TUNING
from slosh_camera.optics.camera import look_at
from slosh_camera.optics.cup import CupView, Wall
from slosh_testing.commands import complaint

SHIPPED = read_calibration(config_folder() / "camera.yaml").view
VIEW = CupView(SHIPPED.camera, look_at((0.0, -0.45, 0.08), (0.004, 0.0, -0.01)), SHIPPED.cup)
LENS, CUP = VIEW.camera, VIEW.cup
CONTAINER = ["--radius", f"{CUP.radius}", "--fill-height", f"{CUP.fill_height}"]
GLASS = ["--wall-thickness", f"{CUP.wall_thickness}", "--rim-height", f"{CUP.rim_height}"]

# As ROS camera_calibration writes it.
INTRINSICS = f"""
image_width: {LENS.width}
image_height: {LENS.height}
camera_name: narrow_stereo
camera_matrix:
  rows: 3
  cols: 3
  data: [{LENS.fx}, 0, {LENS.cx}, 0, {LENS.fy}, {LENS.cy}, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients: {{rows: 1, cols: 5, data: [0, 0, 0, 0, 0]}}
rectification_matrix: {{rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}}
projection_matrix:
  rows: 3
  cols: 4
  data: [{LENS.fx}, 0, {LENS.cx}, 0, 0, {LENS.fy}, {LENS.cy}, 0, 0, 0, 1, 0]
"""


@pytest.fixture(scope="module")
def picture():
    return CupRenderer(VIEW).render_colour(0.0, 0.0)


@pytest.fixture
def still(tmp_path, picture):
    path = tmp_path / "still.png"
    cv2.imwrite(str(path), picture)
    return path


@pytest.fixture
def intrinsics(tmp_path):
    path = tmp_path / "ost.yaml"
    path.write_text(INTRINSICS)
    return path


def worst_height_error(found):
    errors = []
    for wall, turn in ((Wall.FRONT, 0.0), (Wall.REAR, np.pi)):
        azimuth = VIEW.camera_azimuth + turn + np.tile(np.deg2rad(np.linspace(-60, 60, 13)), 3)
        height = np.repeat([-0.02, 0.0, 0.02], 13)
        _, read = found.on_wall(VIEW.project_wall(azimuth, height, wall), wall)
        errors.append(np.max(np.abs(read - height)))
    return max(errors)


def test_writes_what_detect_reads(capsys, tmp_path, still, intrinsics):
    output, check = tmp_path / "out" / "camera.yaml", tmp_path / "check.png"
    output.parent.mkdir()
    words = [still, "--camera", intrinsics, *CONTAINER, *GLASS, "-o", output, "--picture", check]
    assert main(["calibrate", *(str(word) for word in words)]) == 0
    text = capsys.readouterr().out
    for part in ("mm from the axis", "deg down", "px rms", "mm (front wall)", "camera.yaml"):
        assert part in text
    calibration = read_calibration(output)
    assert calibration.camera_name == "narrow_stereo"
    assert calibration.view.cup == CUP
    assert worst_height_error(calibration.view) < 0.25e-3
    assert calibration.still_image.resolve() == still.resolve()
    assert "still_image: ../still.png" in output.read_text()
    drawn = cv2.imread(str(check)).astype(int)
    # Green on the still level: where the front wall's middle is predicted, at double size.
    ((u, v),) = calibration.view.project_wall(VIEW.camera_azimuth, 0.0, Wall.FRONT)
    row, column = round(2 * v + 0.5), round(2 * u + 0.5)
    around = drawn[row - 1 : row + 2, column]
    assert np.max(around[:, 1] - around[:, 2]) > 60


def exif(orientation, focal_35, size):
    """Returns a JPEG EXIF segment with orientation, focal length and image size."""

    def directory(entries):
        # Of type SHORT where it fits, with two bytes of padding.
        rows = b"".join(
            struct.pack(">HHIHH", tag, 3, 1, value, 0)
            if value < 65536 and tag != 0x8769
            else struct.pack(">HHII", tag, 4, 1, value)
            for tag, value in entries
        )
        return struct.pack(">H", len(entries)) + rows + b"\0\0\0\0"

    main = directory([(0x0112, orientation), (0x8769, 8 + 2 + 2 * 12 + 4)])
    inner = directory([(0xA002, size[0]), (0xA003, size[1]), (0xA405, focal_35)])
    block = b"Exif\0\0" + b"MM\0*" + struct.pack(">I", 8) + main + inner
    return b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block


def with_exif(path, picture, *facts):
    jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 98])[1].tobytes()
    path.write_bytes(jpeg[:2] + exif(*facts) + jpeg[2:])


@pytest.mark.long
def test_a_photograph_tells_its_field_of_view(capsys, tmp_path, picture):
    photograph, output = tmp_path / "photograph.jpg", tmp_path / "camera.yaml"
    # Stored on its side, as a phone does that is held upright: 6 turns it clockwise.
    stored = cv2.rotate(picture, cv2.ROTATE_90_COUNTERCLOCKWISE)
    # The diagonal of 35 mm film is 43.27 mm.
    focal = round(LENS.fx * 43.2666 / np.hypot(LENS.width, LENS.height))
    with_exif(photograph, stored, 6, focal, stored.shape[1::-1])
    words = ["calibrate", photograph, *CONTAINER, *GLASS, "-o", output]
    assert main([str(word) for word in words]) == 0
    angle = np.rad2deg(2.0 * np.arctan(0.5 * LENS.width / LENS.fx))
    said = f"assumed  a field of view of {angle:.0f}"
    assert said in capsys.readouterr().out.replace("by the picture's EXIF", "")
    found = read_calibration(output).view.camera
    assert found.size == (LENS.width, LENS.height)
    assert found.fx == pytest.approx(LENS.fx, rel=0.01)


def test_a_click_on_the_level_is_taken(capsys, tmp_path, still, intrinsics):
    ((u, v),) = VIEW.project_wall(VIEW.camera_azimuth, 0.0, Wall.FRONT)
    output = tmp_path / "camera.yaml"
    words = [still, "--camera", intrinsics, *CONTAINER, *GLASS, "-o", output, "--level"]
    assert main(["calibrate", *(str(word) for word in (*words, u, v + 1.0))]) == 0
    assert worst_height_error(read_calibration(output).view) < 0.25e-3
    capsys.readouterr()
    assert "--level" in complaint(capsys, "calibrate", *words, u, v + 40.0)
    assert "outside the image" in complaint(capsys, "calibrate", *words, -5, v)


@pytest.mark.long
def test_a_doubted_level_needs_a_click(capsys, tmp_path, still, intrinsics, monkeypatch):
    monkeypatch.setattr("slosh_bringup.cli.calibrate.still_doubt", lambda *_: "no whole line")
    monkeypatch.setattr("slosh_camera.calibrate.level.TUNING", replace(TUNING, shows=2.0))
    ((u, v),) = VIEW.project_wall(VIEW.camera_azimuth, 0.0, Wall.FRONT)
    output = tmp_path / "camera.yaml"
    words = [still, "--camera", intrinsics, *CONTAINER, *GLASS, "-o", output]
    line = complaint(capsys, "calibrate", *words)
    assert "not certain: " in line
    assert "--level U V" in line
    assert not output.exists()
    assert main(["calibrate", *(str(word) for word in (*words, "--level", u, v))]) == 0
    assert "warning: `slosh detect` and the node: no whole line" in capsys.readouterr().out


@pytest.mark.long
def test_what_detection_will_find_doubtful_is_told(
    capsys, tmp_path, still, intrinsics, monkeypatch
):
    monkeypatch.setattr("slosh_bringup.cli.calibrate.still_doubt", lambda *_: "too clear")
    words = ["calibrate", still, "--camera", intrinsics, *CONTAINER, *GLASS]
    assert main([str(word) for word in (*words, "-o", tmp_path / "camera.yaml")]) == 0
    assert "warning: `slosh detect` and the node: too clear" in capsys.readouterr().out


@pytest.mark.long
def test_a_field_of_view_will_do(capsys, tmp_path, still):
    output = tmp_path / "camera.yaml"
    angle = 2.0 * np.rad2deg(np.arctan(0.5 * LENS.width / LENS.fx))
    words = ["calibrate", still, "--fov", angle, *CONTAINER, *GLASS, "-o", output]
    assert main([str(word) for word in words]) == 0
    assert worst_height_error(read_calibration(output).view) < 0.25e-3


@pytest.mark.long
def test_what_nobody_told_is_said(capsys, tmp_path, still, intrinsics):
    def said(*words):
        command = ["calibrate", still, *words, *CONTAINER, "-o", tmp_path / "camera.yaml"]
        assert main([str(word) for word in command]) == 0
        lines = capsys.readouterr().out.splitlines()
        return [line for line in lines if line.startswith("assumed")]

    lens, wall = said("--fov", 35.5)
    assert "field of view of 35.5 deg" in lens
    assert "--focal-error" in lens
    assert "wall without thickness (--wall," in wall
    assert said("--fov", 35.5, "--focal-error", 5) == [wall]
    assert said("--camera", intrinsics, *GLASS) == []


@pytest.mark.parametrize(
    ("away", "told"),
    [
        (-0.012, "the container's sides go on below the line that fits the still level by more"),
        pytest.param(
            0.012,
            "the floor's edge is not where the dimensions predict it",
            marks=pytest.mark.long,
        ),
    ],
)
def test_a_wrong_fill_height_is_noticed(capsys, tmp_path, still, intrinsics, away, told):
    output = tmp_path / "camera.yaml"
    container = ["--radius", CUP.radius, "--fill-height", CUP.fill_height + away]
    words = ["calibrate", still, "--camera", intrinsics, *container, *GLASS, "-o", output]
    code = main([str(word) for word in words])
    printed = capsys.readouterr()
    assert told in (printed.err if code else printed.out)
    assert output.exists() == (code == 0)


def test_bad_input_is_one_line(capsys, tmp_path, still, intrinsics):
    output = tmp_path / "never.yaml"
    end = [*CONTAINER, "-o", output]
    text, nan, blank, small = (
        tmp_path / name for name in ("text.png", "nan.yaml", "blank.png", "small.png")
    )
    text.write_text("not an image")
    nan.write_text(INTRINSICS.replace("[0, 0, 0, 0, 0]", "[0, .nan, 0, 0, 0]"))
    cv2.imwrite(str(blank), np.full((LENS.height, LENS.width), 90, np.uint8))
    cv2.imwrite(str(small), np.zeros((1, 1), np.uint8))
    camera = ["--camera", intrinsics]
    for words, part in (
        ([tmp_path / "none.png", *camera, *end], "none.png: cannot be read: No such file"),
        ([tmp_path, *camera, *end], "Is a directory"),
        ([text, *camera, *end], "text.png: image: 12 bytes are not a complete image file"),
        ([small, *camera, *end], "small.png: still image: has 1 x 1 pixels"),
        ([blank, *camera, *end], "blank.png: still image: no round container is found"),
        ([still, "--camera", tmp_path / "none.yaml", *end], "none.yaml: cannot be read"),
        ([still, "--camera", still, *end], "still.png: "),
        ([still, "--camera", nan, *end], "distortion_coefficients.data: nan is not a finite"),
        ([still, *camera, "-o", output], "--radius: is needed"),
        ([still, *camera, "--radius", "0.05", "-o", output], "--fill-height: is needed"),
        ([still, *camera, "--radius", "nan", "--fill-height", "1", "-o", output], "radius: nan"),
        ([still, "--fov", "190", *end], "--fov: 190 deg is out of range; must be 3.15 to 180 deg"),
        ([still, *camera, *end, "--azimuth", "nan"], "--azimuth: nan"),
        ([still, *camera, *end, "--board", "chess"], "board: 'chess' is not charuco:"),
        ([still, *camera, *end, "--board", "aruco:2x2:0.03:0.01"], "board: 0 corners of it"),
        ([still, *camera, *end, "--board-place", *"000000"], "--board-place: needs --board"),
        ([still, *camera, *end, "--picture", tmp_path / "x.txt"], "x.txt: a picture must end in"),
        ([still, *camera, *CONTAINER, "-o", tmp_path / "no" / "c.yaml"], "there is no folder"),
    ):
        assert part in complaint(capsys, "calibrate", *words)
    assert not output.exists()


def test_board_at_a_known_place(capsys, tmp_path, intrinsics):
    # An upright page that faces the camera: a square is 200 pixels of it.
    aruco = pytest.importorskip("cv2.aruco", reason="OpenCV is built without aruco")
    markers = aruco.getPredefinedDictionary(aruco.DICT_5X5_50)
    if not hasattr(aruco, "CharucoDetector"):
        pytest.skip("this test draws its page with OpenCV 4.7")
    page = aruco.CharucoBoard((5, 4), 0.02, 0.015, markers).generateImage(
        (1000, 800), marginSize=0
    )
    camera, distance = LENS, 0.5
    scale = camera.fx * 0.02 / distance / 200.0
    size = round(1000 * scale), round(800 * scale)
    image = np.full((camera.height, camera.width), 255, np.uint8)
    image[100 : 100 + size[1], 150 : 150 + size[0]] = cv2.resize(
        page, size, interpolation=cv2.INTER_AREA
    )
    path, output = tmp_path / "board.png", tmp_path / "camera.yaml"
    cv2.imwrite(str(path), image)
    corner = (np.array([149.5, 99.5]) - (camera.cx, camera.cy)) * distance / camera.fx
    # Board's x along the container's, its y down the container's z: roll of -90 degrees.
    place = [corner[0], distance - 0.45, -corner[1], 0, 0, -90]
    words = [path, "--camera", intrinsics, *CONTAINER, *GLASS, "-o", output, "--json"]
    words += ["--board", "charuco:5x4:0.02:0.015:5X5_50", "--board-place", *place]
    assert main(["calibrate", *(str(word) for word in words)]) == 0
    facts = json.loads(capsys.readouterr().out)
    pose = read_calibration(output).view.pose
    assert np.allclose(pose.rotation, [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=5e-3)
    assert np.allclose(pose.camera_centre, [0.0, -0.45, 0.0], atol=3e-3)
    assert facts["board_residual"] < 0.5
    assert facts["residual"] is None
    board_alone, no_liquid = facts["warnings"][-2:]
    assert "nothing checks the board's pose" in board_alone
    assert "shows no complete liquid line" in no_liquid
