"""A cup of one's own, as it is told."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import cast

from slosh_bringup.errors import SloshBringupError
from slosh_model.containers import CupLengths
from slosh_model.liquid import Liquid
from slosh_model.model import Model

_NAMESPACE = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


@dataclass(frozen=True, slots=True)
class NewCup:
    """What the first files say.

    Attributes:
        lengths: inner dimensions by their key in the files: `radius`, or `width` and `depth` [m].
        fill_height: height of the liquid at rest above the inner floor [m].
        liquid: what is in it.
        rim_height: above the inner floor [m]; None: unknown.
        wall: thickness [m]; None: unknown.
        namespace: of the nodes.
        image_size: width and height of the camera's images [px].
        camera: whether the cell has one.
    """

    lengths: dict[str, float]
    fill_height: float
    liquid: Liquid
    rim_height: float | None
    wall: float | None
    namespace: str
    image_size: tuple[int, int]
    camera: bool = True

    def __post_init__(self) -> None:
        """Refuse a rim below the liquid, and a namespace that is none."""
        if self.rim_height is not None and self.rim_height <= self.fill_height:
            raise SloshBringupError(
                f"rim_height = {self.rim_height:g} m: must lie above the liquid, whose "
                f"fill_height is {self.fill_height:g} m"
            )
        if not _NAMESPACE.fullmatch(self.namespace):
            raise SloshBringupError(
                f"namespace = {self.namespace!r}: must be names after slashes, such as /slosh"
            )

    @property
    def model(self) -> Model:
        """The model that a new cup begins with."""
        heights = {"fill_height": self.fill_height, "rim_height": self.rim_height}
        return Model.from_cup(liquid=self.liquid, **cast(CupLengths, {**self.lengths, **heights}))

    @property
    def is_round(self) -> bool:
        """Whether it is a cylinder."""
        return "radius" in self.lengths

    @property
    def shape(self) -> str:
        """As the files call it."""
        return "cylinder" if self.is_round else "rectangle"
