"""`slosh calibrate --model`: takes the container's dimensions from model.yaml."""

from __future__ import annotations

import argparse
import math

from slosh_bringup.errors import SloshBringupError
from slosh_camera.errors import SloshCameraError
from slosh_camera.optics.cup import Cup
from slosh_model.containers import ROUND, Container
from slosh_model.model_text import read_model

SAME = 1e-3
"""Lengths that differ by a smaller share are one."""


def take_model(arguments: argparse.Namespace) -> None:
    """Sets missing container options from the file given by --model, if there is one.

    Raises:
        SloshBringupError: an option says another length; a container that is not seen through
            its wall and no --scale.
    """
    if arguments.model is None:
        return
    container = read_model(arguments.model).container
    _check_radius(arguments, container)
    lengths = {"fill_height": container.fill_height, "rim_height": container.rim_height}
    if container.section == ROUND:
        lengths["radius"] = container.size
    elif arguments.scale is None and arguments.page is None:
        try:
            cup = Cup.of(container)
        except SloshCameraError as error:
            raise SloshBringupError(f"--model: {arguments.model}: {error}") from None
        arguments.radius, arguments.taper = cup.radius, cup.taper
    elif container.cornered and arguments.length is None:
        arguments.length = container.size
    for name, told in lengths.items():
        given = getattr(arguments, name)
        if given is None:
            setattr(arguments, name, told)
        elif told is not None and not math.isclose(given, told, rel_tol=SAME):
            raise SloshBringupError(
                f"--{name.replace('_', '-')}: {_mm(given)}, but {arguments.model} has "
                f"{_mm(told)}; leave the option out or correct the file"
            )


def _check_radius(arguments: argparse.Namespace, container: Container) -> None:
    """Raises an error if --radius is the model's diameter, or its container is not round."""
    given = arguments.radius
    if given is None:
        return
    if container.section != ROUND:
        raise SloshBringupError(
            f"--radius: {arguments.model} contains no cylinder ({container.described})"
        )
    if math.isclose(given, 2.0 * container.size, rel_tol=0.1):
        raise SloshBringupError(
            f"--radius: {_mm(given)} is the diameter of the container in {arguments.model}; its "
            f"radius is {_mm(container.size)}"
        )


def _mm(metres: float) -> str:
    return f"{1e3 * metres:.4g} mm"
