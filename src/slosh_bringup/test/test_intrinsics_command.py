"""Tests that `slosh intrinsics` writes an ost.yaml that `slosh calibrate` reads."""

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.intrinsics import board_sheet
from slosh_bringup.cli.main import main
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.board import Board
from slosh_camera.calibrate.board_views import Chessboard, corners_of
from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_testing.board_scene import MATRIX, chessboard_pictures
from slosh_testing.commands import complaint

BOARD = ["--board", "8x5", "--square", "0.02"]
CHARUCO = Board(True, 8, 5, 0.02, 0.015)
needs_markers = pytest.mark.skipif(
    not hasattr(getattr(cv2, "aruco", None), "CharucoBoard"),
    reason=f"OpenCV {cv2.__version__} is built without aruco",
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    for number, picture in enumerate(chessboard_pictures()):
        cv2.imwrite(str(folder / f"board_{number}.png"), picture)
    cv2.imwrite(str(folder / "wall.png"), np.full((480, 640), 90, np.uint8))
    return folder


@pytest.mark.long
def test_pictures_become_a_file_that_calibrate_reads(folder, tmp_path, capsys):
    ost = tmp_path / "ost.yaml"
    words = [folder, *BOARD, "-o", ost, "--name", "left"]
    assert main(["intrinsics", *map(str, words)]) == 0
    lines = capsys.readouterr().out.splitlines()
    known = read_known_camera(ost)
    assert known.name == "left"
    name, value, sign, error, unit = lines[0].split()
    assert (name, sign, unit, float(value)) == ("fx", "+-", "px", round(known.camera.fx, 2))
    assert abs(known.camera.fx - MATRIX[0, 0]) < 3.0 * float(error)
    assert [line.split()[0] for line in lines[1:4]] == ["fy", "cx", "cy"]
    assert any("px rms, 12 of 13 pictures used" in line for line in lines)
    assert any(line.startswith(f"left out: {folder / 'wall.png'}: the board") for line in lines)


@pytest.mark.parametrize(("suffix", "begin"), [(".pdf", b"%PDF-1.4"), (".svg", b"<?xml ")])
def test_a_board_is_printed_without_pictures(tmp_path, suffix, begin):
    path = tmp_path / f"board{suffix}"
    assert main(["intrinsics", *BOARD, "--print-board", str(path)]) == 0
    assert path.read_bytes().startswith(begin)


@pytest.mark.parametrize(
    ("board", "corners"),
    [
        (Chessboard(8, 5, 0.02), 40),
        *(
            pytest.param(board, count, marks=needs_markers)
            for board, count in ((CHARUCO, 28), (Board(False, 5, 4, 0.03, 0.01), 80))
        ),
    ],
)
def test_a_board_is_printed_to_scale(tmp_path, board, corners):
    path = tmp_path / "sheet.png"
    board_sheet(board).savefig(path, dpi=127)  # five pixels a millimetre
    places, pixels = corners_of(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), board)
    assert len(places) == corners
    turn = np.column_stack((5e3 * places[:, :2], np.ones(corners)))
    found, *_ = np.linalg.lstsq(turn, pixels, rcond=None)
    # OpenCV may take a chessboard for one that is turned by half a turn.
    assert np.abs(np.abs(found[:2]) - np.eye(2)).max() < 2e-3
    assert np.abs(turn @ found - pixels).max() < 1.0


def test_a_board_that_no_sheet_holds_is_refused():
    with pytest.raises(SloshBringupError, match="larger than A0; are its lengths in m"):
        board_sheet(Chessboard(20, 20, 0.5))


def test_what_cannot_be_is_one_line(folder, tmp_path, capsys):
    first, ost = folder / "board_0.png", tmp_path / "ost.yaml"
    (tmp_path / "empty").mkdir()
    for words, said in (
        ([first, *BOARD, "-o", ost], "pictures: 1 of 1 can be used, 4 are needed"),
        ([folder / "wall.png", *BOARD, "-o", ost], "wall.png: the board is not found"),
        ([first, "--board", "8x5", "-o", ost], "square: is needed"),
        ([first, *BOARD], "-o: is required with pictures"),
        ([*BOARD, "-o", ost], "pictures: at least one is required"),
        ([*BOARD], "pictures: at least one is required"),
        ([tmp_path / "empty", *BOARD, "-o", ost], "empty: no images ("),
        ([tmp_path / "no.png", *BOARD, "-o", ost], "no.png: cannot be read: No such file"),
        ([*BOARD, "--print-board", tmp_path / "b.doc"], "b.doc: a board must end in .pdf or"),
    ):
        assert said in complaint(capsys, "intrinsics", *words), said
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]
