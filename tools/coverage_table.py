"""Measures the line coverage of the quick tests and writes docs/results/coverage.md.

    make coverage
    tools/run python tools/coverage_table.py [PYTEST ARGUMENT ...]

With arguments of pytest it measures those tests alone and prints the table. Every line costs time
to note, so `tests/real_time` is left out, and all takes longer than `make test`. Compiled
functions run as machine code, where no line is seen: they are left out. Processes that a test
kills take what they ran with them.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

from result_tables import with_files

ROOT = Path(__file__).resolve().parent.parent
WORK = ROOT / "out" / "coverage"
PAGE = ROOT / "docs" / "results" / "coverage.md"
QUICK = (
    "-m",
    "not long",
    "-n",
    "logical",
    "--no-loadscope-reorder",
    "--ignore=tests/real_time",
    "tests",
)
HEAD = """# Test coverage

Line coverage of each package by `make test`, without `tests/real_time`, including the processes
that the tests start. `make coverage` writes the table. Compiled functions are excluded, because
coverage does not see machine code. Lines run by a process that a test kills are not counted.

"""


def main(arguments: list[str]) -> int:
    """Measures the coverage, then prints or writes the table; returns the tests' exit code."""
    shutil.rmtree(WORK, ignore_errors=True)
    WORK.mkdir(parents=True)
    folders = [str(path.relative_to(ROOT)) for path in sorted(ROOT.glob("*/slosh*/test"))]
    tests = _coverage("run", "-m", "pytest", *(arguments or [*QUICK, *folders]))
    _coverage("combine", "--quiet")
    _coverage("json", "--quiet", "-o", str(WORK / "coverage.json"))
    report = json.loads((WORK / "coverage.json").read_text(encoding="utf-8"))
    text = table(report["files"])
    print(text)
    if not arguments and tests == 0:
        PAGE.write_text(with_files(PAGE, "", HEAD + text), encoding="utf-8")
    return tests


def _coverage(*words: str) -> int:
    # An absolute name: processes that tests start work elsewhere.
    environment = {**os.environ, "COVERAGE_FILE": str(WORK / "data")}
    command = [sys.executable, "-m", "coverage", *words]
    return subprocess.run(command, cwd=ROOT, env=environment, check=False).returncode


def table(files: dict[str, dict[str, dict[str, int]]]) -> str:
    """Formats line counts, executed lines and their share by package as a Markdown table.

    Args:
        files: `files` of coverage's JSON report, by path.
    """
    lines: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for path, entry in files.items():
        if not path.startswith(("src/", "addons/")):  # a copy that a test damages and runs
            continue
        package = Path(path).parts[1]
        for name in (package, "all"):
            lines[name][0] += entry["summary"]["num_statements"]
            lines[name][1] += entry["summary"]["covered_lines"]
    rows = [
        f"| {name} | {all_} | {ran} | {_part(ran, all_)} |" for name, (all_, ran) in lines.items()
    ]
    rows.sort(key=lambda row: (row.startswith("| all "), row))
    return "\n".join(["| package | lines | run | |", "|---|---|---|---|", *rows]) + "\n"


def _part(ran: int, lines: int) -> str:
    return f"{100.0 * ran / lines:.1f} %" if lines else ""


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
