"""Tests the theoretical curve over the container's size on an identification's page."""

import numpy as np
import pytest

from slosh_discovery.identification_report import charts
from slosh_model import Model
from slosh_model.parameters import DAMPING, FREQUENCY
from slosh_model.shapes import Flask, Frustum
from slosh_model.shapes.round_cups import RoundCup
from slosh_testing.mode_solver import needs_solver

pytestmark = needs_solver
CUP = Frustum(bottom_radius=0.028, top_radius=0.04, height=0.09, fill_height=0.06)
NARROW = Flask(
    bottom_radius=0.02, neck_radius=0.018, shoulder_height=0.09, height=0.13, fill_height=0.06
)


@pytest.mark.long
@pytest.mark.parametrize("container", [CUP, NARROW], ids=["cup", "flask"])
def test_few_computed_sizes_give_the_whole_curve(container: RoundCup) -> None:
    sizes, values = charts.curve(Model(container), FREQUENCY, [container.size])
    assert len(sizes) > 20
    for k in (3, len(sizes) // 2, len(sizes) - 2):
        exact = container.widened(float(sizes[k] / container.size)).natural_frequency(1)
        assert values[k] == pytest.approx(exact, rel=1e-5)


def test_the_modes_are_computed_at_few_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[float] = []
    solved = Frustum.solved

    def counted(self: Frustum, count: int) -> object:
        asked.append(self.top_radius)
        return solved(self, count)

    monkeypatch.setattr(Frustum, "solved", counted)
    for quantity in (FREQUENCY, DAMPING):
        _, values = charts.curve(Model(CUP), quantity, [CUP.size])
        assert np.isfinite(values).all()
    assert len(asked) <= charts.SOLVED + 1
