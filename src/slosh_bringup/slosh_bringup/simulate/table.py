"""The table of simulated heights, in the format that its name says."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.interchange.export_sinks import load_pyarrow
from slosh_base.files import NewFile, new_text
from slosh_bringup.errors import SloshBringupError
from slosh_model.simulate import Response

COLUMNS = ("t", "msh", "azimuth", "sh_x", "sh_y")
SUFFIXES = (".csv", ".csv.gz", ".parquet")
STANDARD_OUTPUT = Path("/dev/stdout")


def output_path(given: Path) -> Path:
    """Where a table goes; `-` is standard output.

    Raises:
        SloshBringupError: its name tells no format.
    """
    if str(given) == "-":
        return STANDARD_OUTPUT
    # A pipe and what the system offers as a file (a shell's /dev/fd/63) take CSV.
    if given.name.endswith(SUFFIXES) or given.is_relative_to("/dev") or given.is_fifo():
        return given
    raise SloshBringupError(f"{given}: a table is {', '.join(SUFFIXES)}, or - for standard output")


def write_response(path: Path, response: Response, msh: NDArray[np.float64]) -> None:
    """Writes COLUMNS [s, m, rad], one row per input sample.

    Args:
        path: where to; its suffix tells the format, CSV where it has none.
        response: the liquid's own answer.
        msh: (N,) what a sensor would read of its maximum [m].

    Raises:
        SloshBagError: a Parquet file, and pyarrow is not installed.
        OSError: the file cannot be written; what was there is as it was.
    """
    columns = (response.t, msh, response.azimuth, response.sh_x, response.sh_y)
    if path.suffix == ".parquet":
        arrow, parquet = load_pyarrow()
        with NewFile(path) as new, new.open() as stream:
            parquet.write_table(arrow.table(dict(zip(COLUMNS, columns, strict=True))), stream)
        return
    with new_text(path) as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        # The csv module writes floats by repr: to the same bits when read.
        writer.writerows(np.column_stack(columns).tolist())
