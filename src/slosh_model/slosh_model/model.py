"""A sloshing model: container, liquid, damping and additional physical effects."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Unpack

import numpy as np

from slosh_base.types import Array
from slosh_model.checks import within
from slosh_model.constants import GRAVITY
from slosh_model.containers import X_AXIS, Container, CupLengths
from slosh_model.covariance import Covariance
from slosh_model.effects.base import Effect, Parameters
from slosh_model.effects.registry import BY_HOOK, find_effect
from slosh_model.errors import SloshModelError
from slosh_model.limits import ValidityLimits
from slosh_model.liquid import Liquid, liquid_named
from slosh_model.modes import Mode

VERTICAL = "vertical_acceleration"
TILT = "gravity_tilt"
"""Effect without which a model does not know of tilts."""
_OF_THE_SHAPE = ValidityLimits()
FREQUENCIES = (1e-2, 1e3)  # rad/s; any other value is a unit mistaken for another


@dataclass(frozen=True, slots=True)
class EffectUse:
    """A physical effect that a model includes, with its parameters.

    >>> from slosh_model import EffectUse
    >>> dict(EffectUse("static_tilt", {"roll": 0.03, "pitch": 0.0}).parameters)  # rad
    {'roll': 0.03, 'pitch': 0.0, 'settled': 1.0}

    Attributes:
        name: the effect's id.
        parameters: complete and within bounds, in the effect's order.

    Raises:
        SloshModelError: unknown effect or parameter, a value missing or out of bounds.
    """

    name: str
    parameters: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        complete = find_effect(self.name).complete(self.parameters)
        object.__setattr__(self, "parameters", MappingProxyType(complete))

    def __hash__(self) -> int:
        return hash((self.name, tuple(self.parameters.items())))

    def __reduce__(self) -> tuple[type[EffectUse], tuple[str, dict[str, float]]]:
        # Read-only mappings cannot be pickled, and models travel between processes.
        return EffectUse, (self.name, dict(self.parameters))


@dataclass(frozen=True, slots=True, repr=False)
class Model:
    """A sloshing model; without added effects it is planar and linear (2D-L).

    >>> import slosh
    >>> slosh.Model.from_cup(diameter=0.08, fill_height=0.06, rim_height=0.11)
    Model(3D-NL, radius 40 mm, filled to 60 mm, 3.369 Hz, damping ratio 0.00603)

    Attributes:
        container: the container.
        liquid: the liquid.
        damping_ratio: ζ of every mode; None: by formula.
        natural_frequency: ω of the first mode as measured [rad/s], the other modes in proportion;
            None: from the container.
        effects: what is added, each effect at most once.
        modes: number of modes, from the first.
        limits: where the model was validated; not given: where models of the shape were.
        covariance: of the parameters that were identified; None: unknown.

    Raises:
        SloshModelError: an impossible value.
    """

    container: Container
    liquid: Liquid = field(default_factory=Liquid)
    damping_ratio: float | None = None
    effects: tuple[EffectUse, ...] = ()
    modes: int = 1
    limits: ValidityLimits = _OF_THE_SHAPE
    natural_frequency: float | None = None
    covariance: Covariance | None = None

    def __post_init__(self) -> None:
        if self.limits is _OF_THE_SHAPE:
            object.__setattr__(self, "limits", self.container.validated)
        if self.natural_frequency is not None:
            within("natural_frequency", self.natural_frequency, "rad/s", *FREQUENCIES)
        if self.damping_ratio is not None and not (
            math.isfinite(self.damping_ratio) and 0.0 <= self.damping_ratio < 1.0
        ):
            raise SloshModelError(
                f"damping_ratio = {self.damping_ratio!r} must be auto or lie in [0, 1)",
                ("damping_ratio",),
            )
        most = self.container.most_modes
        if not 1 <= self.modes <= most:
            raise SloshModelError(f"modes = {self.modes!r} must lie in 1 … {most}", ("modes",))
        names = [use.name for use in self.effects]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise SloshModelError(f"effect {name!r} is listed twice", ("effects", index))
            effect = find_effect(name)
            if not effect.fits(self.container.section):
                # A cylinder and a rectangle have closed forms, and little to do instead.
                other = effect.instead and self.container.digest
                instead = f": {effect.instead}" if other else ""
                raise SloshModelError(
                    f"effect {name!r} is not for a {self.container.shape}{instead}",
                    ("effects", index),
                )
        self.container.natural_frequency(self.modes)  # where it must be computed, before all else
        try:
            modes = self.mode_constants()
        except SloshModelError as error:
            raise SloshModelError(
                f"with its effects the model has {error}", ("effects",)
            ) from None
        if self.damping_ratio is None and not modes[0].damping_ratio < 1.0:
            raise SloshModelError(
                f"the damping ratio would be {modes[0].damping_ratio:.3g}: liquid that viscous, "
                "in a container that small, does not slosh"
            )

    @classmethod
    def from_cup(cls, *, liquid: str | Liquid = "water", **lengths: Unpack[CupLengths]) -> Model:
        """Creates the model of a cup from its inner lengths [m], as `slosh new` does.

        Args:
            liquid: a name of LIQUIDS, or density and viscosity.
            lengths: inner lengths [m]; see `Container.of`.

        Raises:
            SloshModelError: no cup, or no such liquid.
        """
        filled = liquid if isinstance(liquid, Liquid) else liquid_named(liquid)
        model = cls(Container.of(**lengths), filled).spatial()
        # A rectangle's nonlinear effect is for steep surfaces, and not a better model below them.
        return model if model.container.cornered else model.nonlinear()

    @classmethod
    def load(cls, path: str | Path) -> Model:
        """Reads a model from a `model.yaml` file; see `read_model`."""
        from slosh_model.model_text import read_model  # it reads YAML, which a model does without

        return read_model(path)

    def save(self, path: str | Path) -> None:
        """Writes the model to a `model.yaml` file; `load` returns an equal model.

        Raises:
            OSError: the file cannot be written; what was there is as it was.
        """
        from slosh_model.model_text import write_model

        write_model(path, self)

    def __repr__(self) -> str:
        mode = self.mode_constants()[0]
        return (
            f"Model({self.name}, {self.container.described}, {self.natural_frequency_hz:.4g} Hz, "
            f"damping ratio {mode.damping_ratio:.3g})"
        )

    @property
    def natural_frequency_hz(self) -> float:
        """Natural frequency of the first mode with all effects [Hz]."""
        return self.mode_constants()[0].natural_frequency / math.tau

    @property
    def name(self) -> str:
        """Name of the model: 2D-L, 3D-L, 2D-NL or 3D-NL, then '+' and other effects."""
        space = "3D" if self.has(VERTICAL) else "2D"
        nonlinear = self.container.nonlinear_effect
        surface = "NL" if self.has(nonlinear) else "L"
        others = sorted(use.name for use in self.effects if use.name not in (VERTICAL, nonlinear))
        return "+".join([f"{space}-{surface}", *others])

    def has(self, effect: str) -> bool:
        """Returns whether the model includes the physical effect with this name."""
        return any(use.name == effect for use in self.effects)

    def with_effect(self, effect: str, **parameters: float) -> Model:
        """Returns the model with a physical effect added, or its parameters replaced."""
        return self.with_effects(EffectUse(effect, parameters))

    def with_effects(self, *uses: EffectUse) -> Model:
        """Returns the model with several physical effects added or replaced."""
        if not uses:
            return self
        acting = {use.name: use for use in (*self.effects, *uses)}
        return replace(self, effects=tuple(acting.values()))

    def without_effect(self, effect: str) -> Model:
        """Returns the model without a physical effect."""
        return replace(self, effects=tuple(use for use in self.effects if use.name != effect))

    @property
    def acting(self) -> dict[str, Parameters]:
        """Parameters of all active effects by name, including those built into the container."""
        return {**self.container.built_in, **{use.name: use.parameters for use in self.effects}}

    def uses(self, hook: str) -> tuple[tuple[Effect, Parameters], ...]:
        """Returns the model's effects that define a hook, such as `drive`, in order of action."""
        used = self.acting
        return tuple(
            (effect, used[effect.name]) for effect in BY_HOOK[hook] if effect.name in used
        )

    def linear(self) -> Model:
        """Returns the linear variant (L) of the model."""
        return self.without_effect(self.container.nonlinear_effect)

    def nonlinear(self) -> Model:
        """Returns the nonlinear variant (NL), with present or default parameters.

        The model itself where its container has none.
        """
        nonlinear = self.container.nonlinear_effect
        return self if not nonlinear or self.has(nonlinear) else self.with_effect(nonlinear)

    def planar(self) -> Model:
        """Returns the 2D variant, which ignores vertical acceleration."""
        return self.without_effect(VERTICAL)

    def spatial(self) -> Model:
        """Returns the 3D variant, which includes vertical acceleration."""
        return self if self.has(VERTICAL) else self.with_effect(VERTICAL)

    def filled_to(self, fill_height: float) -> Model:
        """Returns the model for another fill height [m] of the same container.

        A measured frequency changes in the proportion of the container's own; what was identified
        with the fill height before has no covariance any more.

        Raises:
            SloshModelError: the container cannot be filled so.
        """
        container = self.container.filled_to(fill_height, self.container.rim_height)
        measured = self.natural_frequency
        if measured is not None:
            measured *= container.natural_frequency(1) / self.container.natural_frequency(1)
        same = self.limits == self.container.validated
        return replace(
            self,
            container=container,
            natural_frequency=measured,
            covariance=None,
            limits=_OF_THE_SHAPE if same else self.limits,
        )

    def with_gravity_tilt(self) -> Model:
        """Returns the model with gravity acting along the floor of a tilted container."""
        return self if self.has(TILT) else self.with_effect(TILT)

    def mode_constants(self) -> tuple[Mode, ...]:
        """Returns the constants of all modes, including effects that change them."""
        factor = self._frequency_factor()
        modes = tuple(
            Mode(n, self.container, self._damping(self.container, n), factor)
            for n in range(1, self.mode_count + 1)
        )
        for effect, parameters in self.uses("modes"):
            before = modes[0].container
            modes = effect.modes(modes, parameters)  # type: ignore[misc]
            if self.damping_ratio is None and modes[0].container != before:
                # What the formula gives follows the container.
                modes = tuple(
                    replace(mode, damping_ratio=self._damping(mode.container, mode.number))
                    for mode in modes
                )
        return modes

    @property
    def mode_count(self) -> int:
        """Number of masses: one for each mode, or two where modes have fixed directions."""
        return 2 * self.modes if self.container.one_directional else self.modes

    def modal_azimuth(self, yaws: Array) -> Array:
        """Returns the azimuth (N,) of the axes of modal states from the container's +x [rad].

        Args:
            yaws: (N,) of the container [rad].
        """
        if not self.container.follows_yaw:
            return -yaws
        return np.full(len(yaws), self.container.axes(len(self.mode_constants())))

    def _damping(self, container: Container, number: int) -> float:
        """Returns the damping ratio ζ of a mode without modelled effects."""
        if self.damping_ratio is not None:
            return self.damping_ratio
        return container.mode_damping(self.liquid.kinematic_viscosity, number)

    def mode_frequency(self, number: int) -> float:
        """Returns the natural frequency ωₙ [rad/s] of any mode, without modelled effects."""
        return self._frequency_factor() * self.container.natural_frequency(number)

    def _frequency_factor(self) -> float:
        if self.natural_frequency is None:
            return 1.0
        return self.natural_frequency / self.container.natural_frequency(1)

    def height_gains(
        self, modes: tuple[Mode, ...] | None = None, axis: int = X_AXIS
    ) -> tuple[float, ...]:
        """Returns each mode's height at the wall per displacement of its mass (DL22, Tables 1, 2).

        Args:
            modes: what `mode_constants` gives; None: computed.
            axis: along which.
        """
        modes = self.mode_constants() if modes is None else modes
        curved = self.container.straight_alone and len(modes) > 1
        gains = []
        for mode in (mode.along(axis) for mode in modes):
            gain = mode.curved_gain if curved else mode.plane_gain
            for effect, parameters in self.uses("height_gain"):
                gain = effect.height_gain(mode, parameters)  # type: ignore[misc]
            gains.append(gain)
        return tuple(gains)

    def _share_along(self, mode: Mode, axis: int, masses: int) -> float:
        """Returns the squared cosine of the angle between a mode's motion and an axis.

        1 where modes move along both axes.
        """
        if not mode.container.one_directional:
            return 1.0
        direction = mode.container.direction(mode.number) - self.container.axes(masses)
        return math.cos(direction - 0.5 * math.pi * axis) ** 2

    def static_height(self, modes: tuple[Mode, ...] | None = None, axis: int = X_AXIS) -> float:
        """Returns the quasi-static height at the wall per acceleration [s²].

        A share of what the modes leave of R/g, the height of a surface that stands normal to
        gravity and a constant acceleration.

        Args:
            modes: what `mode_constants` gives; None: computed.
            axis: along which.
        """
        share = sum(
            effect.static_share(parameters)  # type: ignore[misc]
            for effect, parameters in self.uses("static_share")
        )
        if share == 0.0:
            return 0.0
        modes = self.mode_constants() if modes is None else modes
        gains = self.height_gains(modes, axis)
        along = [mode.along(axis) for mode in modes]
        moved = sum(
            gain / mode.gravity_frequency**2 * self._share_along(mode, axis, len(modes))
            for gain, mode in zip(gains, along, strict=True)
        )
        return share * (along[0].reach / GRAVITY - moved)
