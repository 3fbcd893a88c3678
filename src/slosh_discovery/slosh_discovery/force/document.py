"""The result of a force identification as a document, and as a model."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from slosh_base.types import Array
from slosh_discovery.force.result import ForceIdentification, Measured
from slosh_estimator.sensed.payload import UNITS
from slosh_model.model import Model
from slosh_model.model_text import format_model
from slosh_report.document import (
    Block,
    Chart,
    Code,
    Column,
    Document,
    Figure,
    Line,
    Lines,
    Notice,
    Paragraph,
    Section,
    explain,
    table,
)
from slosh_report.json_values import plain
from slosh_report.texts import Mark, Place, Text

AXES = "xyz"
PLAIN = 0.9
"""Least part of a direction along one axis that is named by it."""
QUANTITIES = (
    ("natural frequency", "natural_frequency_hz", "Hz", 4),
    ("damping ratio", "damping_ratio", "", 5),
    ("sloshing mass", "sloshing_mass", "kg", 4),
    ("container and liquid", "payload_mass", "kg", 3),
    ("delay of the sensor", "delay", "s", 4),
    ("stiffness of high waves α", "alpha", "", 2),
)
"""Name, key, unit and decimals."""


def force_document(found: ForceIdentification, before: Model, after: Model) -> Document:
    """Returns the result as a document.

    Args:
        found: the result.
        before, after: the model that came in, and that with the identified values.
    """
    data = Place(plain(force_data(found)))
    hertz = found.natural_frequency.value / (2.0 * math.pi)
    title = (
        f"First mode at {hertz:.3f} Hz, damping ratio {found.damping_ratio.value:.4f}, "
        f"sloshing mass {found.sloshing_mass.value:.3f} kg"
    )
    unknown = (found.unobserved,) if found.unobserved else ()
    values = _values(data)
    ways = tuple(
        f"acceleration along {direction(along)} of the container takes a force along "
        f"{direction(sensor, 'f')} of the sensor"
        for along, sensor in found.directions
    )
    residual: Text = (
        "residual below ", data.number("cutoff_hz", "", 1), " Hz: ",
        data.exact("residual_at_rest", 3), " N at rest, ", data.exact("residual_in_motion", 3),
        " N in motion",
    )  # fmt: skip
    told = tuple(f"note: {note}" for note in found.notes)
    models = (
        Paragraph("Before:"), Code(format_model(before)),
        Paragraph("With the identified values:"), Code(format_model(after)),
    )  # fmt: skip
    return Document(
        title,
        (
            Paragraph(f"from the force under the container in {found.name}", "subtitle"),
            *([Notice("open", "? Not identified", unknown)] if unknown else []),
            Lines(tuple(found.notes), kind="notes"),
        ),
        (
            Section(
                "Parameters",
                (values, explain(f"The force was read in {found.unit}; ", residual, ".")),
                "parameters",
            ),
            Section("Forces", _forces(found), "forces"),
            Section("Model", models, "model"),
        ),
        data.data,
        (values, Lines((*ways, residual, *told, *unknown))),
    )


def _values(data: Place) -> Block:
    def number(key: str) -> Any:
        return lambda row: data[row[1]].number(key, "", row[3])

    columns = (
        Column("quantity", lambda row: row[0], "name"),
        Column("model", number("model"), "n"),
        Column("found", number("value"), "n"),
        Column("standard error", number("error"), "n"),
        Column("unit", lambda row: row[2]),
    )
    known = [row for row in QUANTITIES if data.data[row[1]] is not None]
    return table("Identified values", columns, known, seen=False)


def _forces(found: ForceIdentification) -> tuple[Block, ...]:
    """Returns measured and modelled force over time, the liquid's part below."""
    figures = []
    for place, (along, sensor) in enumerate(found.directions):
        measured, modelled = found.measured[:, place], found.modelled[:, place]
        rest = modelled - found.liquid[:, place]
        where = (
            f"Motion along {direction(along)} of the container, force along "
            f"{direction(sensor, 'f')} of the sensor"
        )
        part = Mark("force of the liquid: less payload and zero of the sensor")
        charts = (
            _chart(found, f"force-{place}", Mark(where, "b"), "linear", (measured, modelled)),
            _chart(
                found, f"liquid-{place}", part, "nonlinear", (measured - rest, modelled - rest)
            ),
        )
        figures.append(Figure(charts))
    return tuple(figures)


def _chart(
    found: ForceIdentification, name: str, caption: Mark, kind: str, values: Sequence[Array]
) -> Chart:
    lines = (
        Line("measured", "measured", found.t, values[0]), Line("model", kind, found.t, values[1])
    )  # fmt: skip
    seen = "Line chart of measured and modelled force over time"
    return Chart(name, caption, seen, lines, "force [N]", 1.0)


def direction(vector: Array, prefix: str = "") -> str:
    """Formats a unit vector (3,): the name of an axis if it is near one, else its components."""
    place = int(abs(vector).argmax())
    if abs(vector[place]) >= PLAIN:
        return f"{'+' if vector[place] > 0.0 else '-'}{prefix}{AXES[place]}"
    return "(" + ", ".join(f"{value:.2f}" for value in vector) + ")"


def force_data(found: ForceIdentification) -> dict[str, Any]:
    """Returns the content of `identification.json`: SI units; frequencies in rad/s and in Hz."""
    turn = 2.0 * math.pi
    frequency = found.natural_frequency
    return {
        "name": found.name,
        "natural_frequency": _number(frequency),
        "natural_frequency_hz": _number(frequency, turn),
        "damping_ratio": _number(found.damping_ratio),
        "sloshing_mass": _number(found.sloshing_mass),
        "payload_mass": _number(found.payload),
        "delay": _number(found.delay),
        "alpha": found.stiffness and _number(found.stiffness),
        "directions": [
            {"container": along, "sensor": sensor, "sensor_axis": direction(sensor, "f")}
            for along, sensor in found.directions
        ],
        "residual_at_rest": found.noise_at_rest,
        "residual_in_motion": found.noise_moving,
        "cutoff_hz": found.cutoff,
        "unit": found.unit,
        "newton": UNITS[found.unit],
        "unobserved": found.unobserved,
        "notes": found.notes,
    }


def _number(one: Measured, divisor: float = 1.0) -> dict[str, float]:
    return {
        "value": one.value / divisor, "error": one.error / divisor, "model": one.model / divisor,
    }  # fmt: skip


def identified_model(model: Model, found: ForceIdentification) -> Model:
    """Returns the model with the measured natural frequency and damping ratio."""
    share = found.natural_frequency.value / found.natural_frequency.model
    return replace(
        model,
        natural_frequency=model.mode_frequency(1) * share,
        damping_ratio=found.damping_ratio.value,
        covariance=None,
    )
