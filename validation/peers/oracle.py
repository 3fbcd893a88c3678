"""Computes the true modal states of a test case, which are input of the regressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from slosh_discovery.discover.motion import MeasuredMotion
from slosh_model.simulate import Inputs
from validation.blind import drive as truth_drive
from validation.blind import gauss, theory
from validation.blind.cases import Case
from validation.blind.truth import LONGEST_STEP_ROUGH, constants, simulate
from validation.blind.truth_model import Truth
from validation.peers.drive import Drive, drive_at

Array = NDArray[np.float64]
Random = np.random.Generator


@dataclass(frozen=True)
class Latent:
    """The true motion of the first mode at the input samples, in axes that do not yaw.

    Attributes:
        inputs: the motion, as the discovery gets it.
        drive: what the base model makes of it.
        q, v, acceleration: (T, 2) modal coordinates and their derivatives [m, m/s, m/s²].
        msh: (T,) true maximum height over the wall [m].
    """

    inputs: Inputs
    drive: Drive
    q: Array
    v: Array
    acceleration: Array
    msh: Array

    @cached_property
    def t(self) -> Array:
        """Times (T,) of the samples [s]."""
        return self.inputs.t


def base_of(case: Case) -> Truth:
    """Returns the test case's base model in the form of the truth simulator."""
    return case.truth.without(*case.hidden)


def oracle(case: Case) -> tuple[list[Latent], list[Latent]]:
    """Returns the true modal states of the fitted and of the held-out motions."""
    base = base_of(case)
    return _each(case.truth, base, case.motions), _each(case.truth, base, case.holdout)


def _each(truth: Truth, base: Truth, motions: Sequence[MeasuredMotion]) -> list[Latent]:
    return [latent(truth, base, motion.inputs) for motion in motions]


def latent(truth: Truth, base: Truth, inputs: Inputs) -> Latent:
    """Returns the true modal state of one motion."""
    wave = simulate(truth, inputs)
    rows = np.searchsorted(wave.t, inputs.t - 0.1 * LONGEST_STEP_ROUGH)
    states = wave.states[rows]
    v, acceleration = _derivatives(truth, inputs, states)
    drive = drive_at(base, inputs, inputs.t)
    return Latent(inputs, drive, states[:, :2], v, acceleration, wave.msh[rows])


def noisy(exact: Latent, noise: float, random: Random) -> tuple[Array, Array]:
    """Adds white noise to the modal coordinates (T, 2) [m] and velocities (T, 2) [m/s].

    The velocities' is ω times the coordinates': the same share of a wave of the first mode.
    """
    omega = float(np.sqrt(exact.drive.squared[0]))
    shape = exact.q.shape
    q = exact.q + random.normal(0.0, noise, shape)
    return q, exact.v + random.normal(0.0, noise * omega, shape)


def wall_gain(base: Truth) -> float:
    """Returns the wall height per modal displacement |q| of the base model."""
    nonlinear = base.has("surface_nonlinearity")
    gain = theory.bessel_gain if nonlinear else theory.planar_gain
    return float(gain(base.radius, np.array(base.fill_height))[0])


def _derivatives(truth: Truth, inputs: Inputs, states: Array) -> tuple[Array, Array]:
    """Returns the true q̇ and q̈, (T, 2) each, from the simulator's equations."""
    nodes = truth_drive.nodes_at(truth, inputs, inputs.t, 0.0)
    slopes = gauss.slopes_of(np.ascontiguousarray(states), nodes, constants(truth))
    q, v, rate = states[:, :2], slopes[:, :2], slopes[:, 2:4]
    kappa = truth.value("yaw_coupling", "kappa", 0.0)
    attitude = truth_drive.attitude_at(inputs, inputs.t)
    spin = kappa * attitude.rate[:, 2:]
    own = v - spin * _quarter(q)  # of the mass against the liquid that yaw drags
    c2 = nodes[:, gauss.MODE + 2, np.newaxis] ** 2
    # ṗ = ẇ + c² [(q̇·w + q·ẇ) q + (q·w) q̇] for p = w + c² (q·w) q
    rest = rate - c2 * (_dot(v, own) * q + _dot(q, own) * v)
    own_rate = rest - c2 * _dot(q, rest) / (1.0 + c2 * _dot(q, q)) * q
    turn = kappa * attitude.angular_acceleration[:, 2:]
    return v, own_rate + turn * _quarter(q) + spin * _quarter(v)


def _quarter(vectors: Array) -> Array:
    return np.column_stack([-vectors[:, 1], vectors[:, 0]])


def _dot(one: Array, other: Array) -> Array:
    return np.asarray(np.sum(one * other, axis=1, keepdims=True))
