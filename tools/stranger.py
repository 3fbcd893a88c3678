"""Tests typical user mistakes: each must give the right result or one line with a remedy.

    tools/run python tools/stranger.py [--docs]

28 kinds of motion tables, 9 kinds of model.yaml, 100 command lines (`stranger_mistakes.txt`). An
answer is right where its number is that of the motion, or where the doubt is named with exit code
1; a refusal is one line with the remedy and exit code 2. A traceback, another exit code, a second
line, a number out of bounds, a line without the remedy: wrong.
"""

from __future__ import annotations

import argparse
import contextlib
import gzip
import io
import json
import re
import shlex
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np
from result_tables import with_files

from slosh_base.files import write_text
from slosh_bringup.cli.main import main as slosh

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "mistakes.md"
MISTAKES = Path(__file__).with_name("stranger_mistakes.txt")
SIMULATE = "simulate cup/model.yaml {} -o heights.csv --json"
PEAK = (5.8e-3, 6.0e-3)
"""Of the motion in the cup, in whatever form its table comes [m]."""
HEADING = "t,ax,ay,az"
LINES = "command line"
"""The mistakes that the page shows as the file in which they are listed."""
LONGEST = 140
"""Of an answer on the page [characters]."""
STAMP = 1_750_000_000
"""When the motion was recorded [s since 1970]."""


class Mistake(NamedTuple):
    """A wrong command line, and what the program's answer to it must contain.

    Attributes:
        kind: of what.
        name: of the mistake.
        words: the command line.
        code: its exit code.
        phrase: a pattern that the answer's line must hold: the remedy, or the doubt; empty: the
            answer is the motion's peak.
    """

    kind: str
    name: str
    words: str
    code: int
    phrase: str


class Answer(NamedTuple):
    """Exit code, standard output, error lines and duration [s] of a command."""

    code: int
    output: str
    errors: list[str]
    seconds: float


def rated(mistake: Mistake, answer: Answer) -> str:
    """Rates the answer to a mistake: `right`, `remedy`, or a text that says what is wrong."""
    said = "\n".join([*answer.errors, answer.output])
    if "Traceback" in said:
        return "wrong: a traceback"
    if answer.code != mistake.code:
        return f"wrong: exit code {answer.code} for {mistake.code}"
    if mistake.code == 2 and len(answer.errors) != 1:
        return f"wrong: {len(answer.errors)} lines"
    if not mistake.phrase:
        peak = json.loads(answer.output)["peak"]
        within = PEAK[0] <= peak <= PEAK[1]
        return "right" if within else f"wrong: a peak of {1e3 * peak:.2f} mm"
    if not re.search(mistake.phrase, said):
        return f"wrong: no {mistake.phrase!r} in {said.strip()[:200]!r}"
    return "remedy" if mistake.code == 2 else "right"


def typed(words: str) -> Answer:
    """Runs a `slosh` command line in this process and captures its output."""
    output, errors, begun = io.StringIO(), io.StringIO(), time.monotonic()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(errors):
        try:
            code = slosh(shlex.split(words))
        except SystemExit as end:
            code = int(end.code or 0)
        except Exception:
            code = -1
            traceback.print_exc()
    lines = [line for line in errors.getvalue().splitlines() if line.strip()]
    return Answer(code, output.getvalue(), lines, time.monotonic() - begun)


# --- motion tables -------------------------------------------------------------------------------


def table(heading: str, rows: np.ndarray, separator: str = ",", decimal: str = ".") -> str:
    """Formats a motion table as text with given separators."""
    lines = [separator.join(heading.split(","))]
    lines += [separator.join(repr(float(x)).replace(".", decimal) for x in row) for row in rows]
    return "\n".join(lines) + "\n"


def table_mistakes(folder: Path) -> Iterator[Mistake]:
    """Writes faulty motion tables, and yields for each what its simulation must answer."""
    rows = np.loadtxt(folder / "move.csv", delimiter=",", skiprows=1)
    plain = table(HEADING, rows)
    for name, (content, code, phrase) in tables(rows, plain).items():
        suffix = ".csv.gz" if "gzip" in name else ".xlsx" if "workbook" in name else ".csv"
        path = folder / f"{re.sub(r'[^a-z0-9]+', '_', name.lower())}{suffix}"
        if content is not None:
            path.write_bytes(content if isinstance(content, bytes) else content.encode())
        yield Mistake("motion table", name, SIMULATE.format(path.name), code, phrase)


