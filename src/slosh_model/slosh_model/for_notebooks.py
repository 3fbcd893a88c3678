"""What results share in a notebook: one line that sums them up, tables, charts.

pandas and matplotlib are loaded here alone, when somebody asks: a model and a node do without.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

Array = NDArray[np.float64]


def span(t: Array) -> str:
    """For example "1500 samples, 0 … 1.499 s"."""
    count = f"{len(t)} sample{'s' * (len(t) != 1)}"
    return f"{count}, {t[0]:.6g} … {t[-1]:.6g} s" if len(t) else count


def peak(t: Array, heights: Array, what: str) -> str:
    """For example "highest 12.3 mm at 1.234 s"; where there is no number, that."""
    if not np.isfinite(heights).any():
        return f"no {what} height"
    top = int(np.nanargmax(heights))
    return f"{what} up to {1e3 * heights[top]:.1f} mm at {t[top]:.6g} s"


def table(rows: Any, columns: Mapping[str, Any], index: str = "t") -> DataFrame:
    """A pandas table.

    Args:
        rows: its index: the time [s], where nothing else is said.
        columns: by name.
        index: the index's name.

    Raises:
        ImportError: pandas is not installed.
    """
    pandas = _needed("pandas", "a table")
    return pandas.DataFrame(dict(columns), index=pandas.Index(rows, name=index))


def height_axes(axes: Axes | None, title: str = "") -> Axes:
    """Axes to draw heights [mm] over time [s] into.

    Args:
        axes: matplotlib's; None: of a new figure.
        title: above them.

    Raises:
        ImportError: matplotlib is not installed.
    """
    if axes is None:
        pyplot = _needed("matplotlib.pyplot", "a chart")
        axes = pyplot.subplots(figsize=(7.5, 3.2), layout="constrained")[1]
    axes.set(xlabel="time [s]", ylabel="height [mm]")
    if title:
        axes.set_title(title, fontsize="medium")
    return axes


def _needed(name: str, what: str) -> Any:
    library = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != library:
            raise
        raise ImportError(f"{what} needs {library}: pip install {library}", name=library) from None
