"""The `slosh` command: selects the subcommand and turns errors into exit codes.

Exit codes: 0 done, 1 a check failed, 2 the user's input is wrong.
"""

from __future__ import annotations

import _thread
import argparse
import importlib
import logging
import os
import sys
import threading
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any, TextIO, cast

from slosh_base.addons import add_ons
from slosh_base.files.new_file import keep_others_from_writing
from slosh_base.files.plain_text import PlainStream, plain_line
from slosh_bringup.cli.parser import EXIT_WRONG_INPUT, SloshParser, grouped_help
from slosh_bringup.errors import SloshBringupError
from slosh_bringup.stop_request import StopRequest

# One module per subcommand, imported only when it runs: `slosh --help` stays instant.
# In the order in which the help shows them.
GROUPS: dict[str, dict[str, str]] = {
    "start": {
        "doctor": "check the installation and suggest fixes",
        "demo": "run the simulated cell with all nodes, record it and write a report",
        "new": "write commented model.yaml, cell.yaml and camera.yaml for your own container",
        "modes": "list a container's natural frequencies, damping, masses and heights",
        "explain": "explain an effect, a flag, a column, a model's name or a unit",
    },
    "motions": {
        "simulate": "predict the liquid's heights for a motion table (open loop)",
        "predict": "predict the peak heights of candidate motions and their safe time scales",
        "plan": "plan the fastest motion along a path that keeps the liquid below a height limit",
        "shape": "filter a motion so that it leaves no residual wave of the liquid's frequency",
        "motion": "write a packaging machine's motion as a motion table",
    },
    "camera": {
        "intrinsics": "calibrate a camera's intrinsic parameters from pictures of a board",
        "calibrate": "find the camera's pose from an image of the liquid at rest; write "
        "camera.yaml",
        "detect": "measure heights in a video, a folder of images or a bag",
    },
    "robot": {
        "cell": "run all nodes on a real robot's topics until Ctrl-C",
        "node": "run a single node until Ctrl-C, as ros2 run does",
        "call": "call a service of a running node, as ros2 service call does",
        "mounting": "check a sensor's axes, signs and units against the robot's recorded motion",
        "watch": "serve the operator's page of a running cell or of a recording",
    },
    "recordings": {
        "replay": "run the estimator and the monitor again on recorded bags",
        "play": "publish a bag over DDS with /clock, for live nodes",
        "import": "convert motion tables, other bags and public measured data to bags",
        "export": "export a bag's topics as CSV or Parquet, or its motion as a table",
        "store": "show which bags of a cell's runs are kept, and delete old ones",
        "migrate": "rewrite model.yaml, cell.yaml, camera.yaml or manifest.yaml for this version",
        "recover": "recover the intact messages of an unfinished or damaged bag",
    },
    "models from measurements": {
        "identify": "identify a model's parameters from measured motions",
        "discover": "find where model and measurement disagree, and the effect that is missing",
    },
}
"""Subcommands of the core by their groups; add-ons bring more, see `all_groups`."""
LIVE = ("demo", "cell")

HELP = "help"
USAGE = (
    "usage: slosh COMMAND ...\n\nMeasures, estimates and records sloshing in a robot's container."
)
END = (
    "slosh help COMMAND shows the options of a command; -V or --version shows the "
    "version.\nLengths, times and angles accept a unit: 0.01, 10mm, 300ms, 5deg."
)

EXIT_DONE, EXIT_FAILED = 0, 1
_MOMENT = 0.02  # s

MODEL = (".yaml", ".yml")
TABLE = (".csv", ".csv.gz", ".txt", ".tsv")
AFTER_MODEL = ("motion", "path", "trajectories")
"""Arguments that name tables and follow MODEL."""
OTHERS = ("model.yaml", "cell.yaml", "camera.yaml")
"""Files of a cell by their usual names."""


def command() -> int:
    """Runs `main` as the `slosh` process, with settings that child processes inherit.

    None of them takes a module from the folder that it is started in, or writes what others could
    change.
    """
    os.environ["PYTHONSAFEPATH"] = "1"
    # Set before NumPy loads: on matrices as small as a fit's or a detector's, OpenBLAS spends many
    # times the work on waking and awaiting its threads; and their number would change last digits.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    keep_others_from_writing()
    # Whoever names a file, a topic or a model may have put control characters there.
    sys.stdout = cast("TextIO", PlainStream(sys.stdout))
    sys.stderr = cast("TextIO", PlainStream(sys.stderr))
    sys.unraisablehook = interrupt_again
    if "_ARGCOMPLETE" in os.environ:
        complete()
    return main()


