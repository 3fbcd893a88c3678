"""Effect: modes that the model omits follow the acceleration without delay."""

from __future__ import annotations

from slosh_model.containers import PRISMATIC, REVOLVED, ROUND
from slosh_model.effects.base import Effect, Parameter, Parameters, Stage


def _static_share(parameters: Parameters) -> float:
    return parameters["kappa"]


EFFECT = Effect(
    name="quasi_static_modes",
    title="static share of the higher modes",
    meaning="The higher modes are so fast that their height follows the acceleration at once.",
    stages=(Stage.HEIGHT,),
    equation=(
        r"\eta \to \eta - \kappa"
        r"\left(1 - \sum_n\frac{\bar\eta_n\,g}{\omega_n^2 R}\right)"
        r"\frac{R\,\ddot s_0}{g + \ddot z_0}"
    ),
    source=(
        r"under a constant acceleration the surface is a plane, $\eta = -R\,\ddot s_0/g$, of "
        r"which mode $n$ bears $2/(\xi_n^2 - 1)$: Faltinsen & Timokha 2009, ch. 5"
    ),
    sections=(
        ROUND,
        REVOLVED,
        PRISMATIC,
    ),  # the plane of a rectangle's one mode leaves nothing out
    parameters=(
        Parameter(
            name="kappa",
            unit="1",
            lower=0.0,
            upper=2.0,
            neutral=0.0,
            description="share of the theory's; less where heights are read inside of the wall",
            default=1.0,
            plausible=(0.0, 1.5),
            spread=0.3,  # heights read at 0.9 to 1.0 of the radius
            expected=1.0,
            starts=(0.8,),
        ),
    ),
    static_share=_static_share,
)