def tables(rows: np.ndarray, plain: str) -> Mapping[str, tuple[str | bytes | None, int, str]]:
    """Returns the faulty motion tables by name: content (or None), exit code, required phrase."""
    t, a = rows[:, :1], rows[:, 1:]
    short = rows[::20]
    lines = plain.splitlines(keepends=True)
    shuffled = np.vstack([rows[:5], rows[3:4], rows[5:]])
    cell = "".join([*lines[:3], "0.002,abc,0.0,0.0\n", *lines[3:]])
    blank = "".join([*lines[:3], "0.0025,,0.0,0.0\n", *lines[4:]])
    stamps = [f"{STAMP * 10**9 + round(x * 1e9)}" for x in t[:, 0]]
    dated = [f"2025-03-01 12:00:{x:09.6f}" for x in t[:, 0]]
    others = [line.split(",", 1)[1] for line in lines[1:]]
    indexed = "," + lines[0] + "".join(f"{k},{line}" for k, line in enumerate(lines[1:]))
    return {
        "semicolons": (table(HEADING, rows, ";"), 0, ""),
        "tabs": (table(HEADING, rows, "\t"), 0, ""),
        "semicolons and decimal commas": (table(HEADING, rows, ";", ","), 0, ""),
        "a byte order mark": (plain.encode("utf-8-sig"), 0, ""),
        "UTF-16, as Excel's Unicode text": (plain.encode("utf-16"), 0, ""),
        "line ends of Windows": (plain.replace("\n", "\r\n"), 0, ""),
        "a remark before the heading": ("# from the robot\n" + plain, 0, ""),
        "an index column, as pandas writes it": (indexed, 0, ""),
        "packed by gzip": (gzip.compress(plain.encode()), 0, ""),
        "t in ms, as its heading says": (table("t [ms],ax,ay,az", np.hstack([1e3 * t, a])), 0, ""),
        "ax in mm/s², as its heading says": (
            table("t,ax [mm/s²],ay [mm/s²],az [mm/s²]", np.hstack([t, 1e3 * a])), 0, "",
        ),
        "names and units of another program": (
            table("time (s),acc_x (m/s^2),acc_y (m/s^2),acc_z (m/s^2)", rows), 0, "",
        ),
        "stamps in ns since 1970": (
            lines[0] + "".join(f"{s},{o}" for s, o in zip(stamps, others, strict=True)), 0, "",
        ),
        "dates": (
            lines[0] + "".join(f"{s},{o}" for s, o in zip(dated, others, strict=True)), 0, "",
        ),
        "gravity in az": (table(HEADING, np.add(rows, [0.0, 0.0, 0.0, 9.81])), 1, "gravity"),
        "ax in mm/s², unsaid": (table(HEADING, np.hstack([t, 1e3 * a])), 1, "mm/s²"),
        "ax in g, as its heading says": (
            table("t,ax [g],ay [g],az [g]", np.hstack([t, a / 9.80665])), 0, "",
        ),
        "t in ms, unsaid": (table(HEADING, np.hstack([1e3 * t, a])), 2, "--time-unit ms"),
        "rows 20 ms apart": (table(HEADING, short), 0, ""),
        "a gap of a second": (table(HEADING, np.vstack([rows[:200], rows[1200:]])), 1, "gap"),
        "no az": ("\n".join(line.rsplit(",", 1)[0] for line in lines), 2, "'az' is missing"),
        "a column of no known name": (plain.replace("az", "temperature", 1), 2, "--columns"),
        "a text in a cell": (cell, 2, "line 4: column 'ax': 'abc' is not a number"),
        "an empty cell": (blank, 2, "line 4: column 'ax': .*fill the cell"),
        "a row twice": (table(HEADING, shuffled), 2, "line 7: .*time must increase"),
        "a heading alone": (lines[0], 2, "contains a heading but no rows"),
        "an empty file": ("", 2, "empty"),
        "a workbook": (b"PK\x03\x04" + bytes(200), 2, "save the workbook as CSV"),
    }  # fmt: skip


# --- models --------------------------------------------------------------------------------------

MODELS: Mapping[str, tuple[Callable[[str], str], str]] = {
    "the radius in mm": (
        lambda text: text.replace("radius: 0.04", "radius: 40"), r":6: .*did you mean 40 mm, 0.04",
    ),
    "the radius with its unit": (
        lambda text: text.replace("radius: 0.04", "radius: 4cm"), r":6: .*without the unit",
    ),
    "no fill_height": (
        lambda text: re.sub(r"\n  fill_height.*", "", text), "'container.fill_height' is missing",
    ),
    "a key mistyped": (
        lambda text: text.replace("fill_height", "fil_height"), "did you mean fill_height",
    ),
    "an effect mistyped": (
        lambda text: text.replace("surface_nonlinearity  #", "surface_nonlinear  #"),
        "did you mean surface_nonlinearity",
    ),
    "a rim below the liquid": (
        lambda text: text.replace("rim_height: 0.11", "rim_height: 0.05"),
        "rim_height = 0.05 m must lie above",
    ),
    "tabs for blanks": (lambda text: text.replace("  radius", "\tradius"), r":6: .*tab"),
    "effects by name alone": (
        lambda text: text.replace("- name: vertical_acceleration", "- vertical_acceleration"),
        "did you mean - name: vertical_acceleration",
    ),
    "an empty file": (lambda text: "", "slosh new"),
}  # fmt: skip
"""By name: what is done to a right model.yaml, and the phrase of the answer."""


