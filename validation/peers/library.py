"""Candidate terms of the liquid's equation for regressions, and the effect of each term.

With q the first mode's coordinates the base model says

    q̈ + c² (|q̇|² + q·q̈) q = -2ζω (q̇ + c² (q·q̇) q) - ω² (1 + α |q|²/R² + z̈/g) q - s̈,

and the residual is its left side less its right. A hidden effect adds terms to the right side that
are linear in their coefficients, so that a sparse regression can answer exactly.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from validation.blind.gauss import CREEP
from validation.blind.truth_model import Truth
from validation.peers.drive import GRAVITY, Drive

Array = NDArray[np.float64]

EFFECT_OF: Mapping[str, str] = {
    "az q": "vertical_acceleration",
    "paraboloid": "surface_nonlinearity",
    "cubic stiffness": "surface_nonlinearity",
    "damping": "damping_mismatch",
    "quadratic damping": "quadratic_damping",
    "dry friction": "contact_line_friction",
    "stiffness": "fill_level",
    "stiffness t": "fill_loss",
    "anisotropy cos": "anisotropic_stiffness",
    "anisotropy sin": "anisotropic_stiffness",
    "yaw drag": "yaw_coupling",
    "yaw centrifugal": "yaw_coupling",
    "lean": "gravity_tilt",
    "constant x": "static_tilt",
    "constant y": "static_tilt",
    "lever x": "lever_arm",
    "lever y": "lever_arm",
    "lever z": "lever_arm",
    "jerk": "robot_dynamics",
    "gain": "accel_gain",
}
"""Which effect a term stands for."""
TERMS = tuple(EFFECT_OF)

EXPRESSIBLE = (
    "vertical_acceleration",
    "surface_nonlinearity",
    "damping_mismatch",
    "quadratic_damping",
    "contact_line_friction",
    "fill_level",
    "fill_loss",
    "anisotropic_stiffness",
    "yaw_coupling",
    "gravity_tilt",
    "static_tilt",
    "lever_arm",
    "accel_gain",
)
"""Effects that terms in the first mode's equation say, fill_loss and static_tilt to first order.

