"""`slosh simulate`: open-loop prediction of a motion table."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from slosh_base.files import check_apart
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.pictures import check_picture
from slosh_bringup.cli.quantities import HEIGHT
from slosh_bringup.cli.table_options import add_table_options, table_options
from slosh_bringup.simulate.answer import Answer, make_answer
from slosh_bringup.simulate.doubts import check_possible, doubts
from slosh_bringup.simulate.table import STANDARD_OUTPUT, output_path, write_response
from slosh_metrics.input_checks.table_checks import InputDoubt
from slosh_model.gaps import gap_text
from slosh_model.measure import predicted_heights
from slosh_model.model_file import read_model
from slosh_model.simulate import simulate
from slosh_model.tilt import added_text, attitude_of, feeling
from slosh_plan import HeightLimits
from slosh_tables.motion_table import read_motion_table
from slosh_tables.text_table.time_unit import check_span

EXIT_KEPT, EXIT_NOT_KEPT = 0, 1
EPILOG = """columns of the table:
  t           the motion's samples [s]
  msh         maximum height at the wall as a sensor would read it: with all effects of the
              model, also those on the measurement (offset, scale, delay, ...) [m]
  azimuth     direction of the liquid's own maximum, from the container's +x [rad]
  sh_x, sh_y  the liquid's own signed height at the container's +x and +y [m]

Without effects on the measurement, msh is the length of the vector (sh_x, sh_y). In a rectangle
it is the sum of their absolute values: the height at the corner.

The output states whether the motion stays within the range for which the model was validated,
below the limit (--limit) and below the rim (if model.yaml gives rim_height).

exit code: 0, 1 where the limit or the rim is exceeded, units or axes look wrong or samples are
missing, 2 for wrong input"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declares the subcommand's options."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = EPILOG
    parser.add_argument("model", type=Path, help="model.yaml")
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
    parser.add_argument(
        "--plot", type=Path, metavar="OUT.png", help="picture of the result to write (.png, .svg)"
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON")
    add_table_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Simulates, writes table and picture, prints the answer; 1 where it is doubtful."""
    plot = arguments.plot
    check_apart([arguments.output, plot], [arguments.model, arguments.motion])
    output = output_path(arguments.output)
    check_picture(plot)
    if arguments.limit is not None:
        HeightLimits(arguments.limit)  # refuses what is no height
    model = read_model(arguments.model)
    motion = read_motion_table(arguments.motion, table_options(arguments))
    check_span(arguments.motion, motion.t)
    check_possible(arguments.motion, motion)
    inputs = motion.inputs()
    added = added_text(model, attitude_of(inputs))
    if added:
        print(plain_line(f"slosh simulate: note: {arguments.motion}: {added}"), file=sys.stderr)
    model = feeling(model, attitude_of(inputs))
    response, _ = simulate(model, inputs)
    msh = predicted_heights(model, inputs, inputs.t)[:, 0]
    gaps = gap_text(motion.t, model)
    found = (*doubts(model, motion), *([InputDoubt(gaps)] if gaps else []))
    answer = make_answer(model, inputs, (msh, response.msh), arguments.limit, found)
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
    doubtful = answer.over_limit or answer.over_rim or answer.doubtful
    return EXIT_NOT_KEPT if doubtful else EXIT_KEPT


def summary(answer: Answer, output: str, *, as_json: bool) -> str:
    """The answer in one line, or as JSON."""
    if as_json:
        return json.dumps({**answer.facts(), "output": output})
    return f"{answer.text()}, {answer.samples} rows in {plain_line(output)}"
