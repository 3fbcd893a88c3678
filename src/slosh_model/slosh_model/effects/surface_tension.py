"""Effect: surface tension adds to the restoring force of gravity."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.containers import RECTANGULAR, ROUND
from slosh_model.effects.base import Effect, Parameter, Parameters, Stage
from slosh_model.modes import Mode


def _modes(modes: tuple[Mode, ...], parameters: Parameters) -> tuple[Mode, ...]:
    return tuple(replace(mode, tension=parameters["tension"]) for mode in modes)


EFFECT = Effect(
    name="surface_tension",
    title="surface tension",
    meaning=(
        "Surface tension flattens a curved surface in addition to gravity, short waves the most."
    ),
    stages=(Stage.DYNAMICS,),
    equation=(
        r"\omega_n^2 \to \omega_n^2\left(1 + \frac{\sigma}{\rho g}\frac{\xi_n^2}{R^2}\right)"
    ),
    source="capillary-gravity waves that meet the wall at 90°: Faltinsen & Timokha 2009, ch. 4",
    sections=(ROUND, RECTANGULAR),
    instead="give natural_frequency as measured",
    parameters=(
        Parameter(
            name="tension",
            unit="m³/s²",
            lower=0.0,
            upper=1e-3,
            neutral=0.0,
            description="surface tension over density, σ/ρ",
            default=7.3e-5,  # clean water at 20 °C
            plausible=(0.0, 2e-4),
            spread=4e-5,  # from water with soap to water that clings to the wall
            expected=7.3e-5,
            starts=(7.3e-5,),
        ),
    ),
    order=35,  # after what adds modes
    modes=_modes,
)