Left out: what the sensor does (time_offset, height_scale, height_offset, frame_saturation,
visible_arc, crest_asymmetry, draining_film) leaves the motion as it is; second_mode and
robot_dynamics have states of their own.
"""
ALSO: Mapping[str, frozenset[str]] = {
    # Depth moves frequency, formula damping and the paraboloid's curvature together.
    "fill_level": frozenset({"damping", "paraboloid", "cubic stiffness"}),
    "fill_loss": frozenset({"stiffness", "damping", "paraboloid", "cubic stiffness"}),
    # The acceleration's component along a leaning axis is a little smaller.
    "static_tilt": frozenset({"gain"}),
}
"""Terms that a hidden effect brings along: they are neither asked for nor wrong."""


def names(support: Iterable[str], hidden: Iterable[str]) -> set[str]:
    """Returns the effects to which terms belong, without those that a hidden effect entails."""
    brought = frozenset[str]().union(*(ALSO.get(effect, frozenset()) for effect in hidden))
    return {EFFECT_OF[term] for term in support if term not in brought}


def residual(drive: Drive, q: Array, v: Array, acceleration: Array) -> Array:
    """Returns by how much the base model's equation is violated (..., 2) [m/s²].

    Args:
        drive: T instants, or one.
        q, v, acceleration: (..., 2) modal coordinates and their derivatives; `...` is T, or
            any batch where the drive is of one instant.
    """
    c2 = _wide(drive.curvature**2)
    inertia = c2 * (_dot(v, v) + _dot(q, acceleration)) * q
    momentum = v + c2 * _dot(q, v) * q
    force = _wide(drive.damping) * momentum + _spring(drive, q) * q + drive.felt[..., :2]
    return np.asarray(acceleration + inertia + force)


def terms(drive: Drive, q: Array, v: Array, acceleration: Array) -> Array:
    """Returns the candidate terms (..., 2, TERMS) of the equation of motion at given states.

    Coefficients of levers are in metres, of the jerk in seconds, of `stiffness t` in 1/s.
    """
    speed2, r2 = _dot(v, v), _dot(q, q)
    radius, squared = _wide(drive.radius), _wide(drive.squared)
    spring = _spring(drive, q)
    damping = _wide(drive.damping)
    momentum = v + _wide(drive.curvature**2) * _dot(q, v) * q
    bulge = (squared / GRAVITY) ** 2
    spin = _wide(drive.spin)
    one = np.ones_like(q)
    upright = one * (1.0 + _wide(drive.felt[..., 2]) / GRAVITY) * GRAVITY
    columns = {
        "az q": -squared * _wide(drive.felt[..., 2]) / GRAVITY * q,
        "paraboloid": -bulge * (speed2 + _dot(q, acceleration) + damping * _dot(q, v)) * q,
        "cubic stiffness": -squared * r2 / radius**2 * q,
        "damping": -damping * momentum,
        "quadratic damping": -np.sqrt(speed2) / radius * v,
        "dry friction": -GRAVITY * v / np.sqrt(speed2 + CREEP**2),
        "stiffness": -spring * q,
        "stiffness t": -spring * _wide(drive.t) * q,
        **_anisotropy(drive, spring, q),
        "yaw drag": 2.0 * spin * _quarter(v)
        + (_wide(drive.spin_rate) + damping * spin) * _quarter(q),
        "yaw centrifugal": spin**2 * q,
        "lean": _pushed(drive, drive.lean, q),
        "constant x": -upright * np.array([1.0, 0.0]),
        "constant y": -upright * np.array([0.0, 1.0]),
        **{
            f"lever {axis}": _pushed(drive, drive.arms[..., k, :], q)
            for k, axis in enumerate("xyz")
        },
        "jerk": _pushed(drive, drive.jerk, q),
        "gain": _pushed(drive, drive.table, q),
    }
    return np.stack([columns[name] for name in TERMS], axis=-1)


def solved(drive: Drive, q: Array, v: Array, coefficients: Array) -> Array:
    """Returns the acceleration (B, 2) of models with added terms, at one time [m/s²].

    Args:
        drive: one instant.
        q, v: (B, 2) the models' states.
        coefficients: (B, TERMS) of each model.
    """
    zero = np.zeros_like(q)
    added = np.einsum("bin,bn->bi", terms(drive, q, v, zero), coefficients)
    rest = added - residual(drive, q, v, zero)
    # What multiplies q̈ is the mass matrix of a paraboloid: 1 + bend q qᵀ.
    bulge = (drive.squared / GRAVITY) ** 2 * coefficients[:, TERMS.index("paraboloid")]
    bend = _wide(drive.curvature**2 + bulge)
    return np.asarray(rest - bend * _dot(q, rest) / (1.0 + bend * _dot(q, q)) * q)


def true_coefficients(base: Truth, truth: Truth, squared: float, damping: float) -> Array:
    """Returns the true coefficients (TERMS,) of the hidden effects that the terms express exactly.

    Args:
        base: the model without what is hidden.
        truth: with it.
        squared, damping: the truth's own ω² and 2ζω over the base's.
    """

    def value(effect: str, parameter: str, neutral: float = 0.0) -> float:
        return truth.value(effect, parameter, neutral)

    def new(effect: str) -> float:
        return float(truth.has(effect) and not base.has(effect))

    e, axis = value("anisotropic_stiffness", "e"), value("anisotropic_stiffness", "axis")
    kappa = value("yaw_coupling", "kappa")
    curved = new("surface_nonlinearity")
    true = {
        "az q": new("vertical_acceleration"),
        "paraboloid": curved,
        "cubic stiffness": curved * value("surface_nonlinearity", "alpha"),
        "damping": damping - 1.0,
        "quadratic damping": value("quadratic_damping", "beta"),
        "dry friction": value("contact_line_friction", "mu"),
        "stiffness": squared - 1.0,
        "anisotropy cos": e * np.cos(2.0 * axis),
        "anisotropy sin": e * np.sin(2.0 * axis),
        "yaw drag": kappa,
        "yaw centrifugal": kappa**2,
        "lean": new("gravity_tilt"),
        **{f"lever {name}": value("lever_arm", name) for name in "xyz"},
        "gain": value("accel_gain", "gain", 1.0) - 1.0,
    }
    return np.array([true.get(name, 0.0) for name in TERMS])


def _spring(drive: Drive, q: Array) -> Array:
    """Returns the base model's ω² (..., 1), with its dependence on amplitude and lift."""
    bent = _wide(drive.alpha / drive.radius**2) * _dot(q, q)
    lift = _wide(drive.vertical * drive.felt[..., 2]) / GRAVITY
    return np.asarray(_wide(drive.squared) * (1.0 + bent + lift))


def _pushed(drive: Drive, vector: Array, q: Array) -> Array:
    """Returns the acceleration (..., 2) of the mass that a container acceleration causes."""
    lift = _wide(drive.vertical * drive.squared * vector[..., 2]) / GRAVITY
    return np.asarray(-vector[..., :2] - lift * q)


def _anisotropy(drive: Drive, spring: Array, q: Array) -> dict[str, Array]:
    twice = 2.0 * drive.heading
    cos, sin = np.cos(twice), np.sin(twice)
    x, y = q[..., 0], q[..., 1]
    along = np.stack([cos * x + sin * y, sin * x - cos * y], axis=-1)
    across = np.stack([cos * y - sin * x, cos * x + sin * y], axis=-1)
    return {"anisotropy cos": -spring * along, "anisotropy sin": -spring * across}


def _quarter(vector: Array) -> Array:
    """Rotates vectors by 90 degrees."""
    return np.stack([-vector[..., 1], vector[..., 0]], axis=-1)


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.sum(one * other, axis=-1, keepdims=True))


def _wide(value: Array) -> Array:
    return np.asarray(value)[..., np.newaxis]
