"""Tests that `slosh intrinsics` writes an ost.yaml that `slosh calibrate` reads."""

import cv2
import numpy as np
import pytest

from slosh_bringup.cli.main import main
from slosh_camera.calibrate.intrinsics import read_known_camera
from slosh_testing.board_scene import MATRIX, chessboard_pictures
from slosh_testing.commands import complaint

BOARD = ["--board", "8x5", "--square", "0.02"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pictures")
    for number, picture in enumerate(chessboard_pictures()):
        cv2.imwrite(str(folder / f"board_{number}.png"), picture)
    cv2.imwrite(str(folder / "wall.png"), np.full((480, 640), 90, np.uint8))
    return folder


@pytest.mark.long
def test_pictures_become_a_file_that_calibrate_reads(folder, tmp_path, capsys):
    ost, picture = tmp_path / "ost.yaml", tmp_path / "check.png"
    words = [folder, *BOARD, "-o", ost, "--picture", picture, "--name", "left"]
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
    assert any(line.startswith("missing: the board from near") for line in lines)
    assert cv2.imread(str(picture)).shape == (480, 640, 3)


@pytest.mark.parametrize(("suffix", "begin"), [(".pdf", b"%PDF-1.4"), (".svg", b"<svg ")])
def test_a_board_is_printed_without_pictures(tmp_path, suffix, begin):
    path = tmp_path / f"board{suffix}"
    assert main(["intrinsics", *BOARD, "--print-board", str(path)]) == 0
    assert path.read_bytes().startswith(begin)


def test_what_cannot_be_is_one_line(folder, tmp_path, capsys):
    first, ost = folder / "board_0.png", tmp_path / "ost.yaml"
    (tmp_path / "empty").mkdir()
    for words, said in (
        ([first, *BOARD, "-o", ost], "pictures: 1 of 1 can be used, 4 are needed"),
        ([folder / "wall.png", *BOARD, "-o", ost], "board: is found in none of 1 pictures"),
        ([first, "--board", "8x5", "-o", ost], "square: is needed"),
        ([first, *BOARD], "-o: is required with pictures"),
        ([*BOARD, "-o", ost], "pictures: at least one is required"),
        ([*BOARD], "pictures: at least one is required"),
        ([tmp_path / "empty", *BOARD, "-o", ost], "empty: no images ("),
        ([tmp_path / "no.png", *BOARD, "-o", ost], "no.png: cannot be read: No such file"),
        ([*BOARD, "--print-board", tmp_path / "b.doc"], "b.doc: a board must end in .pdf or"),
        ([first, *BOARD, "-o", ost, "--picture", tmp_path / "p.gif"], "p.gif: a picture must"),
        ([*BOARD, "--print-board", tmp_path / "b.pdf", "--picture", "p.png"], "--picture: needs"),
    ):
        assert said in complaint(capsys, "intrinsics", *words), said
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]