def complete() -> None:
    """Answers the shell's completion request and ends the process."""
    try:
        import argcomplete  # comes with the tools of ROS 2
    except ImportError:
        sys.exit(EXIT_FAILED)
    words = os.environ.get("COMP_LINE", "").split()[1:]
    argcomplete.autocomplete(build_parser(_command_of(words)))


def interrupt_again(unraisable: Any) -> None:
    """Handles exceptions that Python cannot propagate; raises a lost Ctrl-C again.

    One that falls into a destructor or a callback, such as those of an import, would be shown as a
    traceback, and then forgotten.
    """
    if not issubclass(unraisable.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    later = threading.Timer(_MOMENT, _thread.interrupt_main)
    later.daemon = True
    later.start()


def _of_ros(module: str) -> bool:
    """Whether a module belongs to ROS 2 or to message packages that ROS wheels do not contain."""
    name = module.partition(".")[0]
    return name == "rclpy" or name.endswith(("_msgs", "_interfaces"))


def _command_of(words: Sequence[str]) -> str | None:
    """Returns the first command-line word that is not an option, or None if there is none."""
    return next((word for word in words if not word.startswith("-")), None)


def _run(words: list[str], name: str | None, stop: StopRequest | None) -> int:
    parser = build_parser(name)
    parsed = parser.parse_args(words)
    if parsed.command is None:
        parser.print_help()
        return EXIT_WRONG_INPUT
    parsed.stop = stop
    return run_guarded(parsed)


def build_parser(chosen: str | None) -> argparse.ArgumentParser:
    """Creates the argument parser; imports only the chosen subcommand's module."""
    parser = _Slosh(prog="slosh")
    parser.add_argument(
        "-V", "--version", action=_Version, nargs=0, help="show the version and exit"
    )
    subparsers = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=SloshParser)
    of_core = {name: text for group in GROUPS.values() for name, text in group.items()}
    # Add-ons are looked for only where one may be meant: that reads files of all packages.
    for name, summary in (of_core if chosen in of_core else all_commands()).items():
        subparser = subparsers.add_parser(name, help=summary, description=summary)
        if name == chosen:
            module = importlib.import_module(command_module(name))
            module.add_arguments(subparser)
            subparser.set_defaults(run=module.run)
    return parser


def all_groups() -> dict[str, dict[str, str]]:
    """Returns the subcommands of the core and of all add-ons, by their groups in the help."""
    groups = {group: dict(commands) for group, commands in GROUPS.items()}
    for add_on in add_ons():
        for name, command in add_on.commands.items():
            groups.setdefault(command.group, {})[name] = command.summary
    return groups


def all_commands() -> dict[str, str]:
    """Returns all subcommands with what they do, in the order of the help."""
    return {name: text for group in all_groups().values() for name, text in group.items()}


class _Slosh(SloshParser):
    """Parser of the `slosh` command itself; its help groups the subcommands by task."""

    def format_help(self) -> str:
        """Formats the help, with the subcommands in groups."""
        return grouped_help(USAGE, all_groups(), END)


class _Version(argparse.Action):
    """Action of --version, which looks up the version only when it is requested."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from importlib.metadata import version

        print(f"slosh {version('slosh_bringup')}")
        parser.exit()


def command_module(command: str) -> str:
    """Returns the name of a subcommand's module; `import` is a Python keyword."""
    if not any(command in group for group in GROUPS.values()):
        return next(one.commands[command].module for one in add_ons() if command in one.commands)
    name = "import_data" if command == "import" else command.replace("-", "_")
    return f"slosh_bringup.cli.{name}"


def run_guarded(parsed: argparse.Namespace) -> int:
    """Runs the subcommand; prints one line and returns exit code 2 for invalid input."""
    notes, computing = _Notes(parsed.command), logging.getLogger("slosh_model")
    computing.setLevel(logging.INFO)
    computing.addHandler(notes)
    try:
        check_order(parsed)
        return int(parsed.run(parsed))
    except BrokenPipeError:
        # The reader of our output has gone (`slosh … | head`); say nothing more to it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_DONE
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        said = f"slosh {parsed.command}: {where}{_reason(error)}"
        print(plain_line(said), file=sys.stderr)
        return EXIT_WRONG_INPUT
    except ValueError as error:
        # Every package's root exception is a ValueError whose text is one line.
        if not is_own(error):
            raise
        print(plain_line(f"slosh {parsed.command}: {error}"), file=sys.stderr)
        return EXIT_WRONG_INPUT
    finally:
        computing.removeHandler(notes)


