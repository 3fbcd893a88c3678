"""Response of the liquid to a motion: heights, modal states and pictures of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from slosh_base.types import Array
from slosh_model.containers import Container
from slosh_model.for_notebooks import Shown, height_axes, peak, span, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Response(Shown):
    """Response of the liquid, with one entry for each input sample.

    >>> import slosh
    >>> response = slosh.simulate("cup/model.yaml", "move.csv")
    >>> print(f"{1e3 * response.msh.max():.1f} mm")
    5.9 mm

    Attributes:
        t: (N,) time [s].
        sh_x, sh_y: (N,) signed height on the wall at the container's +x and +y [m].
        modal: (N, modes, 4) x, y, vx, vy in axes that do not yaw, or in those of a rectangle
            [m, m/s].
        container: whose wall it is; None: a round one.
    """

    t: Array
    sh_x: Array
    sh_y: Array
    modal: Array
    container: Container | None = None

    @property
    def msh(self) -> Array:
        """Maximum sloshing height (N,) at the wall [m] (DL22, Table 2).

        Of the liquid itself: what a sensor reads of it is `slosh_model.measure`.
        """
        if self.container is None:
            return np.hypot(self.sh_x, self.sh_y)
        return self.container.msh(self.sh_x, self.sh_y)

    @property
    def azimuth(self) -> Array:
        """Azimuth (N,) of the highest liquid at the wall [rad], in (-π, π] (DL22, eq. (26)).

        In a rectangle that of its corner, or of a side's middle where all of it is as high.
        """
        if self.container is None:
            return np.arctan2(self.sh_y, self.sh_x)
        return self.container.azimuth(self.sh_x, self.sh_y)

    def __repr__(self) -> str:
        return f"Response({span(self.t)}, {peak(self.t, self.msh, 'height')})"

    def to_pandas(self) -> DataFrame:
        """Returns a pandas table of `msh`, `azimuth`, `sh_x` and `sh_y` [m, rad] by time.

        Raises:
            ImportError: pandas is not installed.
        """
        names = ("msh", "azimuth", "sh_x", "sh_y")
        columns = {name: getattr(self, name) for name in names}
        return table(self.t, columns, units={"azimuth": "rad"})

    def plot(self, axes: Axes | None = None, **line: Any) -> Axes:
        """Draws the maximum sloshing height over time.

        Args:
            axes: matplotlib's; None: of a new figure.
            line: of matplotlib's `Axes.plot`, such as label and color.

        Raises:
            ImportError: matplotlib is not installed.
        """
        axes = height_axes(axes)
        axes.plot(self.t, 1e3 * self.msh, **line)
        return axes
