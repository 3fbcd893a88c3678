"""Indices into the arrays that the governor's compiled functions share, with units.

A *coordinate* is a component of the motion that is governed: x, y, z of the container's origin,
or a joint. D counts coordinates, C containers, P points of the moving frame.
"""

from __future__ import annotations

MODELS, CANDIDATES = 8, 4
"""Models of a container that all keep the limits, the nominal one first; stops that are tried
together."""
LIGHT = 6
"""So many that follow the first have the least damping."""
HELD = CANDIDATES - 1
"""The held stop among shares of the command."""
WHOLE, PARTS, OTHERS = range(3)
"""What is tried in turn; see `stops.plan`."""

KIND, PART, LAW = range(3)
"""A candidate: 0: the held stop and a law for the difference, 1: a law of its own; share of the
command; then duration [s] and bumps of the law."""
PLAN = 5

VELOCITY, RATE, PLACE = range(3)
"""Rows of the (3, D) motion: velocity, acceleration and place [m or rad, and their rates]."""

(
    PERIOD, SPACING, SUBDIVISION, RESERVE, ACCELERATION, JERK, TAIL, SHORTEST, LONGEST,
    RATIO, EARLY, LATE, ENOUGH, HASTE, SPREAD, LEAST,
) = range(16)  # fmt: skip
"""Settings: time of a step, of a row [s], steps of a row; part by which heights are raised, limits
of the container's origin [m/s², m/s³]; time that is looked at after a stop, shortest and longest
stop [s]; ratio of two durations, steps of the two bumps [1]; part of the limit below which a stop
is as good as any; what a second of its duration costs, in parts of the limit; part of the
difference of the lightly damped models' answers that is added for those between them; shortest
stop [s] from which longer ones are found while a command is followed."""
SETTINGS = 16

SUBSTEP, ROWS, DURATION, BUMP_EARLY, BUMP_LATE, TURN, BOUND = range(7)
"""State: step since the stop's row 0, rows of the stop; duration [s] and bumps of the last good
law, number of the step, share of the limits up to which the held stop was found safe."""
STATE = 7

ORDER, WORST = 0, 1
"""Ranks of a container: in column 0 of row k the container that was the k-th nearest to its limits
of late; then the two models of the row's own container that used most."""
RANKS = 3

(
    LIMIT, EXTRA, POINT, SIZE, DRIVEN, MODULATED, PARTS_OF_ROW, MASS_POINT, FRICTION, BASE, CENTRE,
    MASS_X, MASS_Y, ARM_X, ARM_Y, WAVE, PUMP, PUSH, SWAY,
) = range(19)  # fmt: skip
"""A container: limit of its height, height of an unknown wave beside the models' [m]; point
that drives its liquid; numbers of a model's store; whether the models have effects on the input
and on the constants with time; parts of a row. If it stands loosely: point of its mass,
coefficient of friction (0: it is held), radius of its base, height of the centre of mass [m];
along x and y: part of the mass that moves with the liquid's first mode, and its height [m]. Kind
of its models; see `waves`. Logarithmic growth of the unknown wave per vertical acceleration and
time [s/m]; acceleration [1/s²] and moment [m/s²], by the mass, by a metre of it."""
CUP = 19

USE, PEAK, NOMINAL, SLIP, TIP = range(5)
"""What a stop uses of a container: largest share of any of its limits; highest height of any model
and of the nominal one [m]; largest shares of friction and of its base."""
USES = 5

SHARE, REST, TRIED = range(3)
"""An answer: followed share of the command; time until it rests [s]; blocks that were tried."""
ANSWER = 3

LOWER, UPPER, FASTEST, HARDEST, SHARPEST = range(5)
"""Rows of the (5, D) limits of each coordinate: positions, velocity, acceleration, jerk."""

ORIGIN = 9
"""Of the pose that a robot keeps: its rotation by rows, and from here its origin [m]."""
REFUSED_JOINT, REFUSED_LIMIT, EASED, HEAVIEST = range(4)
"""The first joint that would exceed a limit in a step, and which of `carried.BY_POSITION` …; 0:
none; 1: the command was lowered for it. Then the largest effort of joints where a stop may end;
see `inverse.effort` [s/m]."""
REFUSED = 4

SLIDES, COLUMN, TIMES, OFFSET, ALONG, STEP, FIXED, COSINE, SINE = 0, 1, 2, 3, 4, 7, 10, 19, 28
"""A joint: 1 where it slides, 0 where it turns; its coordinate; factor and offset of its position;
its axis and the way to it in the axes of the joint before it [m]; parts of its rotation there, by
rows, that are constant and that the cosine and sine of its angle multiply."""
JOINT = 37
TURNS = 3
"""Of a (P, 4) point: after x, y, z in the moving frame [m], 1 where the liquid turns with the
container."""
