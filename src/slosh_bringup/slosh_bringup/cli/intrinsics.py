"""`slosh intrinsics`: estimates a camera's parameters from images of a calibration board."""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2

from slosh_base.files import check_apart, write_bytes, write_text
from slosh_base.files.plain_text import plain_line
from slosh_base.files.quiet_decoders import quiet_decoders
from slosh_bringup.cli.output_names import YAML, check_ending
from slosh_bringup.cli.quantities import length
from slosh_bringup.detect.series import IMAGE_ENDINGS, images_in
from slosh_bringup.errors import SloshBringupError
from slosh_camera.calibrate.board import FORMAT
from slosh_camera.images.colour import Image
from slosh_camera.images.decoding import read_image
from slosh_camera.intrinsics.drawing import draw_reprojection, missing_poses
from slosh_camera.intrinsics.sheet import as_pdf, as_svg, sheet_of
from slosh_camera.intrinsics.solve import IntrinsicFit, format_camera, solve_intrinsics
from slosh_camera.intrinsics.views import CHESSBOARD_FORMAT, Target, find_views, parse_target
from slosh_camera.optics.lens import COEFFICIENTS, PLUMB_BOB
from slosh_report.json_values import plain

_PICTURES, _SHEETS = (".png", ".jpg", ".jpeg"), (".pdf", ".svg")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh intrinsics` to the argument parser."""
    parser.add_argument(
        "images",
        nargs="*",
        type=Path,
        help="images of the calibration board, or folders of images",
    )
    parser.add_argument(
        "--board", required=True, metavar="BOARD",
        help=f"board: {CHESSBOARD_FORMAT} inner corners of a chessboard, or {FORMAT}, lengths "
        "in m",
    )  # fmt: skip
    parser.add_argument(
        "--square", type=length(1.0), metavar="M", help="side of a chessboard's square [m]"
    )
    parser.add_argument("-o", "--output", type=Path, help="name of the ost.yaml to write")
    parser.add_argument(
        "--lens", choices=tuple(COEFFICIENTS), default=PLUMB_BOB,
        help="distortion model to fit; equidistant for a fisheye lens (default plumb_bob)",
    )  # fmt: skip
    parser.add_argument(
        "--name", default="camera", help="name of the camera in the file (default camera)"
    )
    parser.add_argument(
        "--picture",
        type=Path,
        metavar="OUT.png",
        help="image to write: detected corners with magnified errors",
    )
    parser.add_argument(
        "--print-board",
        type=Path,
        metavar="OUT.pdf",
        help="sheet to write: the --board at true scale (.pdf or .svg)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Writes a printable calibration board, or the estimated camera and its uncertainty."""
    _check_asked(arguments)
    target = parse_target(arguments.board, arguments.square)
    files = _files(arguments.images)
    check_apart([arguments.output, arguments.picture, arguments.print_board], files)
    check_ending(arguments.output, "a camera's file", YAML)
    check_ending(arguments.picture, "a picture", _PICTURES)
    check_ending(arguments.print_board, "a board", _SHEETS)
    if arguments.print_board is not None:
        _print_board(arguments.print_board, target)
    if files:
        _calibrate(arguments, files, target)
    return 0


def _check_asked(arguments: argparse.Namespace) -> None:
    """Raises an error if options that exclude each other are given."""
    if arguments.images and arguments.output is None:
        raise SloshBringupError("-o: is required with pictures")
    if not arguments.images and (arguments.output is not None or arguments.print_board is None):
        raise SloshBringupError("pictures: at least one is required")
    if arguments.picture is not None and not arguments.images:
        raise SloshBringupError("--picture: needs pictures of the board")


def _files(paths: Sequence[Path]) -> list[Path]:
    """Returns the image files; a folder is replaced by all images in it."""
    files: list[Path] = []
    for path in paths:
        found = images_in(path) if path.is_dir() else [path]
        if not found:
            raise SloshBringupError(
                f"{path}: no images ({', '.join(IMAGE_ENDINGS)}) in this folder"
            )
        files += found
    return files


def _print_board(path: Path, target: Target) -> None:
    sheet = sheet_of(target)
    if path.suffix.lower() == ".svg":
        write_text(path, as_svg(sheet))
    else:
        write_bytes(path, as_pdf(sheet))


def _calibrate(arguments: argparse.Namespace, files: Sequence[Path], target: Target) -> None:
    fit = solve_intrinsics(find_views(_pictures(files), target), arguments.lens)
    if arguments.picture is not None:
        picture = cv2.imencode(arguments.picture.suffix, draw_reprojection(fit))[1]
        write_bytes(arguments.picture, picture.tobytes())
    write_text(arguments.output, format_camera(fit.camera, arguments.name))
    as_words = _as_json if arguments.json else _as_text
    print(as_words(fit, arguments.output))


def _pictures(files: Sequence[Path]) -> Iterator[tuple[str, Image]]:
    for file in files:
        with quiet_decoders():
            picture = read_image(file)
        yield str(file), picture


def _as_text(fit: IntrinsicFit, output: Path) -> str:
    lines = [
        f"{name:9}{getattr(fit.camera, name):9.2f} +- {error:.2f} px"
        for name, error in fit.stddev.items()
    ]
    lens = ", ".join(f"{value:+.5f}" for value in fit.camera.distortion)
    lines.append(f"lens     {fit.camera.distortion_model} {lens}")
    count = len(fit.views) + len(fit.left_out)
    lines.append(f"residual {fit.rms:9.2f} px rms, {len(fit.views)} of {count} pictures used")
    lines += [f"left out: {picture.name}: {picture.reason}" for picture in fit.left_out]
    lines += [f"missing: {pose}" for pose in missing_poses(fit)]
    return "\n".join([*lines, plain_line(output)])


def _as_json(fit: IntrinsicFit, output: Path) -> str:
    facts = {
        "output": str(output),
        **{name: getattr(fit.camera, name) for name in fit.stddev},
        "distortion_model": fit.camera.distortion_model,
        "distortion": list(fit.camera.distortion),
        "stddev": fit.stddev,
        "rms": fit.rms,
        "used": {view.view.name: view.rms for view in fit.views},
        "left_out": {picture.name: picture.reason for picture in fit.left_out},
        "missing": missing_poses(fit),
    }
    return json.dumps(plain(facts))
