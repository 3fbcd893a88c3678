"""Adds realistic sensor and input errors to the synthetic test cases of the discovery.

A dirty case is the clean one of its name, motion by motion, with other errors of the same size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from slosh_model.interpolation import columns_at
from slosh_model.simulate import Inputs
from validation.blind.hidden import LISTED

Array = NDArray[np.float64]
Random = np.random.Generator


@dataclass(frozen=True, slots=True)
class Dirt:
    """Errors of measured heights and inputs: correlated noise, outliers, losses, jitter.

    Attributes:
        correlation: of neighbouring samples' noise.
        outliers: share of the samples that are outliers,
        outlier: by so much, up or down [m].
        lost: share of the frames that are missing, in bursts
        burst: of so many frames on the average.
        jitter: a frame's stamp is off by at most so much, evenly [s].
        input_rate: of the inputs that the workflow gets [Hz].
        input_noise: standard deviation of each of their samples [m/s²].
        input_bias: size of a constant that is added to them, in any horizontal direction [m/s²].
        input_quantum: to which they are rounded [m/s²]; 0: they are not.
        tag: in the names of the cases.
    """

    correlation: float = 0.7
    outliers: float = 0.01
    outlier: float = 3e-3
    lost: float = 0.1
    burst: float = 5.0
    jitter: float = 4e-3
    input_rate: float = 125.0
    input_noise: float = 0.0
    input_bias: float = 0.0
    input_quantum: float = 0.0
    tag: str = "dirty"

    def late(self, random: Random, count: int) -> Array:
        """Draws delays of the image stamps (M,) after the images were taken [s]."""
        return random.uniform(-self.jitter, self.jitter, count)

    def errors(self, random: Random, shape: tuple[int, int], noise: float) -> Array:
        """Draws autocorrelated noise of given standard deviation, with outliers, (M, K) [m]."""
        fresh = random.normal(0.0, noise, shape)
        fresh[1:] *= np.sqrt(1.0 - self.correlation**2)
        errors = np.asarray(lfilter([1.0], [1.0, -self.correlation], fresh, axis=0))
        struck = random.random(shape) < self.outliers
        errors[struck] += self.outlier * random.choice([-1.0, 1.0], int(struck.sum()))
        return errors

    def missing(self, random: Random, count: int) -> NDArray[np.bool_]:
        """Draws which images (M,) are missing, in bursts of random length."""
        gone = np.zeros(count, dtype=np.bool_)
        start = self.lost / ((1.0 - self.lost) * self.burst)
        here = bool(random.random() < self.lost)
        for i in range(count):
            gone[i] = here
            here = bool(random.random() < (1.0 - 1.0 / self.burst if here else start))
        return gone

    def sampled(self, random: Random, inputs: Inputs) -> Inputs:
        """Returns the inputs at another rate, with the errors of an accelerometer."""
        count = int((inputs.t[-1] - inputs.t[0]) * self.input_rate)
        t = inputs.t[0] + np.arange(count + 1) / self.input_rate

        def taken(columns: Array | None) -> Array | None:
            return None if columns is None else columns_at(t, inputs.t, columns)

        acceleration = columns_at(t, inputs.t, inputs.acceleration)
        if self.input_noise > 0.0:
            acceleration += random.normal(0.0, self.input_noise, acceleration.shape)
        if self.input_bias > 0.0:
            side = random.uniform(0.0, 2.0 * np.pi)
            acceleration[:, :2] += self.input_bias * np.array([np.cos(side), np.sin(side)])
        if self.input_quantum > 0.0:
            acceleration = self.input_quantum * np.round(acceleration / self.input_quantum)
        return Inputs(t, acceleration, taken(inputs.attitude), taken(inputs.angular_velocity))


DIRT = Dirt()
NOISES = (0.02, 0.05, 0.2, 0.0)
"""Of the accelerometers of the noisy cases [m/s²],"""
RATES = (1000.0, 500.0, 250.0, 125.0)
"""their rates [Hz],"""
BIASES = (0.0, 0.0, 0.02)
"""biases [m/s²]"""
QUANTA = (0.0, 0.0, 0.0, 0.01, 0.04)
"""and resolutions [m/s²]."""


def noisy_inputs(index: int) -> Dirt:
    """Returns input errors of an accelerometer alone, which depend on the case's number.

    Cases that hide the same effect, one list apart, have another noise, too.
    """
    number = index + index // len(LISTED)
    return Dirt(
        correlation=0.0,
        outliers=0.0,
        lost=0.0,
        jitter=0.0,
        input_rate=RATES[number // len(NOISES) % len(RATES)],
        input_noise=NOISES[number % len(NOISES)],
        input_bias=BIASES[number % len(BIASES)],
        input_quantum=QUANTA[number % len(QUANTA)],
        tag="noisy",
    )
