"""Payload of a force sensor, as identified by `slosh identify --force`."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from slosh_estimator.errors import SloshEstimatorError

UNITS = {"N": 1.0, "kgf": 9.80665, "lbf": 4.4482216, "mN": 1e-3, "kN": 1e3, "gf": 9.80665e-3}
"""Units of force [N]."""
LONGEST = 1_000_000
"""Size of the document at most [bytes]."""
Direction = tuple[float, float, float]


class Payload(NamedTuple):
    """Identified data of what a force sensor carries: container and liquid.

    Attributes:
        natural_frequency: of the first mode [rad/s].
        sloshing_mass: of it [kg].
        mass: of container and liquid [kg].
        mass_error: standard error of it [kg].
        delay: by which the force is later than the motion [s].
        directions: (container, sensor): unit vectors of each observed direction of motion in the
            container's axes and in the sensor's.
        noise_at_rest, noise_moving: standard deviation of the force without an explanation [N].
        newton: unit of the force [N].
    """

    natural_frequency: float
    sloshing_mass: float
    mass: float
    mass_error: float
    delay: float
    directions: tuple[tuple[Direction, Direction], ...]
    noise_at_rest: float
    noise_moving: float
    newton: float


def parse_payload(text: str, name: str) -> Payload:
    """Parses the document that `slosh identify --force -o DIR` writes.

    Args:
        text: JSON.
        name: of the file, for errors.

    Raises:
        SloshEstimatorError: no such document, a value is missing or impossible; one line.
    """
    try:
        document = json.loads(text)
    except ValueError as error:
        raise SloshEstimatorError(f"{name}: is no JSON: {error}") from None
    if not isinstance(document, dict) or "sloshing_mass" not in document:
        raise SloshEstimatorError(
            f"{name}: holds no sloshing mass: give the identification.json of "
            "`slosh identify --force`"
        )
    return Payload(
        _number(document, name, "natural_frequency"), _number(document, name, "sloshing_mass"),
        _number(document, name, "payload_mass"),
        _number(document, name, "payload_mass", "error", least=0.0),
        _number(document, name, "delay", least=-math.inf), _directions(document, name),
        _number(document, name, "residual_at_rest", ""),
        _number(document, name, "residual_in_motion", ""),
        _number(document, name, "newton", "") if "newton" in document else 1.0,
    )  # fmt: skip


def _number(
    document: Mapping[str, Any], name: str, key: str, part: str = "value", least: float = 1e-12
) -> float:
    """Returns a finite number of the payload file that is not below a minimum."""
    value = document.get(key)
    if part:
        value = value.get(part) if isinstance(value, dict) else None
    where = f"{key}.{part}" if part else key
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise SloshEstimatorError(f"{name}: {where} = {value!r} must be a number")
    if value < least:
        raise SloshEstimatorError(f"{name}: {where} = {value:g} must be at least {least:g}")
    return float(value)


def _directions(document: Mapping[str, Any], name: str) -> tuple[tuple[Direction, Direction], ...]:
    """Returns one or two horizontal container directions, each also given in sensor axes."""
    found = []
    entries = document.get("directions")
    for entry in entries if isinstance(entries, list) else []:
        pair = tuple(_unit(entry, side, name) for side in ("container", "sensor"))
        if math.hypot(*pair[0][:2]) > 0.5:  # what is vertical moves no liquid along the floor
            found.append((pair[0], pair[1]))
    if not found:
        raise SloshEstimatorError(f"{name}: directions names no direction along the floor")
    return tuple(found[:2])


def _unit(entry: Any, side: str, name: str) -> Direction:
    try:
        x, y, z = (float(value) for value in entry[side])
    except (KeyError, TypeError, ValueError):
        raise SloshEstimatorError(f"{name}: a direction has no {side} of three numbers") from None
    size = math.sqrt(x * x + y * y + z * z)
    if not 0.9 < size < 1.1:
        raise SloshEstimatorError(f"{name}: a direction's {side} has the length {size:g}, not 1")
    return x / size, y / size, z / size
