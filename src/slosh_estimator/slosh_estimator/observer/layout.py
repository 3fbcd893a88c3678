"""Names of the columns in the arrays of the observer's compiled functions."""

from __future__ import annotations

OMEGA, ZETA, GAIN = range(3)
"""Columns of a block, one for each mode and axis: ω' [rad/s], ζ', wall height per displacement."""
PHI, SENSITIVITY, NOISE = 3, 7, 11
"""Since the anchor: the transition matrix (4), the derivatives of q and q̇ by ε and κ (4), and the
covariance that the noise has added (3)."""
BLOCK = 14

FREQUENCY, DAMPING, LEVEL, CLOCK = range(4)
"""The slow parameters ε, κ [1], the still level [m] and by how much stamps of measurements are
late [s]."""
PARAMETERS = 4

(
    FLOOR, SHARE, WAVE, MEMORY, FREQUENCY_WALK, DAMPING_WALK, LEVEL_WALK, CLOCK_WALK, GATE, COMMON,
    FORM, STEEP, MOST_FREQUENCY, MOST_DAMPING, RELATIVE, ALIKE, MEAN,
    LARGE,
) = range(18)  # fmt: skip
"""Noise: spectral density of w at rest [m²/s³]; its amplitude as parts of the acceleration and of
the wave's own, and how long such an error lasts [s]; random walks of ε, κ [1/s], of the level
[m²/s] and of the clock [s]; the largest innovation, as of a normal deviate; the part of a variance
that all points of a measurement share; error of a height η by the form of the wave, in η²/R;
height of a wave whose own error is twice as large, as part of R; largest |ε| and |κ|; error of a
height as part of the wave; how long errors of heights are alike, and time of the average at rest
[s]; wave of a correction that is carried on by the nonlinear equations, as part of R."""
NOISES = 18

TIME, LIFT, DENSITY, HEIGHT_X, HEIGHT_Y, TURN, AX, AY, AZ, MODES = range(10)
"""Columns of the ring: time [s], vertical acceleration as part of g, spectral density of w,
heights along the modal axes [m], the container's angle in them [rad], acceleration of the
liquid along them [m/s²]; then q and q̇ of each
block."""

(
    SH_X, SH_Y, MSH, AZIMUTH, STDDEV_X, STDDEV_Y, STDDEV, ENVELOPE, ENVELOPE_STDDEV,
    ENVELOPE_NOISE, WORST_ENVELOPE, WORST_STDDEV, DECAY, STATE,
) = range(14)  # fmt: skip
"""Columns of an answer: heights at +x and +y, their maximum [m] and its azimuth [rad], standard
deviations of the three heights [m]; the largest height that the wave reaches if nothing moves from
now on, its standard deviation, and that of what the input's noise at rest adds to it [m]; the
same height with the worst frequency and damping of a model, and its standard deviation with
these [m]; the slowest mode's ζω [1/s]; then x, y, vx, vy of each mode."""

LOW_FREQUENCY, HIGH_FREQUENCY, LOW_DAMPING, HIGH_DAMPING = range(4)
"""Least and largest error of ε and of κ that calm allows for."""

MEAN_X, MEAN_Y, SPECTRUM, COUNT = range(4)
"""Mean of the acceleration that drives the liquid at rest [m/s²], spectral density of its noise in
one axis [m²/s³], and of how many inputs."""
AVERAGES = 4
