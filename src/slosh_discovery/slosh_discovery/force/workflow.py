"""Runs an identification from a force record and a model to its result."""

from __future__ import annotations

import math

import numpy as np

from slosh_base.types import Array
from slosh_discovery.errors import SloshDiscoveryError
from slosh_discovery.force.fit import Fit, fit_force
from slosh_discovery.force.liquid import liquid_model
from slosh_discovery.force.prepared import PreparedForce, prepared
from slosh_discovery.force.record import ForceRecord
from slosh_discovery.force.result import (
    NEWTON,
    ForceIdentification,
    Measured,
    likely_unit,
)
from slosh_discovery.force.tuning import TUNING
from slosh_estimator.sensed.payload import UNITS
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY


def identify_force(record: ForceRecord, model: Model) -> ForceIdentification:
    """Identifies the first mode, its mass and the payload.

    Args:
        record: motion and force.
        model: container and liquid, from whose frequency and damping the search starts.

    Raises:
        SloshDiscoveryError: the record does not tell; one line says why and what would.
    """
    data = prepared(record, model)
    full = liquid_model(model)
    try:
        fit = fit_force(data, full)
    except SloshDiscoveryError as reason:
        raise SloshDiscoveryError(f"{record.name}: {reason}") from None
    axis = _axis(fit, model)
    share = model.container.mass_ratio(1, axis) / model.container.mass_ratio(1, X_AXIS)
    mass, error = float(fit.linear.values[1]) * share, _error(fit, -1) * share
    if not mass > TUNING.least_signal * error:
        raise SloshDiscoveryError(
            f"{record.name}: no sloshing force stands out of the noise (mass {mass:.3g} kg ± "
            f"{error:.2g} kg): move faster, or stop abruptly and record 10 s of rest"
        )
    expected = model.container.mass_ratio(1, axis) * model.container.volume
    expected *= model.liquid.density
    unit = likely_unit(mass, expected)
    # A mass that sparse samples lower says nothing about fill height or unit.
    told = [] if data.gain < TUNING.least_gain and unit == NEWTON else _mass_notes(
        unit, mass * UNITS[unit], expected
    )  # fmt: skip
    notes = [*data.notes, *told]
    return _result(record, model, data, fit, axis, share * UNITS[unit], expected, unit, notes)


def _axis(fit: Fit, model: Model) -> int:
    """Returns the container's axis along which it moved most."""
    if not model.container.cornered:
        return X_AXIS
    return X_AXIS if abs(fit.problem.across[0, 0]) >= abs(fit.problem.across[1, 0]) else Y_AXIS


def _error(fit: Fit, place: int) -> float:
    return math.sqrt(max(float(fit.covariance[place, place]), 0.0))


def _mass_notes(unit: str, mass: float, expected: float) -> list[str]:
    notes = []
    if unit != NEWTON:
        notes.append(f"the forces are in {unit}, by the sloshing mass: read as {UNITS[unit]:g} N")
    off = mass / expected if expected > 0.0 else math.nan
    if math.isfinite(off) and abs(math.log(off)) > math.log(TUNING.unit):
        notes.append(
            f"the sloshing mass is {off:.2g} times the model's: check fill height, container and "
            "the unit of the force (N)"
        )
    return notes


def _result(
    record: ForceRecord,
    model: Model,
    data: PreparedForce,
    fit: Fit,
    axis: int,
    scale: float,
    expected: float,
    unit: str,
    notes: list[str],
) -> ForceIdentification:
    """Creates the identification result, in SI units, from a fit."""
    container, newton = model.container, UNITS[unit]
    ratio = container.natural_frequency(1, axis) / container.natural_frequency(1, X_AXIS)
    values = fit.problem.values(fit.vector)
    frequency, damping = values[FREQUENCY], values[DAMPING]
    known = fit.problem.start
    alpha = fit.problem.stiffness
    # What lies between the samples lowers the wave's force, at most by the gain.
    unseen = (1.0 / data.gain - 1.0) * float(fit.linear.values[1])
    mass_error = math.hypot(_error(fit, -1), unseen)
    measured = data.force @ fit.problem.sensor
    return ForceIdentification(
        name=record.name,
        natural_frequency=_with_model_error(
            0, frequency * ratio, frequency * ratio * _error(fit, 0),
            model.mode_frequency(1) * ratio,
        ),
        damping_ratio=_with_model_error(
            1, damping, damping * _error(fit, 1), known[DAMPING]
        ),
        sloshing_mass=_with_model_error(
            2, float(fit.linear.values[1]) * scale, mass_error * scale, expected
        ),
        payload=Measured(
            float(fit.linear.values[0]) * newton, math.hypot(_error(fit, -2), unseen) * newton
        ),
        delay=Measured(float(fit.vector[2]), _error(fit, 2)),
        directions=_directions(fit.problem.across, fit.problem.sensor),
        stiffness=None if alpha is None else Measured(
            float(fit.vector[3]), _error(fit, 3), alpha
        ),
        noise_at_rest=fit.noise[0] * newton,
        noise_moving=fit.noise[1] * newton,
        cutoff=TUNING.cutoff * model.mode_frequency(1) / (2.0 * math.pi),
        unit=unit,
        unobserved=unobserved(fit.problem.across, data, frequency),
        notes=tuple(notes),
        t=data.inputs.t[data.rows],
        measured=measured * newton,
        modelled=(measured + fit.linear.residual) * newton,
        liquid=fit.linear.basis[:, :, 1] * fit.linear.values[1] * newton,
    )  # fmt: skip


def _with_model_error(place: int, value: float, error: float, model: float) -> Measured:
    return Measured(value, math.hypot(error, TUNING.model_error[place] * value), model)


def _directions(across: Array, sensor: Array) -> tuple[tuple[Array, Array], ...]:
    return tuple((across[:, j].copy(), sensor[:, j].copy()) for j in range(across.shape[1]))


def unobserved(across: Array, data: PreparedForce, frequency: float) -> str:
    """Describes in a sentence what the record cannot determine; empty if it determines all."""
    parts = []
    if across.shape[1] == 1:
        parts.append(
            "the sensor's turn about the line of the motion, and the modes across it: move along "
            "a second direction"
        )
    rest = np.count_nonzero(data.usable & ~data.moving) / len(data.rows)
    length = rest * float(np.ptp(data.inputs.t)) * frequency / (2.0 * math.pi)
    if length < 2.0 * TUNING.least_periods:
        parts.append("the damping, but roughly: record 10 s of rest behind a motion")
    return f"Not observed: {'; '.join(parts)}." if parts else ""
