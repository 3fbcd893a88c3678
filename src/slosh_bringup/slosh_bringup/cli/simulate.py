"""`slosh simulate`: simulates the liquid's response to a motion table, without measurements."""

from __future__ import annotations

import argparse
import csv
import json
import math
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slosh_bag.interchange.export_sinks import load_pyarrow
from slosh_base.files import NewFile, check_apart, new_text
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.output_names import check_picture
from slosh_bringup.cli.quantities import HEIGHT
from slosh_bringup.cli.rim_option import add_rim_distance
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.simulate.answer import SimulationAnswer, doubts, make_answer
from slosh_model.gaps import gap_text
from slosh_model.measure import predicted_heights
from slosh_model.model_text import read_model
from slosh_model.response import Response
from slosh_model.simulate import simulate
from slosh_model.tilt import added_text, attitude_of, with_tilt
from slosh_motion.checks.table_checks import InputDoubt
from slosh_motion.tables.columns import check_span
from slosh_motion.tables.motion_table import read_motion_table
from slosh_plan import HeightLimits
from slosh_plan.heights import highest, msh_of
from slosh_plan.prediction import checked_horizon
from slosh_plan.start import begun
from slosh_plan.trajectory import PEAK_SPACING, rested

EXIT_KEPT, EXIT_NOT_KEPT = 0, 1
EPILOG = """columns of the table:
  t           times of the motion's samples [s]
  msh         maximum height at the wall as a sensor measures it, including the model's
              effects on the measurement (offset, scale, delay, ...) [m]
  azimuth     direction of the liquid's highest point, from the container's +x [rad]
  sh_x, sh_y  signed height of the liquid at the container's +x and +y wall, without the
              model's effects on the measurement [m]

Without effects on the measurement, msh is the length of the vector (sh_x, sh_y). In a rectangle
it is the sum of their absolute values: the height at the corner.

The peak is looked for between the rows, too, and in the three periods after the last row, in which
the container rests, as by `slosh predict`. The table holds the rows alone.

The output states whether the motion stays within the range for which the model was validated,
below the limit (--limit) and below the rim (if model.yaml gives rim_height) by --rim-distance.

exit code: 0, 1 where the limit or the rim is exceeded, units or axes look wrong or samples are
missing, 2 for wrong input"""

COLUMNS = ("t", "msh", "azimuth", "sh_x", "sh_y")
SUFFIXES = (".csv", ".csv.gz", ".parquet")
MOST_ROWS = 1_000_000
"""So many moments of a long motion are looked at for its peak."""
STANDARD_OUTPUT = Path("/dev/stdout")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh simulate` to the argument parser."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model of the liquid (model.yaml)")
    parser.add_argument("motion", type=Path, help="motion table: t,ax,ay,az[,...] (.csv, .csv.gz)")
    parser.add_argument(
        "-o", "--output", type=Path, required=True,
        help="table of heights to write [m, rad]: .csv, .csv.gz, .parquet, or - for standard "
        "output",
    )  # fmt: skip
    parser.add_argument(
        "--limit",
        type=HEIGHT,
        metavar="M",
        help="largest allowed height above the still level [m]",
    )
    add_rim_distance(parser)
    parser.add_argument(
        "--plot",
        type=Path,
        metavar="OUT.png",
        help="picture to write, with the result (.png, .svg)",
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulates the motion; writes files, prints the result; returns 1 if input is doubtful."""
    plot = arguments.plot
    check_apart([arguments.output, plot], [arguments.model, arguments.motion])
    output = output_path(arguments.output)
    check_picture(plot)
    model = read_model(arguments.model)
    asked = math.inf if arguments.limit is None else arguments.limit
    limits = HeightLimits(asked, rim_distance=arguments.rim_distance)
    limits.under_rim(model)  # refuses a distance that cannot be kept
    motion = read_motion_table(arguments.motion, table_options(arguments), tell_wrong=False)
    check_span(arguments.motion, motion.t)
    inputs = motion.inputs()
    added = added_text(model, attitude_of(inputs))
    if added:
        print(plain_line(f"slosh simulate: note: {arguments.motion}: {added}"), file=sys.stderr)
    model = with_tilt(model, attitude_of(inputs))
    spacing = max(PEAK_SPACING, float(np.ptp(inputs.t)) / MOST_ROWS)
    fine = rested(inputs, checked_horizon(model, None), spacing)
    (worst,) = highest(model, [fine])
    model = model if worst.growth == 1.0 else model.spatial()
    state = begun(model, worst.start, float(inputs.t[0]))
    response, _ = simulate(model, inputs, state)
    msh = predicted_heights(model, inputs, inputs.t, state=state)[:, 0]
    read = predicted_heights(model, fine, fine.t, state=state)[:, 0]
    liquid = msh_of(model.container, worst.heights)
    gaps = gap_text(motion.t, model)
    found = (*doubts(model, motion), *([InputDoubt(gaps)] if gaps else []))
    heights = fine.t, read, liquid
    answer = make_answer(model, inputs, heights, limits, found, worst.growth)
    write_response(output, response, msh)
    if plot is not None:
        from slosh_bringup.simulate.chart import write_chart  # with matplotlib, slow to load

        write_chart(plot, inputs, msh, answer, model.limits.acceleration)
    if answer.doubts:
        told = "; ".join(answer.doubts)
        print(plain_line(f"slosh simulate: warning: {arguments.motion}: {told}"), file=sys.stderr)
    # On standard output the table stands alone.
    stream = sys.stderr if output == STANDARD_OUTPUT else sys.stdout
    where = "standard output" if output == STANDARD_OUTPUT else str(output)
    print(summary(answer, where, as_json=arguments.json), file=stream)
    doubtful = answer.over_limit or answer.too_near or answer.doubtful
    return EXIT_NOT_KEPT if doubtful else EXIT_KEPT


def summary(answer: SimulationAnswer, output: str, *, as_json: bool) -> str:
    """Formats the result of a simulation, in one line or as JSON."""
    if as_json:
        return json.dumps({**answer.facts(), "output": output})
    return f"{answer.text()}, {answer.samples} rows in {plain_line(output)}"


def output_path(given: Path) -> Path:
    """Returns the path of the output table; `-` means standard output.

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
    """Writes the simulated heights as a table, one row per input sample, in SI units.

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
