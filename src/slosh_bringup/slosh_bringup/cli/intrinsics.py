"""`slosh intrinsics`: a camera's matrix and lens from pictures of a board; prints the board."""

from __future__ import annotations

import argparse
import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from slosh_base.files import check_apart, write_bytes, write_text
from slosh_base.files.plain_text import plain_line
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_bringup.cli.output_names import YAML, check_ending
from slosh_bringup.cli.quantities import length
from slosh_bringup.detect.series import IMAGE_ENDINGS, images_in
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.board import FORMAT, Board, drawn_board
from slosh_camera.calibrate.board_views import Chessboard, fit_camera, format_camera, parse_target
from slosh_camera.images.colour import Image
from slosh_camera.images.decoding import read_image
from slosh_camera.optics.lens import COEFFICIENTS, PLUMB_BOB
from slosh_report.json_values import plain

# ISO 216 sheets [mm]; the white around a board, without which its outer squares are not found.
_SHEETS = ((210, 297), (297, 420), (420, 594), (594, 841), (841, 1189))
_CAPTION, _RULE, _PIXELS = 14.0, 50.0, 20.0  # mm, mm, 1/mm


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh intrinsics` to the argument parser."""
    add = parser.add_argument
    add("images", nargs="*", type=Path, help="images of the board, or folders of images")
    add(
        "--board", required=True, metavar="BOARD",
        help=f"COLSxROWS inner corners of a chessboard, or {FORMAT}, lengths in m",
    )  # fmt: skip
    add("--square", type=length(1.0), metavar="M", help="side of a chessboard's square [m]")
    add("-o", "--output", type=Path, help="name of the ost.yaml to write")
    add(
        "--lens", choices=tuple(COEFFICIENTS), default=PLUMB_BOB,
        help="distortion model to fit; equidistant for a fisheye lens (default plumb_bob)",
    )  # fmt: skip
    add("--name", default="camera", help="name of the camera in the file (default camera)")
    add("--print-board", type=Path, metavar="OUT.pdf", help="sheet with the board to write, in "
        "true size (.pdf or .svg)")  # fmt: skip
    add("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Writes a printable calibration board, or the estimated camera and its uncertainty."""
    output, sheet = arguments.output, arguments.print_board
    if arguments.images and output is None:
        raise SloshBringupError("-o: is required with pictures")
    if not arguments.images and (output is not None or sheet is None):
        raise SloshBringupError("pictures: at least one is required")
    board = parse_target(arguments.board, arguments.square)
    files = [file for path in arguments.images for file in _files(path)]
    check_apart([output, sheet], files)
    check_ending(output, "a camera's file", YAML)
    check_ending(sheet, "a board", (".pdf", ".svg"))
    if sheet is not None:
        with io.BytesIO() as stream:
            board_sheet(board).savefig(stream, format=sheet.suffix[1:].lower())
            write_bytes(sheet, stream.getvalue())
    if not files:
        return 0
    fit = fit_camera(_pictures(files), board, arguments.lens)
    write_text(output, format_camera(fit.camera, arguments.name))
    lens, coefficients = fit.camera.distortion_model, list(fit.camera.distortion)
    values = {name: getattr(fit.camera, name) for name in fit.stddev}
    if arguments.json:
        facts = {
            "output": str(output), **values, "distortion_model": lens, "distortion": coefficients,
            "stddev": fit.stddev, "rms": fit.rms, "used": fit.used, "left_out": fit.left_out,
        }  # fmt: skip
        print(json.dumps(plain(facts)))
        return 0
    for name, value in values.items():
        print(f"{name:9}{value:9.2f} +- {fit.stddev[name]:.2f} px")
    print(f"lens     {lens} {', '.join(f'{value:+.5f}' for value in coefficients)}")
    count = len(fit.used) + len(fit.left_out)
    print(f"residual {fit.rms:9.2f} px rms, {len(fit.used)} of {count} pictures used")
    for name, reason in fit.left_out.items():
        print(f"left out: {name}: {reason}")
    print(plain_line(output))
    return 0


def _files(path: Path) -> Sequence[Path]:
    if not path.is_dir():
        return [path]
    found = images_in(path)
    if not found:
        raise SloshBringupError(f"{path}: no images ({', '.join(IMAGE_ENDINGS)}) in this folder")
    return found


def _pictures(files: Sequence[Path]) -> Iterator[tuple[str, Image]]:
    for file in files:
        with quiet_decoders():
            picture = read_image(file)
        yield str(file), picture


def board_sheet(board: Chessboard | Board) -> Figure:
    """Draws a board in its true size on the smallest sheet, from A4, that holds it.

    A line of 50 mm below it tells whether the printer kept the scale.

    Raises:
        SloshBringupError: it is larger than A0.
    """
    if isinstance(board, Chessboard):
        columns, rows, side, gap = board.columns + 1, board.rows + 1, board.square, 0.0
        words = f"{board.columns}x{board.rows} inner corners, squares {1e3 * side:g} mm"
    else:
        columns, rows, side = board.columns, board.rows, board.size
        gap = 0.0 if board.charuco else board.inner
        sizes = f"{1e3 * side:g} and {1e3 * board.inner:g} mm"
        words = f"{columns}x{rows}, {sizes}, {board.dictionary}"
    width, height = (1e3 * (count * (side + gap) - gap) for count in (columns, rows))
    # White all around belongs to the board: without it the outer squares are not found.
    rim = max(8.0, 500.0 * (side if isinstance(board, Chessboard) else board.inner))
    needed = (max(width, 2.0 * _RULE) + 2.0 * rim, height + 2.0 * rim + _CAPTION)
    pages = [page for sheet in _SHEETS for page in (sheet, sheet[::-1])]
    page = next((p for p in pages if p[0] >= needed[0] and p[1] >= needed[1]), None)
    if page is None:
        raise SloshBringupError(
            f"board: {needed[0]:.0f} x {needed[1]:.0f} mm is larger than A0; are its lengths in m?"
        )
    pixels = (round(_PIXELS * width), round(_PIXELS * height))
    if isinstance(board, Chessboard):
        down, right = (np.arange(n) * m // n for n, m in ((pixels[1], rows), (pixels[0], columns)))
        image = (255 * ((down[:, None] + right) % 2)).astype(np.uint8)
    else:
        image = drawn_board(board.opencv()[0], *pixels)
    figure = Figure(figsize=(page[0] / 25.4, page[1] / 25.4))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.axis("off")
    left, top = 0.5 * (page[0] - width), 0.5 * (page[1] - height - _CAPTION)
    axes.imshow(
        image, "gray", vmin=0, vmax=255, interpolation="none", aspect="auto",
        extent=(left, left + width, top + height, top),
    )  # fmt: skip
    start, below = 0.5 * page[0] - _RULE, top + height + 0.7 * rim + 3.5
    axes.text(start, below, f"{words}; the line is {_RULE:.0f} mm long", fontsize=9)
    axes.plot([start, start + _RULE], [below + 3.0] * 2, color="black", linewidth=1.0)
    axes.set(xlim=(0, page[0]), ylim=(page[1], 0))
    return figure
