"""Simulates random robot motions and sensors with usual errors, for tests of input checks.

A container is moved by jerk-limited moves, long accelerations, circles, shakes and slow drives,
and rests in between; it tilts against the acceleration, is poured from, or spins. The sensor has
noise, vibration, a bias and a drift. Nothing is wrong with them: no check may name anything.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]

GRAVITY = 9.81
UP = np.array((0.0, 0.0, GRAVITY))
FASTEST = 2.5
"""[m/s]"""


@dataclass(frozen=True)
class HonestInput:
    """Simulated sensor data of a random motion without gross faults.

    Attributes:
        stamps: (N,) [ns].
        acceleration: (N, 3) without gravity, world's axes, as measured [m/s²].
        force: (N, 3) specific force in the container's axes, as measured [m/s²].
        rate: (N, 3) angular velocity in the container's axes, as measured [rad/s].
        true: (N, 3) the acceleration without the sensor's faults [m/s²].
        attitude: world ← container, N rotations.
        position: (N, 3) of the container [m].
    """

    stamps: NDArray[np.int64]
    acceleration: Array
    force: Array
    rate: Array
    true: Array
    attitude: Rotation
    position: Array


def honest_input(seed: int) -> HonestInput:
    """Returns the simulated sensor data for a seed."""
    random = np.random.default_rng(seed)
    rate = float(random.choice([50.0, 125.0, 250.0, 500.0]))
    pieces = [np.zeros((int(rate * random.choice([0.0, 0.3, 1.0, 3.0])), 3))]
    for _ in range(random.integers(1, 9)):
        pieces.append(_move(random, rate))
        pieces.append(np.zeros((int(rate * random.choice([0.0, 0.2, 0.6, 1.5, 4.0])), 3)))
    true = np.concatenate([*pieces, np.zeros((int(rate), 3))])
    kind = random.choice(["upright", "tilt", "pour", "spin"], p=[0.4, 0.3, 0.15, 0.15])
    if random.random() < 0.2 and kind != "pour":  # a recording that begins somewhere
        true = true[random.integers(0, len(true) // 2) :]
    t = np.arange(len(true)) / rate
    attitude = _attitude(random, str(kind), true, t)
    between = (attitude[:-1].inv() * attitude[1:]).as_rotvec() * rate
    turning = np.concatenate([between, between[-1:]])
    force = attitude.inv().apply(true + UP)
    stamps = np.rint(1e9 * (t + random.uniform(0.0, 0.2, len(t)) / rate)).astype(np.int64)
    velocity = np.cumsum(true, axis=0) / rate
    return HonestInput(
        stamps + 1_700_000_000_000_000_000,
        true + _faults(random, t),
        force + _faults(random, t),
        turning + random.normal(0.0, 0.005, (len(t), 3)) + random.normal(0.0, 0.004, 3),
        true,
        attitude,
        np.cumsum(velocity, axis=0) / rate + random.uniform(-1.0, 1.0, 3),
    )


def _move(random: np.random.Generator, rate: float) -> Array:
    """Draws accelerations (M, 3) of a move that begins and ends at rest [m/s²]."""
    kind = random.choice(
        ["point", "long", "circle", "shake", "drive"], p=[0.4, 0.2, 0.1, 0.2, 0.1]
    )
    if kind == "circle":
        radius, strongest = random.uniform(0.1, 0.6), random.uniform(0.5, 8.0)
        speed = 0.5 * min(np.sqrt(strongest * radius), FASTEST)  # on average
        turns = int(random.integers(1, 4))
        swept = _smooth(int(rate * max(2.0 * np.pi * turns * radius / speed, 0.4)))
        angle = 2.0 * np.pi * turns * np.cumsum(swept) / swept.sum()
        path = radius * np.column_stack((np.cos(angle), np.sin(angle), np.zeros_like(angle)))
        found = np.gradient(np.gradient(path, axis=0), axis=0) * rate * rate
        return np.asarray(found - found.mean(axis=0))
    if kind == "shake":
        seconds, frequency = random.uniform(1.0, 6.0), random.uniform(0.5, 4.0)
        t = np.arange(int(seconds * rate)) / rate
        size = min(random.uniform(0.5, 6.0), FASTEST * 2.0 * np.pi * frequency)
        wave = size * np.sin(2.0 * np.pi * frequency * t) * np.sin(np.pi * t / t[-1]) ** 2
        return np.outer(wave - wave.mean(), _direction(random))
    sizes = {"point": (1.0, 9.0), "long": (0.5, 4.0), "drive": (0.15, 0.6)}[kind]
    limit = random.uniform(*sizes)
    speed = random.uniform(0.2, 1.5 if kind == "drive" else FASTEST)
    ramp = random.uniform(0.02, 0.2)
    plateau = max(speed / limit - ramp, 0.0)
    pulse = _pulse(rate, ramp, plateau)
    pulse *= speed * rate / pulse.sum()
    cruise = np.zeros(int(rate * random.choice([0.0, 0.1, 0.5, 2.0])))
    other = _pulse(rate, ramp, plateau * random.uniform(0.6, 1.6))
    other *= speed * rate / other.sum()
    return np.outer(np.concatenate([pulse, cruise, -other]), _direction(random))


def _pulse(rate: float, ramp: float, plateau: float) -> Array:
    up = np.sin(np.linspace(0.0, 0.5 * np.pi, max(int(ramp * rate), 2))) ** 2
    return np.concatenate([up, np.ones(int(plateau * rate)), up[::-1]])


def _smooth(count: int) -> Array:
    return np.asarray(np.sin(np.pi * (np.arange(count) + 0.5) / count) ** 2)


def _direction(random: np.random.Generator) -> Array:
    v = random.normal(size=3) * (1.0, 1.0, random.choice([0.0, 0.3, 1.0]))
    return np.asarray(v / np.linalg.norm(v))


def _attitude(random: np.random.Generator, kind: str, acceleration: Array, t: Array) -> Rotation:
    """Draws an attitude over time: upright, tilting, pouring or spinning."""
    turn = Rotation.from_rotvec(np.zeros((len(t), 3)))
    if kind == "tilt":
        up = random.uniform(0.3, 1.0) * acceleration + UP
        width = max(int(0.06 / (t[1] - t[0])), 1)
        kernel = np.ones(width) / width
        up = np.column_stack([np.convolve(column, kernel, "same") for column in up.T])
        up[:, 2] = np.maximum(up[:, 2], np.hypot(up[:, 0], up[:, 1]))  # at most 45°
        up /= np.linalg.norm(up, axis=1)[:, None]
        axis = np.cross([0.0, 0.0, 1.0], up)
        turn = Rotation.from_rotvec(axis * (np.arccos(up[:, 2]) / np.maximum(
            np.linalg.norm(axis, axis=1), 1e-12))[:, None])  # fmt: skip
    if kind == "pour":
        start, held = random.uniform(1.0, 3.0), random.uniform(0.5, 8.0)
        share = np.clip((t - start) / 0.8, 0.0, 1.0) - np.clip((t - start - held) / 0.8, 0.0, 1.0)
        angle = random.uniform(0.05, 1.2) * share * share * (3.0 - 2.0 * share)
        heading = random.uniform(0.0, 2.0 * np.pi)
        turn = Rotation.from_rotvec(np.outer(angle, [np.cos(heading), np.sin(heading), 0.0]))
    if kind == "spin":
        turn = Rotation.from_rotvec(np.outer(random.uniform(-6.0, 6.0) * t, [0.0, 0.0, 1.0]))
    return Rotation.from_euler("z", random.uniform(-np.pi, np.pi)) * turn


def _faults(random: np.random.Generator, t: Array) -> Array:
    """Draws noise, vibration, bias and drift of a sensor, (N, 3) [m/s²]."""
    noise = random.choice([0.0, 0.01, 0.05]) * random.normal(size=(len(t), 3))
    frequency, size = random.uniform(5.0, 80.0), random.choice([0.0, 0.1, 0.5])
    shake = np.sin(2.0 * np.pi * frequency * t + random.uniform(0.0, 6.0))
    bias = random.normal(size=3)
    bias *= random.uniform(0.0, 0.1) / np.linalg.norm(bias)
    drift = np.outer(t, random.normal(0.0, 0.0005, 3))
    return np.asarray(noise + size * np.outer(shake, _direction(random)) + bias + drift)
