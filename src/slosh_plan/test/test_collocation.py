from dataclasses import replace

import numpy as np
import pytest

from slosh_model import Cylinder, Model, Rectangle
from slosh_model.standing import Standing
from slosh_plan.planning import optimise
from slosh_plan.planning.collocation import CollocationProblem
from slosh_plan.planning.flow import flow_of
from slosh_plan.planning.interval import LIMITS, StateLayout
from slosh_plan.planning.loose_terms import LooseTerms
from slosh_plan.planning.path import path_through

pytestmark = pytest.mark.skipif(
    not optimise.available(), reason="no CasADi (requirements/plan.txt)"
)

CUP = Model(Cylinder(0.05, 0.07)).spatial().nonlinear()
STANDING = Standing(mass=0.15, centre_height=0.05, base_radius=0.03, friction=0.2)
SLOW = replace(CUP, natural_frequency=17.0)
TANK = Model(Rectangle(0.08, 0.06, 0.07)).spatial().nonlinear()
BENT = np.array([[0.0, 0.0, 0.0], [0.2, 0.05, 0.02], [0.4, 0.0, 0.0], [0.4, 0.3, 0.0]])
LIMIT = [0.015, 0.002, 9.5, 74.0, 0.2, 2.0, 20.0, 0.8, 0.9, 1.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("tilting", [False, True])
@pytest.mark.parametrize(
    "models", [[CUP], [TANK], [CUP, SLOW], [TANK, TANK]],
    ids=["cylinder", "rectangle", "two cylinders", "two rectangles"],
)  # fmt: skip
def test_derivatives_are_those_of_the_demands(models, tilting):
    """Tests derivatives of the constraints against central differences."""
    problem = CollocationProblem(
        tuple(flow_of(model) for model in models), path_through(BENT), 0.3, (5, 4),
        StateLayout(tilting, len(models)), tuple(LooseTerms.of(one, STANDING) for one in models),
    )  # fmt: skip
    solver = problem.solver({"ipopt.print_level": 0, "print_time": False})
    slopes, bends = (solver.get_function(f"nlp_{name}") for name in ("jac_g", "hess_l"))
    generator = np.random.default_rng(1)
    sizes = problem.sizes()
    assert sizes["p"] == len(LIMITS) == len(LIMIT)
    x, along = generator.uniform(0.2, 0.6, sizes["x"]), generator.normal(size=sizes["x"])
    for leg in problem.legs:
        # At places within the leg: no derivative jumps there.
        x[leg.states[:, 0]] = np.linspace(0.05, 0.2, len(leg.states))
    weights = generator.normal(size=sizes["g"])
    step = 1e-6

    def demands_and_slopes(at):
        values, jacobian = slopes(at, LIMIT)
        return np.asarray(values).ravel(), jacobian.sparse()

    _, jacobian = demands_and_slopes(x)
    (ahead, ahead_slopes), (behind, behind_slopes) = (
        demands_and_slopes(x + sign * step * along) for sign in (1.0, -1.0)
    )
    assert jacobian @ along == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-4, abs=1e-4)
    upper = bends(x, LIMIT, 1.0, weights).sparse().toarray()
    assert np.tril(upper, -1) == pytest.approx(0.0, abs=1e-15)
    hessian = upper + upper.T - np.diag(np.diag(upper))
    change = (weights @ ahead_slopes - weights @ behind_slopes) / (2.0 * step)
    assert hessian @ along == pytest.approx(change, rel=1e-3, abs=1e-3 * np.abs(change).max())
