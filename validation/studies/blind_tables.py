"""Scores the discovery on synthetic cases; fills docs/results/discovery_scores.md.

    tools/run python validation/studies/blind_tables.py --kind all --count 44 --seed 1 --docs

Every answer is kept as a line of JSON in the folder; what is there is not run again,
so a run that was ended goes on where it was. A case hides one listed effect (`single`), two
(`pairs`), none (`none`), one that is not in the list (`outside`), or one beside a wrong parameter
of the base (`wrong_parameter`). With --dirty the same cases have a real sensor's errors, with
--noisy a real accelerometer's.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

from result_tables import fill  # noqa: E402

from validation.blind.cases import KINDS, case_name  # noqa: E402
from validation.blind.dirt import DIRT, Dirt, noisy_inputs  # noqa: E402
from validation.blind.score import Row, judge, run_case  # noqa: E402
from validation.blind.tables import TABLES, share  # noqa: E402

PAGE = ROOT / "docs" / "results" / "discovery_scores.md"
Job = tuple[str, int, int, str | None, Dirt | None]


def main() -> int:
    """Runs missing cases and prints the tables; writes the page if requested."""
    options = _options()
    suite = "dirty" if options.dirty else "noisy" if options.noisy else ""
    folder = Path(options.folder or ROOT / "out" / f"blind_{suite}".rstrip("_"))
    folder.mkdir(parents=True, exist_ok=True)
    kinds = KINDS if options.kind == "all" else (options.kind,)
    jobs: list[Job] = [
        (kind, index, options.seed, options.effect, dirt_of(suite, index))
        for index in range(options.first, options.first + options.count)
        for kind in kinds
    ]
    done = read_rows(folder)
    left = [job for job in jobs if case_name(*job) not in done]
    print(f"{len(jobs)} cases, {len(jobs) - len(left)} of them known", flush=True)
    run_jobs(left, folder, options.processes)
    everything = read_rows(folder)
    rows = list(everything.values())
    if not options.docs:
        rows = [everything[case_name(*job)] for job in jobs if case_name(*job) in everything]
    for title, make in TABLES.items():
        print(f"\n{title}\n\n{make(rows)}")
    if options.docs:
        write_page(rows, f"{suite} ".lstrip())
    return 0


def dirt_of(suite: str, index: int) -> Dirt | None:
    """Returns the errors of a case in a suite; None for white noise of the heights only."""
    if suite == "noisy":
        return noisy_inputs(index)
    return DIRT if suite == "dirty" else None


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kind", choices=(*KINDS, "all"), default="all")
    parser.add_argument("--count", type=int, default=22, help="number of cases of each kind")
    parser.add_argument("--first", type=int, default=0, help="index of the first case")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--effect", help="effect that is hidden in every case")
    parser.add_argument("--dirty", action="store_true", help="add errors of real sensors")
    parser.add_argument("--noisy", action="store_true", help="add an accelerometer's noise")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--folder", help="folder of the results (default: out/blind…)")
    parser.add_argument("--docs", action="store_true", help="write the tables in docs/")
    return parser.parse_args()


def read_rows(folder: Path) -> dict[str, Row]:
    """Reads the stored results by case and judges them again; skips incomplete lines."""
    rows: dict[str, Row] = {}
    for path in sorted(folder.glob("*.jsonl")):
        for line in path.read_text().splitlines():
            try:
                row = json.loads(line)
            except json.JSONDecodeError:
                continue
            rows[row["case"]] = judge(row)
    return rows


def run_jobs(jobs: list[Job], folder: Path, processes: int) -> None:
    """Runs cases in parallel and stores each result as soon as it is available."""
    if not jobs:
        return
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, context, _start) as pool:
        waiting = {pool.submit(_one, job): job for job in jobs}
        for number, future in enumerate(as_completed(waiting), 1):
            job = waiting[future]
            try:
                row = future.result()
            except RuntimeError as error:  # the generator finds no such case: one less
                print(f"{number}/{len(jobs)} left out: {error}", flush=True)
                continue
            with (folder / f"{job[0]}-{job[2]}.jsonl").open("a") as file:
                file.write(json.dumps(row) + "\n")
            print(f"{number}/{len(jobs)} {_line(row)}", flush=True)


def _start() -> None:
    """Lowers the priority of a worker process."""
    os.nice(10)


def _one(job: Job) -> Row:
    from slosh_discovery.discover.workflow import discover

    return run_case(discover, *job)


def _line(row: Row) -> str:
    said = ", ".join(
        " or ".join([effect["name"], *effect["alternatives"]]) + f" {effect['confidence']:.2f}"
        for effect in row["found"]
    )
    mark = "right" if row["right"] else "WRONG"
    weak = "" if row["counts"] else " (weak)"
    hidden = " + ".join(row["hidden"]) or "nothing"
    answer = f"{row['verdict']} {said}{row['error']}"
    return f"{mark}{weak} {row['case']} {row['base']}: {hidden} -> {answer} {row['seconds']:.0f} s"


def write_page(rows: list[Row], prefix: str = "") -> None:
    """Fills the tables of the results page; the text around them stays.

    Args:
        rows: what was answered.
        prefix: of the tables' names; those that the page does not have are left out.
    """
    text = PAGE.read_text(encoding="utf-8")
    for name, make in TABLES.items():
        if f"<!-- table {prefix}{name} -->" in text:
            fill(PAGE, prefix + name, make(rows))
    print(f"{PAGE}: {len(rows)} cases, right in {share(rows, lambda row: bool(row['right']))}")


if __name__ == "__main__":
    sys.exit(main())