def model_mistakes(folder: Path) -> Iterator[Mistake]:
    """Writes faulty model files, and yields for each what its simulation must answer."""
    right = (folder / "cup" / "model.yaml").read_text(encoding="utf-8")
    for number, (name, (wrong, phrase)) in enumerate(MODELS.items()):
        path = folder / f"model_{number}.yaml"
        path.write_text(wrong(right), encoding="utf-8")
        words = f"simulate {path.name} move.csv -o heights.csv"
        yield Mistake("model.yaml", name, words, 2, phrase)


def line_mistakes() -> Iterator[Mistake]:
    """Yields the wrong command lines of the file stranger_mistakes.txt."""
    for line in MISTAKES.read_text(encoding="utf-8").splitlines():
        if not line.startswith("#"):
            words, _, phrase = line.partition(" => ")
            code = re.match(r"\[(\d)\] ", phrase)
            wanted = re.escape(phrase[4:] if code else phrase)
            yield Mistake(LINES, f"`{words}`", words, int(code[1]) if code else 2, wanted)


def prepare(folder: Path) -> list[Mistake]:
    """Creates a new user's folder with files, and returns the mistakes to make in it."""
    (folder / "bags").symlink_to(ROOT / "bags")
    for words in (
        "new cup --diameter 0.08 --fill-height 0.06 --rim-height 0.11",
        "motion quintic --speed 20 --stroke 0.3 -o move.csv",
    ):
        if typed(words).code != 0:
            raise SystemExit(f"slosh {words}: failed")
    for name, rows in (("path", "1,0.3,0,0"), ("path_mm", "1,300,0,0"), ("one", "")):
        (folder / f"{name}.csv").write_text(f"t,x,y,z\n0,0,0,0\n{rows}\n", encoding="utf-8")
    return [*table_mistakes(folder), *model_mistakes(folder), *line_mistakes()]


def page(rows: list[tuple[Mistake, Answer, str]]) -> str:
    """Formats all mistakes with the answers to them as a documentation page."""
    kinds = list(dict.fromkeys(mistake.kind for mistake, _, _ in rows))
    lines = [
        "# Error messages", "",
        "Typical mistakes and the part of the answer that names the doubt or the remedy. "
        "*Right*: the right peak, or a warning with exit code 1. *Remedy*: one line with exit "
        "code 2. `tools/run python tools/stranger.py --docs` writes the page.", "",
        "| | mistakes | right | remedy | wrong |", "|---|--:|--:|--:|--:|",
    ]  # fmt: skip
    for kind in kinds:
        marks = [mark.split(":")[0] for mistake, _, mark in rows if mistake.kind == kind]
        counts = (marks.count(name) for name in ("right", "remedy", "wrong"))
        lines.append(f"| {kind} | {len(marks)} | {' | '.join(map(str, counts))} |")
    for kind in kinds:
        lines += [
            "",
            f"## {kind[0].upper()}{kind[1:]}",
            "",
        ]
        if kind == LINES:
            lines += [
                "```{literalinclude} ../tools/stranger_mistakes.txt",
                ":language: none",
                "```",
            ]
            continue
        own = [(mistake, answer) for mistake, answer, _ in rows if mistake.kind == kind]
        if plain := [mistake.name for mistake, _ in own if not mistake.phrase]:
            lines += [f"Right peak, without a warning: {'; '.join(plain)}.", ""]
        lines += ["| mistake | answer |", "|---|---|"]
        lines += [f"| {one.name} | {_shown(one, answer)} |" for one, answer in own if one.phrase]
    return "\n".join(lines) + "\n"


def _shown(mistake: Mistake, answer: Answer) -> str:
    """Returns the part of an answer that contains the required phrase."""
    said = [*answer.errors, *answer.output.splitlines()]
    for line in said:
        if found := re.search(mistake.phrase, line):
            begin = line.rfind("; ", 0, found.start()) + 2
            text = (
                line[begin if begin > 1 else 0 : found.end()] + line[found.end() :].split("; ")[0]
            )
            break
    else:
        text = said[0] if said else ""
    text = re.sub(r"^slosh \w+: (warning: )?([\w.]+: )?", "", text)
    text = text.replace("`", "'").replace("|", "\\|")
    return f"`{text[:LONGEST]}{'…' * (len(text) > LONGEST)}`"


def main() -> int:
    """Makes all mistakes and prints the ratings; returns 1 if an answer is wrong."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--docs", action="store_true", help=f"write {PAGE.name}")
    given = parser.parse_args()
    warnings.simplefilter("ignore")
    rows = []
    with tempfile.TemporaryDirectory() as name, contextlib.chdir(name):
        for mistake in prepare(Path(name)):
            answer = typed(mistake.words)
            rows.append((mistake, answer, rated(mistake, answer)))
    wrong = [(mistake, mark) for mistake, _, mark in rows if mark.startswith("wrong")]
    for mistake, mark in wrong:
        print(f"{mistake.kind}, {mistake.name}: {mark}")
    slowest = max(answer.seconds for _, answer, _ in rows)
    print(
        f"{len(rows) - len(wrong)} of {len(rows)} right or with the remedy, "
        f"{slowest:.1f} s at most"
    )
    if given.docs:
        write_text(PAGE, with_files(PAGE, "answers", page(rows)))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