class _Notes(logging.Handler):
    """Prints what a model tells while it computes, so that a long wait is not taken for a hang."""

    def __init__(self, command: str) -> None:
        super().__init__()
        self._command = command

    def emit(self, record: logging.LogRecord) -> None:
        """Prints a record as a note."""
        print(f"slosh {self._command}: note: {record.getMessage()}", file=sys.stderr, flush=True)


def _reason(error: OSError) -> str:
    """Describes why a file cannot be read or written."""
    if isinstance(error, FileNotFoundError) and error.filename:
        folder = Path(os.fsdecode(error.filename)).parent
        if not folder.exists():
            return f"there is no folder {folder}; make it first"
    return str(error.strerror or error)


def is_own(error: ValueError) -> bool:
    """Whether a ValueError comes from slosh's packages rather than from a programming error."""
    return type(error).__module__.startswith("slosh_")


def check_order(arguments: argparse.Namespace) -> None:
    """Raises an error if positional arguments are in the wrong order, such as a table as MODEL.

    Raises:
        SloshBringupError: with the command as it is meant, where two are exchanged.
    """
    _check_kinds(arguments)
    model = getattr(arguments, "model", None)
    for name in AFTER_MODEL:
        found = [one for one in _paths(arguments, name) if _ends(one, MODEL)]
        if not found or not isinstance(model, Path):
            continue
        if _ends(model, TABLE):
            raise SloshBringupError(
                f"MODEL and {_shown(name)} are exchanged; type: slosh {arguments.command} "
                f"{found[0]} {model}"
            )
        raise SloshBringupError(
            f"{found[0]}: is a model, but {_shown(name)} must be a table; only the first "
            "argument is a MODEL"
        )
    if isinstance(model, Path) and _ends(model, TABLE):
        raise SloshBringupError(f"{model}: is a table, but MODEL must be a model.yaml")


def _check_kinds(arguments: argparse.Namespace) -> None:
    """Raises an error if a folder or a wrong kind of file is given for a file argument."""
    for model in filter(Path.is_dir, _paths(arguments, "model")):
        inside = model / "model.yaml"
        meant = f"; did you mean {inside}?" if inside.is_file() else ""
        raise SloshBringupError(f"{model}: is a folder where MODEL belongs, a model.yaml{meant}")
    for name, usual in (("model", "model.yaml"), ("config", "cell.yaml")):
        for path in _paths(arguments, name):
            if path.name in OTHERS and path.name != usual:
                inside = path.with_name(usual)
                meant = f"; did you mean {inside}?" if inside.is_file() else ""
                belongs = f"where {name.upper()} belongs, a {usual}"
                raise SloshBringupError(f"{path}: is another file {belongs}{meant}")
    for name in AFTER_MODEL:
        for table in filter(Path.is_dir, _paths(arguments, name)):
            raise SloshBringupError(
                f"{table}: a folder where {_shown(name)} belongs, a table; a recording's is "
                f"written by slosh export {table} --motion -o motion.csv"
            )


def _paths(arguments: argparse.Namespace, name: str) -> list[Path]:
    """Returns the paths given for an argument, as a list."""
    given = getattr(arguments, name, None)
    return [
        one for one in (given if isinstance(given, list) else [given]) if isinstance(one, Path)
    ]


def _ends(path: Path, endings: tuple[str, ...]) -> bool:
    return path.name.lower().endswith(endings)


def _shown(name: str) -> str:
    return {"trajectories": "TRAJECTORY"}.get(name, name.upper())


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line; returns the exit code."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words[:1] == [HELP]:
        words = [*words[1:], "--help"]
    name = _command_of(words)
    try:
        # What starts nodes ends them, and reports, whenever a signal comes.
        with StopRequest() if name in LIVE else nullcontext() as stop:
            return _run(words, name, stop)
    except KeyboardInterrupt:
        print("slosh: stopped", file=sys.stderr)
        return EXIT_FAILED
    except ModuleNotFoundError as error:
        if not _of_ros(error.name or ""):
            raise
        print(
            f"slosh {name}: needs ROS 2 and the built workspace (no module {error.name!r} here): "
            "run it in a checkout after `make setup`",
            file=sys.stderr,
        )
        return EXIT_WRONG_INPUT
