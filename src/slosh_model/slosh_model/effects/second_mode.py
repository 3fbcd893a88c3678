"""Effect: the second antisymmetric sloshing mode oscillates in addition to the first."""

from __future__ import annotations

from dataclasses import replace

from slosh_model.effects.base import Effect, Parameter, Parameters, Stage
from slosh_model.modes import Mode


def _modes(modes: tuple[Mode, ...], parameters: Parameters) -> tuple[Mode, ...]:
    # Two where each mode has a direction of its own.
    second = (3, 4) if modes[0].container.one_directional else (2,)
    damping = parameters["damping_ratio"]
    return (
        *(mode for mode in modes if mode.number < second[0]),
        *(replace(modes[0], number=n, damping_ratio=damping) for n in second),
        *(mode for mode in modes if mode.number > second[-1]),
    )


EFFECT = Effect(
    name="second_mode",
    title="second mode",
    meaning=(
        "The second mode of the cup oscillates in addition to the first, with its own frequency "
        "and damping."
    ),
    stages=(Stage.DYNAMICS, Stage.HEIGHT),
    equation=(
        r"\ddot q_2 + 2\zeta_2\omega_2\dot q_2 + \omega_2^2 q_2 + \ddot s_0 = 0,"
        r"\quad \eta = \bar\eta_1 q_1 + \bar\eta_2 q_2"
    ),
    source="DL22, eqs. (3), (4), (12), Table 1 with n = 2",
    parameters=(
        Parameter(
            name="damping_ratio",
            unit="1",
            lower=0.0,
            upper=0.3,
            neutral=None,
            description="damping ratio of the second mode",
            default=0.01,
            plausible=(0.0, 0.1),
            starts=(0.01, 0.04),
        ),
    ),
    order=30,  # after what changes the container and the first mode's damping
    modes=_modes,
)
