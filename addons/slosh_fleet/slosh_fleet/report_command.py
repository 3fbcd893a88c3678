"""`slosh report`: writes a validation report of a container's motion, or checks a written one."""

from __future__ import annotations

import argparse
import json
import math
import sys
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING

from slosh_base.files import check_apart, write_bytes
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.input_options import add_input_options, wanted_input
from slosh_bringup.cli.progress import item_progress
from slosh_bringup.cli.quantities import ERROR, FRACTION, HEIGHT
from slosh_bringup.errors import SloshBringupError

if TYPE_CHECKING:
    from slosh_fleet.validation.assemble import Assembled, Order

DONE, FAILED = 0, 1
HTML, PDF = (".html", ".htm"), (".pdf",)
LONGEST = 500_000_000
"""A larger file is no validation report [bytes]."""
EPILOG = """A criterion is undecided where the measurement's uncertainty spans the limit, or
where data are missing. Exit code 1: the verdict is fail or undecided, or --verify found a change.
Several bags must show the same motion of the same container; their spread is the repeatability.
A PDF needs: pip install -r requirements/pdf.txt"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh report` to the argument parser."""
    parser.epilog = EPILOG
    parser.add_argument(
        "bags", nargs="*", type=Path, metavar="BAG", help="recordings of the motion, one or more"
    )
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument(
        "--validation", action="store_true",
        help="write a validation report: method, data, versions, limits, results, signatures",
    )  # fmt: skip
    what.add_argument(
        "--verify", type=Path, metavar="FILE",
        help="check a validation report, and the files that it names, for later changes",
    )  # fmt: skip
    parser.add_argument(
        "-o", "--output", type=Path, action="append", metavar="FILE",
        help="file to write, .html or .pdf; may be given twice, once for each format",
    )  # fmt: skip
    _add_content(parser)
    _add_acceptance(parser)
    add_input_options(parser)
    parser.add_argument(
        "--digest", metavar="SHA256",
        help="with --verify: SHA-256 digest that was signed; the report's content must match it",
    )  # fmt: skip
    parser.add_argument(
        "--data", type=Path, action="append", default=[], metavar="FOLDER",
        help="with --verify: folder to search by name for files that were moved; may be repeated",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the report's content as JSON")


def _add_content(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--model", type=Path, help="model.yaml of the container (default: the recorded model)"
    )
    parser.add_argument(
        "--namespace", dest="cell", metavar="NAMESPACE",
        help="namespace of the cell, if the bag contains several cells, e.g. /slosh",
    )  # fmt: skip
    parser.add_argument("--title", help="heading of the report")
    parser.add_argument(
        "--document", default="", metavar="ID", help="document number to print in the report"
    )
    parser.add_argument(
        "--motion", default="", metavar="NAME", help="name of the motion to print in the report"
    )
    parser.add_argument(
        "--issued", type=_date, metavar="YYYY-MM-DD",
        help="date of issue (default: a line to fill in by hand)",
    )  # fmt: skip
    parser.add_argument(
        "--signature", action="append", metavar="ROLE[=NAME]",
        help="line for a handwritten signature; may be repeated (default: prepared by, checked "
        "by, approved by)",
    )  # fmt: skip


def _add_acceptance(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--limit", type=HEIGHT, metavar="M",
        help="greatest accepted measured height [m] (default: the monitor's limit when recorded)",
    )  # fmt: skip
    parser.add_argument(
        "--max-mae", type=ERROR, metavar="M",
        help="greatest accepted mean absolute error [m] of the nonlinear model (default: "
        "not judged)",
    )  # fmt: skip
    parser.add_argument(
        "--max-epsilon", type=FRACTION, metavar="SHARE",
        help="greatest accepted relative error of the nonlinear model's maximum height, e.g. 5%% "
        "(default: not judged)",
    )  # fmt: skip
    parser.add_argument(
        "--max-spread", type=HEIGHT, metavar="M",
        help="greatest accepted difference between the highest and the lowest peak height [m] of "
        "the same motion in the bags (default: not judged)",
    )  # fmt: skip
    parser.add_argument(
        "--uncertainty", type=ERROR, default=0.0, metavar="M",
        help="additional standard uncertainty of the measured heights [m], e.g. of the camera's "
        "calibration, besides the one that the camera states (default 0)",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Writes a validation report, or checks an existing one for later changes."""
    return _verify(arguments) if arguments.verify else _write(arguments)


def _write(arguments: argparse.Namespace) -> int:
    if not arguments.bags:
        raise SloshBringupError("--validation needs at least one BAG")
    if arguments.digest or arguments.data:
        raise SloshBringupError("--digest and --data belong to --verify")
    outputs = list(dict.fromkeys(arguments.output or ()))
    if not outputs and not arguments.json:
        raise SloshBringupError("give the file of the report: -o FILE.html, -o FILE.pdf, or both")
    _check_outputs(outputs, arguments)
    from slosh_fleet.validation.assemble import assemble
    from slosh_fleet.validation.seal import content_digest, content_of

    with item_progress("report", len(arguments.bags), "bags") as progress:
        found = assemble(arguments.bags, _order(arguments), progress.add)
    for output in outputs:
        write_bytes(output, _file(output, found))
        print(plain_line(f"report: {output}"), file=sys.stderr)
    content = content_of(found.report)
    if arguments.json:
        print(json.dumps(content, indent=2, allow_nan=False))
    else:
        _tell(found)
        print(f"SHA-256 of the content: {content_digest(content)}")
    return DONE if found.report.verdict == "pass" else FAILED


def _tell(found: Assembled) -> None:
    from slosh_fleet.validation.document import criteria_table
    from slosh_report.text import blocks_text

    print(blocks_text((criteria_table(found.report),)))
    print(f"verdict: {found.report.verdict}")


def _file(output: Path, found: Assembled) -> bytes:
    from slosh_fleet.validation.document import validation_page, validation_pdf

    write = validation_pdf if output.suffix.lower() in PDF else validation_page
    return write(found.report, found.runs)


def _check_outputs(outputs: list[Path], arguments: argparse.Namespace) -> None:
    """Raises an error if an output has an unknown suffix or would overwrite an input."""
    from slosh_bag.mcap_files.bag_folder import files_of

    for output in outputs:
        if output.suffix.lower() not in (*HTML, *PDF):
            raise SloshBringupError(f"{output}: a report is a .html or a .pdf file")
        if output.is_dir():
            raise SloshBringupError(f"{output}: is a folder")
        if not output.absolute().parent.is_dir():
            raise SloshBringupError(f"there is no folder {output.parent}; make it first")
        if output.suffix.lower() in PDF:
            from slosh_report.pdf import check_library

            check_library()
    for bag in arguments.bags:
        if not bag.exists():
            raise SloshBringupError(f"{bag}: no such file or folder")
    files = [file for bag in arguments.bags for file in files_of(bag)]
    check_apart(outputs, [*files, arguments.model])


def _order(arguments: argparse.Namespace) -> Order:
    from slosh_bringup.replay.task import unique_names
    from slosh_fleet.validation.assemble import Order
    from slosh_fleet.validation.content import Signature
    from slosh_fleet.validation.criteria import Acceptance

    for name in ("limit", "max_mae", "max_epsilon", "max_spread", "uncertainty"):
        value = getattr(arguments, name)
        if value is not None and not (math.isfinite(value) and value >= 0.0):
            option = name.replace("_", "-")
            raise SloshBringupError(f"--{option} {value:g}: must be a number of at least 0")
    given = {
        "title": arguments.title,
        "signatures": tuple(
            Signature(role.strip(), name.strip())
            for role, _, name in (text.partition("=") for text in arguments.signature or ())
        ),
    }
    if len({bag.resolve() for bag in arguments.bags}) < len(arguments.bags):
        raise SloshBringupError("a bag is given twice: it would count as a repetition")
    return Order(
        names=tuple(unique_names(arguments.bags)),
        document=arguments.document,
        issued=arguments.issued or "",
        motion=arguments.motion,
        model=arguments.model,
        cell=arguments.cell,
        given=wanted_input(arguments),
        uncertainty=arguments.uncertainty,
        acceptance=Acceptance(
            arguments.limit, arguments.max_mae, arguments.max_epsilon, arguments.max_spread
        ),
        **{name: value for name, value in given.items() if value},
    )


def _date(text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r:.40} is no date YYYY-MM-DD") from None


def _verify(arguments: argparse.Namespace) -> int:
    if arguments.bags or arguments.output:
        raise SloshBringupError("--verify takes no BAG and no -o; moved bags are found by --data")
    from slosh_fleet.validation.files import check_files
    from slosh_fleet.validation.seal import check_seal
    from slosh_report.text_table import aligned

    file: Path = arguments.verify
    if file.stat().st_size > LONGEST:
        raise SloshBringupError(f"{file}: is too large for a validation report")
    for folder in arguments.data:
        if not folder.is_dir():
            raise SloshBringupError(f"{folder}: no such folder")
    found = check_seal(file.read_bytes(), str(file))
    failures = list(found.failures)
    if arguments.digest and arguments.digest.strip().lower() != found.digest:
        failures.append(f"the content is not the signed one: its SHA-256 is {found.digest}")
    states = check_files(found.content, file, arguments.data)
    rows = [(one.path, one.state, str(one.place or "")) for one in states]
    if rows:
        print("\n".join(aligned([("file", "state", "found at"), *rows], "<<<")))
    wrong = [one for one in states if one.state != "same"]
    failures += [f"{one.path}: {_remedy(one.state)}" for one in wrong]
    for failure in failures:
        print(plain_line(f"slosh report: {failure}"), file=sys.stderr)
    print(f"SHA-256 of the content: {found.digest}")
    print("unchanged" if not failures else f"{len(failures)} differences")
    return FAILED if failures else DONE


def _remedy(state: str) -> str:
    if state == "missing":
        return "is missing; if it was moved, name the folder: --data FOLDER"
    return "was changed since the report"
