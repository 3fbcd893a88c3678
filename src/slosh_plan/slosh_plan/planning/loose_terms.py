"""Constraints that keep a loosely standing container in place, as CasADi expressions."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_model.constants import GRAVITY
from slosh_model.model import Model
from slosh_model.standing import Standing
from slosh_model.standing_use import StandingMasses
from slosh_plan.planning.flow import Expression, Flow


@dataclass(frozen=True, slots=True)
class LooseTerms:
    """Parameters of a loosely standing container and its liquid's first mode.

    Attributes:
        standing: how it stands.
        masses: of the container and its liquid.
    """

    standing: Standing
    masses: StandingMasses

    @classmethod
    def of(cls, model: Model, standing: Standing) -> LooseTerms:
        """Computes the parameters from the model of the liquid."""
        return cls(standing, StandingMasses.of(model, standing))

    def demands(
        self,
        flow: Flow,
        q: Expression,
        change: list[Expression],
        force: Expression,
        limits: Expression,
    ) -> list[Expression]:
        """Returns expressions that are at most 1 if the container neither slides nor tips.

        Args:
            flow: in whose axes the liquid moves.
            q: displacement x, y of the first mode [m], and its rate.
            change: its acceleration [m/s²].
            force: the container's acceleration in its axes, gravity excluded [m/s²].
            limits: shares of friction and base that may be used.
        """
        masses, standing = self.masses, self.standing
        total, modal, heights = masses.total, masses.modal[0], masses.heights[0]
        normal = force[2] + GRAVITY
        pulled = flow.turned([modal[n] / total * change[n] for n in (0, 1)], flow.axes)
        tipped = flow.turned(
            [modal[n] / total * (q[n] * normal - heights[n] * change[n]) for n in (0, 1)],
            flow.axes,
        )
        lateral = [force[n] + pulled[n] for n in (0, 1)]
        moment = [tipped[n] - masses.centre_height * force[n] for n in (0, 1)]
        # Divided by g, and not by the normal force, which may be near 0.
        slip = sum(one**2 for one in lateral) / (limits[0] * standing.friction * GRAVITY) ** 2
        tip = sum(one**2 for one in moment) / (limits[1] * standing.base_radius * GRAVITY) ** 2
        spare = 1.0 - (normal / GRAVITY) ** 2
        return [slip + spare, tip + spare]
