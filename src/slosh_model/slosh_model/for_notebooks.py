"""Displays results in notebooks: one-line summaries, tables and charts.

pandas and matplotlib are loaded here alone, when somebody asks: a model and a node do without.
"""

from __future__ import annotations

from collections.abc import Mapping
from html import escape
from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any

import numpy as np

from slosh_base.types import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from pandas import DataFrame

UNITS = "units"
"""Of a table's columns, among its `attrs`."""


def counted(number: int, what: str) -> str:
    """Formats a count, for example "1 sample" or "12 samples"."""
    return f"{number} {what}{'s' * (number != 1)}"


def span(t: Array) -> str:
    """Formats a time span, for example "1500 samples, 0 … 1.499 s"."""
    count = counted(len(t), "sample")
    return f"{count}, {t[0]:.6g} … {t[-1]:.6g} s" if len(t) else count


def peak(t: Array, heights: Array, what: str) -> str:
    """Formats the maximum, for example "highest 12.3 mm at 1.234 s"."""
    if not np.isfinite(heights).any():
        return f"no {what} height"
    top = int(np.nanargmax(heights))
    return f"{what} up to {1e3 * heights[top]:.1f} mm at {t[top]:.6g} s"


class Shown:
    """Base class of results that adds `to_xarray` and an HTML summary for notebooks.

    What has a `plot` shows it, too.
    """

    __slots__ = ()

    if TYPE_CHECKING:

        def to_pandas(self) -> DataFrame: ...  # noqa: D102

    def to_xarray(self) -> Any:
        """Returns the table of `to_pandas` as an xarray Dataset with units.

        Raises:
            ImportError: xarray or pandas is not installed.
        """
        needed("xarray", "a dataset")
        frame = self.to_pandas()
        dataset = frame.to_xarray()
        for name, unit in frame.attrs.get(UNITS, {}).items():
            dataset[name].attrs["units"] = unit
        return dataset

    def _repr_html_(self) -> str:
        """Returns the summary and, with matplotlib, the chart as HTML."""
        line = f"<p><code>{escape(repr(self))}</code></p>"
        plot = getattr(self, "plot", None)
        try:
            return line if plot is None else line + _svg(plot().figure)
        except ImportError:
            return line


def _svg(figure: Any) -> str:
    pyplot = import_module("matplotlib.pyplot")
    text = StringIO()
    figure.savefig(text, format="svg")
    pyplot.close(figure)
    return "".join(text.getvalue().partition("<svg")[1:])


def table(
    rows: Any, columns: Mapping[str, Any], index: str = "t", units: Mapping[str, str] | None = None
) -> DataFrame:
    """Creates a pandas table; its `attrs["units"]` contains the unit of each column.

    Args:
        rows: its index: the time [s], where nothing else is said.
        columns: by name.
        index: the index's name.
        units: of columns that are no heights [m].

    Raises:
        ImportError: pandas is not installed.
    """
    pandas = needed("pandas", "a table")
    frame = pandas.DataFrame(dict(columns), index=pandas.Index(rows, name=index))
    told = {**({"t": "s"} if index == "t" else {}), **dict.fromkeys(columns, "m"), **(units or {})}
    frame.attrs[UNITS] = told
    return frame


def height_axes(axes: Axes | None, title: str = "") -> Axes:
    """Returns matplotlib axes for heights [mm] over time [s].

    Args:
        axes: matplotlib's; None: of a new figure.
        title: above them.

    Raises:
        ImportError: matplotlib is not installed.
    """
    if axes is None:
        pyplot = needed("matplotlib.pyplot", "a chart")
        axes = pyplot.subplots(figsize=(7.5, 3.2), layout="constrained")[1]
    axes.set(xlabel="time [s]", ylabel="height [mm]")
    if title:
        axes.set_title(title, fontsize="medium")
    return axes


def needed(name: str, what: str) -> Any:
    """Imports an optional module, or raises an error that names its library.

    Raises:
        ImportError: its library is not installed; the line says how it is.
    """
    library = name.partition(".")[0]
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if error.name != library:
            raise
        raise ImportError(f"{what} needs {library}: pip install {library}", name=library) from None
