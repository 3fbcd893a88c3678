"""Formats the result of a force identification as text, JSON and model."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

from slosh_base.types import Array
from slosh_discovery.force.result import ForceIdentification, Measured
from slosh_estimator.sensed.payload import UNITS
from slosh_model.model import Model

AXES = "xyz"
PLAIN = 0.9
"""Least part of a direction along one axis that is named by it."""


def force_text(found: ForceIdentification) -> str:
    """Formats the identified values with standard errors and notes as a text table."""
    turn = 2.0 * math.pi
    rows = [
        ("natural frequency", found.natural_frequency, 1.0 / turn, "Hz", 4),
        ("damping ratio", found.damping_ratio, 1.0, "", 5),
        ("sloshing mass", found.sloshing_mass, 1.0, "kg", 4),
        ("container and liquid", found.payload, 1.0, "kg", 3),
        ("delay of the sensor", found.delay, 1e3, "ms", 1),
    ]
    if found.stiffness is not None:
        rows.append(("stiffness of high waves α", found.stiffness, 1.0, "", 2))
    lines = [_line(*row) for row in rows]
    lines += [
        f"acceleration along {direction(along)} of the container takes a force along "
        f"{direction(sensor, 'f')} of the sensor"
        for along, sensor in found.directions
    ]
    lines.append(
        f"residual below {found.cutoff:.1f} Hz: {found.noise_at_rest:.3g} N at rest, "
        f"{found.noise_moving:.3g} N in motion"
    )
    lines += [f"note: {note}" for note in found.notes]
    if found.unobserved:
        lines.append(found.unobserved)
    return "\n".join(lines)


def _line(name: str, one: Measured, factor: float, unit: str, digits: int) -> str:
    text = f"{name:26} {one.value * factor:.{digits}f} ± {one.error * factor:.{digits}f} {unit}"
    if math.isfinite(one.model):
        text = f"{text.rstrip()} (model: {one.model * factor:.{digits}f})"
    return text.rstrip()


def direction(vector: Array, prefix: str = "") -> str:
    """Formats a unit vector (3,): the name of an axis if it is near one, else its components."""
    place = int(abs(vector).argmax())
    if abs(vector[place]) >= PLAIN:
        return f"{'+' if vector[place] > 0.0 else '-'}{prefix}{AXES[place]}"
    return "(" + ", ".join(f"{value:.2f}" for value in vector) + ")"


def force_json(found: ForceIdentification) -> str:
    """Returns the result as JSON in SI units; frequencies in rad/s and in Hz."""
    hertz = {
        key: value / (2.0 * math.pi) if value is not None else None
        for key, value in _number(found.natural_frequency).items()
    }
    document: dict[str, Any] = {
        "name": found.name,
        "natural_frequency": _number(found.natural_frequency),
        "natural_frequency_hz": hertz,
        "damping_ratio": _number(found.damping_ratio),
        "sloshing_mass": _number(found.sloshing_mass),
        "payload_mass": _number(found.payload),
        "delay": _number(found.delay),
        "alpha": None if found.stiffness is None else _number(found.stiffness),
        "directions": [
            {"container": along.tolist(), "sensor": sensor.tolist(),
             "sensor_axis": direction(sensor, "f")}
            for along, sensor in found.directions
        ],
        "residual_at_rest": found.noise_at_rest,
        "residual_in_motion": found.noise_moving,
        "cutoff_hz": found.cutoff,
        "unit": found.unit,
        "newton": UNITS[found.unit],
        "unobserved": found.unobserved,
        "notes": list(found.notes),
    }  # fmt: skip
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _number(one: Measured) -> dict[str, float | None]:
    named = {"value": one.value, "error": one.error, "model": one.model}
    return {key: value if math.isfinite(value) else None for key, value in named.items()}


def identified_model(model: Model, found: ForceIdentification) -> Model:
    """Returns the model with the measured natural frequency and damping ratio."""
    share = found.natural_frequency.value / found.natural_frequency.model
    return replace(
        model,
        natural_frequency=model.mode_frequency(1) * share,
        damping_ratio=found.damping_ratio.value,
        covariance=None,
    )
