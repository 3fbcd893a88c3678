"""`slosh store`: lists the bags of a cell's runs, and deletes old ones on request."""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from slosh_bag.errors import SloshBagError
from slosh_bag.store.retention import BagKind, Retention, StoredBag, Surplus, surplus
from slosh_bag.store.stored_bags import delete, stored_bags
from slosh_base.files.plain_text import plain_line
from slosh_bringup.cli.quantities import SIZE
from slosh_bringup.errors import SloshBringupError
from slosh_report.text_table import aligned

EPILOG = """Only bags of runs are shown (RUNS/2026-11-22T10-15-00/bag), and never a running one is
deleted; reports, logs and settings stay. While a cell runs, its recorder does the same by its
parameters store_quota, store_days, store_event_days."""

_LEAST_QUOTA = 1000.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Adds the options of `slosh store` to the argument parser."""
    parser.epilog = EPILOG
    parser.add_argument(
        "runs", nargs="?", type=Path, default=Path("out/cell"),
        help="folder of a cell's runs (default %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--quota", type=SIZE, default=0.0, metavar="SIZE",
        help="largest total size of the bags, such as 20GB (default: no limit); above it "
        "the oldest bags are selected for deletion, event bags last",
    )  # fmt: skip
    parser.add_argument(
        "--days", type=float, default=0.0, metavar="N",
        help="largest age of complete bags [day] (default: no limit)",
    )  # fmt: skip
    parser.add_argument(
        "--event-days", type=float, default=0.0, metavar="N",
        help="largest age of event bags [day] (default: no limit)",
    )  # fmt: skip
    parser.add_argument(
        "--delete", action="store_true",
        help="delete the bags beyond --quota, --days and --event-days (default: only list them)",
    )  # fmt: skip
    parser.add_argument("--json", action="store_true", help="print the bags as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Prints the stored bags; with --delete, deletes those beyond the limits of size and age."""
    quota = arguments.quota
    if not (quota == 0.0 or _LEAST_QUOTA <= quota < math.inf):
        meant = f"; did you mean {quota:g}GB?" if 0.0 < quota < _LEAST_QUOTA else ""
        raise SloshBringupError(f"--quota: {quota:g} bytes is no size of a store{meant}")
    retention = Retention(round(arguments.quota), arguments.days, arguments.event_days)
    now = time.time()
    bags = stored_bags(arguments.runs, now)
    found = surplus(bags, retention, now)
    failures = []
    if arguments.delete:
        for bag in found.bags:
            try:
                delete(bag)
            except SloshBagError as error:
                failures.append(str(error))
    show = as_json if arguments.json else as_text
    print(show(bags, found, arguments.delete))
    for line in failures:
        print(plain_line(f"slosh store: {line}"), file=sys.stderr)
    return int(bool(failures or found.excess))


def as_text(bags: Sequence[StoredBag], found: Surplus, is_deleted: bool) -> str:
    """Formats the stored bags as a text table; marks those beyond the limits of size and age."""
    fate = "deleted" if is_deleted else "would be deleted"
    rows = [("written", "MB", "kind", "", "bag")]
    for bag in bags:
        when = f"{datetime.fromtimestamp(bag.written):%Y-%m-%d %H:%M}"
        done = fate if bag in found.bags else ""
        rows.append((when, f"{1e-6 * bag.size:.1f}", bag.kind.value, done, str(bag.folder)))
    size, gone = (1e-6 * sum(bag.size for bag in part) for part in (bags, found.bags))
    lines = aligned(rows, "<><<<")
    lines.append(
        f"{len(bags)} bags, {size:.1f} MB; {len(found.bags)} of them, {gone:.1f} MB, {fate}"
    )
    if found.excess:
        lines.append(f"the running recording exceeds the quota by {1e-6 * found.excess:.1f} MB")
    return "\n".join(lines)


def as_json(bags: Sequence[StoredBag], found: Surplus, is_deleted: bool) -> str:
    """Formats the stored bags as JSON; times in seconds since 1970 (Unix time), sizes in bytes."""
    rows = [
        {
            "folder": str(bag.folder), "written": bag.written, "size": bag.size,
            "kind": bag.kind.value, "surplus": bag in found.bags,
        }
        for bag in bags
    ]  # fmt: skip
    running = sum(bag.kind is BagKind.RUNNING for bag in bags)
    told = {"bags": rows, "running": running, "deleted": is_deleted, "excess": found.excess}
    return json.dumps(told, indent=1)
