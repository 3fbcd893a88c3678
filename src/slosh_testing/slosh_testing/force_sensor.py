"""Simulates a force sensor under a container, with noise, delay and vibration."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import lfilter

from slosh_base.types import Array
from slosh_discovery.force.liquid import SPRING, modal_force
from slosh_discovery.force.record import ForceRecord
from slosh_model.containers import X_AXIS
from slosh_model.model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_model.shapes.cylinder import Cylinder
from slosh_model.simulate import Inputs

FINE = 1000.0
"""Rate at which liquid and arm are simulated [Hz]."""


@dataclass(frozen=True, slots=True)
class SimulatedSensor:
    """A simulated force sensor with known parameters.

    Attributes:
        model: of the liquid.
        frequency, damping: of the first mode [rad/s, 1].
        alpha: of the cubic spring.
        payload: mass of container and liquid [kg].
        delay: [s].
        axes: (3, 3) sensor ← container; a reflection, too, where a sign is wrong.
        rate: of the force [Hz].
        noise: standard deviation of a sample [N].
        drift: of the zero over the record [N].
        cable: force of the cable at the motion's end [N], which hangs behind.
        ringing: vibration of the arm, of the peak acceleration, at `arm` [Hz].
        arm: frequency of the arm [Hz].
        distance: of the stroke [m].
        duration: of it [s].
        rest: behind it [s].
        plane: whether there is a second stroke across the first.
        turn: of the container about z, from the middle of the first stroke to that of the second
            [rad]; needs `plane`.
        in_base: whether the force is given in axes that do not turn with the container.
        seed: of the noise.
    """

    model: Model
    frequency: float
    damping: float
    alpha: float = 0.58
    payload: float = 1.5
    delay: float = 0.02
    axes: tuple[tuple[float, ...], ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    rate: float = 500.0
    noise: float = 0.02
    drift: float = 0.0
    cable: float = 0.0
    ringing: float = 0.0
    arm: float = 13.0
    distance: float = 0.3
    duration: float = 0.8
    rest: float = 8.0
    plane: bool = False
    turn: float = 0.0
    in_base: bool = False
    seed: int = 0

    @property
    def mass(self) -> float:
        """Sloshing mass of the first mode [kg]."""
        container = self.model.container
        return container.mass_ratio(1, X_AXIS) * container.volume * self.model.liquid.density

    def record(self) -> ForceRecord:
        """Returns a force record as a robot's bag would contain it."""
        rng = np.random.default_rng(self.seed)
        t, motion = self._motion()
        values = {FREQUENCY: self.frequency, DAMPING: self.damping}
        model = replace(self.model, modes=2)
        if not model.container.cornered:
            values[f"{SPRING}.alpha"] = self.alpha
        rung = Inputs(t, motion + self.ringing * self._rung(motion))
        liquid = modal_force(model, rung, values)
        assert liquid is not None
        force = self.payload * rung.acceleration + self.mass * liquid
        way = np.cumsum(np.cumsum(motion, axis=0), axis=0) / FINE**2
        size = max(float(np.abs(way).max()), 1e-9)
        force = force + self.cable * way / size
        half = 0.5 * self.turn * self._turned(t)
        if not self.in_base:
            cosine, sine = np.cos(2.0 * half), np.sin(2.0 * half)
            x, y, z = force.T
            force = np.column_stack([cosine * x + sine * y, cosine * y - sine * x, z])
        force = force @ np.array(self.axes).T
        at = np.arange(0.0, t[-1], 1.0 / self.rate)
        at = np.sort(at + rng.uniform(0.0, 0.2 / self.rate, len(at)))
        seen = np.column_stack([np.interp(at - self.delay, t, column) for column in force.T])
        walk = np.cumsum(rng.normal(size=(len(at), 3)), axis=0) / math.sqrt(len(at))
        seen += self.drift * walk + rng.normal(0.0, 1.0, 3)  # drift, and a zero that is not one
        seen += rng.normal(0.0, self.noise, seen.shape)
        turned = np.column_stack([0.0 * t, 0.0 * t, np.sin(half), np.cos(half)])
        return ForceRecord(
            f"seed {self.seed}",
            Inputs(t[::2], motion[::2], turned[::2] if self.turn else None),
            at,
            np.round(seen / 0.00625) * 0.00625,
        )

    def _turned(self, t: Array) -> Array:
        """Returns the part (N,) of the turn that is done at times [s]."""
        share = np.clip((t - 1.0 - 0.5 * self.duration) / (self.duration + 1.0), 0.0, 1.0)
        return np.asarray(share**2 * (3.0 - 2.0 * share))

    def _motion(self) -> tuple[Array, Array]:
        count = 2 if self.plane else 1
        length = 1.0 + count * self.duration + (count - 1) * 1.0 + self.rest
        t = np.arange(0.0, length, 1.0 / FINE)
        motion = np.zeros((len(t), 3))
        for axis in range(count):
            share = (t - 1.0 - axis * (self.duration + 1.0)) / self.duration
            within = (share > 0.0) & (share < 1.0)
            s = share[within]
            # The quintic: rest to rest.
            law = 60.0 * s - 180.0 * s**2 + 120.0 * s**3
            motion[within, axis] = self.distance / self.duration**2 * law
        return t, motion

    def _rung(self, motion: Array) -> Array:
        """Returns the vibration (N, 3) [m/s²] of a compliant arm excited by accelerations."""
        omega, damping = math.tau * self.arm, 0.05
        step = 1.0 / FINE
        pole = np.exp((-damping + 1j * math.sqrt(1.0 - damping**2)) * omega * step)
        jerk = np.diff(motion, axis=0, prepend=0.0)
        return np.real(lfilter([1.0], [1.0, -pole], jerk.astype(complex), axis=0))


def drawn_sensor(seed: int) -> SimulatedSensor:
    """Returns a random cup and force sensor for a seed."""
    rng = np.random.default_rng([38, seed])
    radius = float(rng.uniform(0.035, 0.08))
    model = Model(Cylinder(radius=radius, fill_height=radius * float(rng.uniform(0.8, 2.0))))
    frequency = model.mode_frequency(1) * float(rng.uniform(0.95, 1.05))
    axes, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    period = math.tau / frequency
    duration = float(rng.uniform(1.6, 3.5)) * period
    liquid = model.container.volume * model.liquid.density
    return SimulatedSensor(
        model, frequency, float(rng.uniform(0.003, 0.02)),
        alpha=float(rng.uniform(0.3, 0.8)),
        payload=liquid + float(rng.uniform(0.2, 2.0)),
        delay=float(rng.uniform(-0.05, 0.1)),
        axes=tuple(map(tuple, axes.tolist())),
        rate=float(rng.choice([100.0, 125.0, 250.0, 500.0, 1000.0])),
        noise=float(rng.uniform(0.005, 0.05)) * math.sqrt(liquid / 0.5),
        drift=float(rng.uniform(0.0, 0.1)),
        cable=float(rng.uniform(0.0, 0.3)),
        ringing=float(rng.uniform(0.0, 0.15)),
        arm=float(rng.uniform(11.0, 20.0)),
        distance=float(rng.uniform(1.0, 4.0)) * duration**2 / 5.77,
        duration=duration,
        rest=float(rng.uniform(6.0, 12.0)),
        plane=bool(rng.random() < 0.3),
        seed=seed,
    )  # fmt: skip
