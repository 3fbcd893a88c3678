"""Table of a container's sloshing modes: mass, frequency, position and gain."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Y_AXIS
from slosh_model.model import Model
from slosh_model.modes import Mode


@dataclass(frozen=True, slots=True)
class ModeRow:
    """One sloshing mode along one axis, with its mechanical equivalents.

    A displacement is that of the mode's mass relative to the container; forces and moments are
    those of the liquid on the container, in free oscillation.

    Attributes:
        axis: "x" or "y", or the nearer one; of a round container x alone.
        number: n ≥ 1.
        azimuth: of the mode's motion, from the container's +x [rad].
        natural_frequency: ω [rad/s].
        damping_ratio: ζ.
        mass: that sloshes [kg]; NaN where the liquid's volume is unknown.
        mass_ratio: of it in the liquid's.
        height_per_displacement: at the wall [1].
        static_share: of the mode in the height under a constant acceleration [1].
        pendulum_length: g/ω² [m].
        mass_height: height of the mass above the still surface [m].
        force_per_displacement: lateral, mω² [N/m].
        moment_per_displacement: about the centre of the still surface [N].
        crest_ratio: largest height over the surface, of that at the wall.
        crest_place: where it is, from the axis [m].
    """

    axis: str
    number: int
    azimuth: float
    natural_frequency: float
    damping_ratio: float
    mass: float
    mass_ratio: float
    height_per_displacement: float
    static_share: float
    pendulum_length: float
    mass_height: float
    force_per_displacement: float
    moment_per_displacement: float
    crest_ratio: float
    crest_place: float


def mode_table(model: Model, count: int) -> tuple[ModeRow, ...]:
    """Returns the first modes along x, and along y if they differ.

    Args:
        model: of which container, liquid, `damping_ratio` and `natural_frequency` count; its
            effects do not.
        count: number of modes along each axis.

    Raises:
        SloshModelError: more modes than its container has, or they cannot be computed.
    """
    container = model.container
    container.natural_frequency(2 * count if container.one_directional else count)
    axes = (X_AXIS, Y_AXIS) if container.follows_yaw else (X_AXIS,)
    return tuple(_row(model, n, axis) for axis in axes for n in range(1, count + 1))


def _row(model: Model, number: int, axis: int) -> ModeRow:
    container = model.container
    # Where each mode has its own direction, one for x and one for y follow each other.
    n = 2 * number - 1 + axis if container.one_directional else number
    damping = model.damping_ratio
    if damping is None:
        damping = container.mode_damping(model.liquid.kinematic_viscosity, n)
    mode = Mode(
        n, container, damping, model.mode_frequency(1) / container.natural_frequency(1), axis
    )
    omega, ratio = mode.natural_frequency, container.mass_ratio(n, axis)
    mass = ratio * container.volume * model.liquid.density
    crest_ratio, crest_place = container.crest(n, axis)
    place = container.mass_height(n, axis)
    return ModeRow(
        axis="xy"[axis],
        number=number,
        azimuth=container.direction(n, axis),
        natural_frequency=omega,
        damping_ratio=damping,
        mass=mass,
        mass_ratio=ratio,
        height_per_displacement=mode.curved_gain * container.height_distance(n, axis) / mode.reach,
        static_share=mode.curved_gain * GRAVITY / (omega**2 * mode.reach),
        pendulum_length=GRAVITY / omega**2,
        mass_height=place,
        force_per_displacement=mass * omega**2,
        moment_per_displacement=mass * (omega**2 * place + GRAVITY),
        crest_ratio=crest_ratio,
        crest_place=crest_place,
    )
