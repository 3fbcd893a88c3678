"""`slosh new`: writes model.yaml, cell.yaml and camera.yaml for a new cup."""

from __future__ import annotations

import argparse
import json
import re
import sys
from pathlib import Path

from slosh_base.files import check_free, new_folder, write_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.new_outline import add_outline_arguments, outline_profile, write_page
from slosh_bringup.cli.parser import old_name
from slosh_bringup.cli.quantities import DENSITY, VISCOSITY, length
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.live.cell_setup import NAMESPACE
from slosh_bringup.new_cup import LENGTH, QUANTITIES, NewCup, lengths_of, next_steps, texts_of
from slosh_model.liquid import LIQUIDS, Liquid
from slosh_motion.inputs.robot import Robot, read_urdf

_TYPES = {"kg/m3": DENSITY, "m2/s": VISCOSITY}
_IMAGE_SIZE = "1280x720"
_MOST_PIXELS = 20_000
# How often a question is asked before the answers are taken for something else.
_PATIENCE = 5
_LIQUID = "water"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh new` to the argument parser."""
    parser.add_argument(
        "folder", type=Path, metavar="DIR", help="folder for the files, new or empty"
    )
    cup = parser.add_argument_group(
        "container (on a terminal, the command asks for missing values)"
    )
    for name in ("radius", "diameter", "width", "depth", "fill_height", "rim_height", "wall"):
        words = QUANTITIES[name].words
        option = f"--{name.replace('_', '-')}"
        action = cup.add_argument(option, type=length(), metavar="M", help=f"{words} [m]")
        if name == "wall":
            old_name(parser, action, "--wall-thickness")
    cup.add_argument(
        "--shape", metavar="NAME",
        help="container shape other than a cylinder or box, such as frustum or beaker, with "
        "dimensions as --length; the cell then has no camera",
    )  # fmt: skip
    cup.add_argument(
        "--length", action="append", default=[], metavar="NAME=M",
        help="a dimension of the --shape [m], such as top_radius=40mm; repeatable",
    )  # fmt: skip
    add_outline_arguments(parser)
    liquid = parser.add_argument_group("liquid")
    liquid.add_argument("--liquid", choices=LIQUIDS, help=f"kind of liquid (default {_LIQUID})")
    liquid.add_argument(
        "--density",
        type=DENSITY,
        metavar="KG/M3",
        help="density of a liquid not in --liquid [kg/m³]",
    )
    liquid.add_argument(
        "--viscosity",
        type=VISCOSITY,
        metavar="M2/S",
        help="kinematic viscosity of a liquid not in --liquid [m²/s]",
    )
    parser.add_argument(
        "--namespace", default=NAMESPACE, help=f"namespace of the nodes (default {NAMESPACE})"
    )
    parser.add_argument(
        "--no-camera", action="store_true",
        help="describe a cell without a camera; only the estimate is monitored",
    )  # fmt: skip
    robot = parser.add_argument_group("robot whose joint states drive the models")
    robot.add_argument("--urdf", type=Path, metavar="FILE", help="URDF file of the robot")
    robot.add_argument(
        "--tool-frame", metavar="LINK", help="link of the robot that holds the container"
    )
    parser.add_argument("--json", action="store_true", help="print files and next steps as JSON")
    parser.add_argument(
        "--image-size", default=_IMAGE_SIZE, metavar="WxH",
        help=f"size of the camera's images [px] (default {_IMAGE_SIZE})",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Writes the first files of a new cup and prints the next steps."""
    if arguments.page is not None:
        return write_page(arguments)
    folder: Path = arguments.folder
    check_free(folder)
    cup = _cup(arguments)
    with new_folder(folder) as room:
        for name, text in texts_of(cup, folder).items():
            write_text(room / name, text)
    files = [str(folder / name) for name in texts_of(cup, folder)]
    if arguments.json:
        print(json.dumps({"files": files, "next": next_steps(cup, folder)}))
        return 0
    print(*map(plain_line, files), sep="\n")
    if cup.wall is None and cup.camera:
        print("note: no wall thickness given, 0 is used; the camera needs it: --wall")
    print("next:", *next_steps(cup, folder), sep="\n  ")
    return 0


def _cup(arguments: argparse.Namespace) -> NewCup:
    given = {
        name: quantity.check(name, getattr(arguments, name))
        for name, quantity in QUANTITIES.items()
        if getattr(arguments, name) is not None
    }
    profile = outline_profile(arguments)
    shape = "revolution" if profile else arguments.shape or ""
    lengths = {} if profile else _of_shape(shape, arguments.length, given)
    _check_shape(given)
    _check_liquid(given, arguments.liquid)
    size = _image_size(arguments.image_size)
    known = LIQUIDS[arguments.liquid or _LIQUID]
    liquid = Liquid(
        given.get("density", known.density), given.get("viscosity", known.kinematic_viscosity)
    )
    if sys.stdin.isatty():
        _ask_for_missing(given, shape)
    missing = _missing(given, shape)
    if missing:
        raise SloshBringupError(
            f"{', '.join(missing)}: required; the command can ask for values only on a terminal"
        )
    lengths = lengths or ({} if profile else _lengths(given))
    if (arguments.urdf is None) != (arguments.tool_frame is None):
        raise SloshBringupError("--urdf and --tool-frame must be given together")
    if arguments.urdf is not None:
        Robot(read_urdf(arguments.urdf), arguments.tool_frame, name=str(arguments.urdf))
    return NewCup(
        lengths, given["fill_height"], liquid, given.get("rim_height"),
        given.get("wall"), arguments.namespace, size, not (arguments.no_camera or shape), shape,
        arguments.urdf, arguments.tool_frame or "", profile,
    )  # fmt: skip


def _check_liquid(given: dict[str, float], named: str | None) -> None:
    """Raises an error if a liquid's density is given without its viscosity.

    Raises:
        SloshBringupError: it is not given.
    """
    if "density" not in given or "viscosity" in given or named is not None:
        return
    if sys.stdin.isatty():
        _ask(given, "viscosity")
    if "viscosity" not in given:
        raise SloshBringupError(
            "--density: the viscosity of this liquid is missing; give --viscosity [m²/s] (water "
            "1e-6, syrup 1e-4) or the nearest --liquid"
        )


def _check_shape(given: dict[str, float]) -> None:
    """Raises an error if the cup's dimensions contradict each other."""
    if {"radius", "diameter"} <= given.keys():
        raise SloshBringupError("--radius and --diameter: give one of them")
    cylinder, rectangle = {"radius", "diameter"} & given.keys(), {"width", "depth"} & given.keys()
    if cylinder and rectangle:
        raise SloshBringupError(
            f"--{min(cylinder)} and --{max(rectangle)}: the container is round or rectangular; "
            "give only one"
        )


def _of_shape(shape: str, words: list[str], given: dict[str, float]) -> dict[str, float]:
    """Returns the dimensions of a --shape container, from options and prompts.

    Raises:
        SloshBringupError: a length that it does not have, or that is missing.
    """
    if not shape:
        if words:
            raise SloshBringupError("--length: belongs to --shape")
        return {}
    plain = given.keys() & {"radius", "diameter", "width", "depth"}
    if plain:
        raise SloshBringupError(f"--{min(plain)}: give it as --length of the {shape}")
    needed, found = lengths_of(shape), {}
    for word in words:
        name, _, value = word.partition("=")
        if name not in needed:
            raise SloshBringupError(f"--length {word!r:.60} (a {shape} has {', '.join(needed)})")
        try:
            found[name] = LENGTH.check(name, length()(value))
        except argparse.ArgumentTypeError as error:
            raise SloshBringupError(f"--length {word!r:.60}: {error}") from None
    for name in needed:
        if name not in found and sys.stdin.isatty():
            found[name] = LENGTH.check(name, length()(_line(f"{name} [m]: ")))
    missing = [f"--length {name}=M" for name in needed if name not in found]
    if missing:
        raise SloshBringupError(f"{', '.join(missing)}: required for a {shape}")
    return found


def _missing(given: dict[str, float], shape: str) -> list[str]:
    """Returns the required options that were not given."""
    missing = []
    if given.keys() & {"width", "depth"}:
        missing += [f"--{name}" for name in ("width", "depth") if name not in given]
    elif not shape and not given.keys() & {"radius", "diameter"}:
        missing.append("--radius, --diameter or --width and --depth")
    if "fill_height" not in given:
        missing.append("--fill-height")
    return missing


def _lengths(given: dict[str, float]) -> dict[str, float]:
    if "width" in given:
        return {name: given[name] for name in ("width", "depth")}
    return {"radius": given["radius"] if "radius" in given else 0.5 * given["diameter"]}


def _ask_for_missing(given: dict[str, float], contour: str) -> None:
    """Asks for missing options on the terminal and adds the answers."""
    if not contour and not given.keys() & {"radius", "diameter", "width", "depth"}:
        shape = _answer("round or rectangular? [round] ", ("", "round", "rectangular"))
        _ask(given, "width" if shape == "rectangular" else "diameter")
    for name in ("width", "depth"):
        if given.keys() & {"width", "depth"}:
            _ask(given, name)
    _ask(given, "fill_height")
    for name in ("rim_height", "wall"):
        _ask(given, name, optional=True)


def _answer(question: str, answers: tuple[str, ...]) -> str:
    for _ in range(_PATIENCE):
        word = _line(question)
        if word in answers:
            return word
    raise SloshBringupError(
        f"{question.strip()}: none of the answers was {', '.join(answers[1:])}"
    )


def _ask(given: dict[str, float], name: str, *, optional: bool = False) -> None:
    """Prompts for one quantity until the answer is valid."""
    if name in given:
        return
    quantity = QUANTITIES[name]
    hint = ", empty: unknown" if optional else ""
    for _ in range(_PATIENCE):
        word = _line(f"{quantity.words} [{quantity.unit}{hint}]: ")
        if optional and not word:
            return
        try:
            given[name] = quantity.check(name, _TYPES.get(quantity.unit, length())(word))
        except SloshBringupError as error:
            print(error)
        except argparse.ArgumentTypeError as error:
            print(error)
        else:
            return
    raise SloshBringupError(f"--{name.replace('_', '-')}: no valid answer")


def _line(question: str) -> str:
    try:
        return input(question).strip()
    except EOFError:
        raise SloshBringupError("no more input: give the values as options") from None


def _image_size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text.lower())
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(1 <= length <= _MOST_PIXELS for length in size):
        raise SloshBringupError(f"--image-size: {text!r} is not WIDTHxHEIGHT, such as 1280x720")
    return size
