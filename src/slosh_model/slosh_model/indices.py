"""Indices of quantities in the tuples and array rows of compiled code.

Tuples, since the compiler keeps them in registers. What a later effect needs can be appended to
one without a change to the others.
"""

from __future__ import annotations

FREQUENCY, DAMPING, CURVATURE, RADIUS, GAIN, XI, FILL = range(7)
"""A mode's constants: ω [rad/s], ζ, C, R [m], wall height per displacement, ξ, h [m]. R of a
rectangle is half a side."""
FREQUENCY_RATIO, RADIUS_Y, GAIN_Y = range(7, 10)
"""And along y: ω relative to that along x, R, wall height per displacement."""
MODE_COUNT = 10

X, Y, VX, VY = range(4)
"""A mode's mass: its place [m] and velocity [m/s] in axes that do not yaw, or in those of a
container whose liquid follows its yaw."""
STATE_COUNT = 4

AX, AY, AZ, TURN = range(4)
"""What drives the liquid, in the same axes: acceleration [m/s²], gravity excluded, and the angle
of the container's x axis in them [rad]."""
INPUT_COUNT = 4

QX, QY, QZ, QW, RATE_X, RATE_Y, RATE_Z, CHANGE_X, CHANGE_Y, CHANGE_Z = range(10)
"""A pose: attitude world ← container as a quaternion, angular velocity [rad/s] and angular
acceleration [rad/s²] in the container's axes."""
POSE_COUNT = 10

FORCE_X, FORCE_Y, MASS_XX, MASS_XY, MASS_YY = range(5)
"""What an effect adds to (I + m) q̈ = f: force per modal mass [m/s²] and relative mass [1]."""
TERM_COUNT = 5

WALL_X, WALL_Y, WALL_AZIMUTH, WALL_RADIUS, WALL_ELAPSED, WALL_FILL = range(6)
"""What is read of the wall: height at the container's +x and +y [m], azimuth of what is read [rad]
or NaN where it is the maximum over the wall, R [m], time since rest [s], h [m]."""
WALL_RADIUS_Y, WALL_CORNERED = range(6, 8)
"""And R along y [m], and 0 where the wall is round."""
