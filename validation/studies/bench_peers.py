"""Runs other methods and the discovery on the same test cases; writes docs/results/peers.md.

    tools/run pip install -r requirements/peers.txt
    tools/run python validation/studies/bench_peers.py --docs

Every answer is kept as a line of JSON in out/peers; what is there is not asked again, so that a
run that was ended goes on where it was. Without what requirements/peers.txt lists it says so and
ends.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tools")]

PAGE = ROOT / "docs" / "results" / "peers.md"
NEEDED = ("pysindy", "cvxpy", "jax")


def main() -> int:
    """Runs missing cases and prints the tables; writes the page if requested."""
    options = _options()
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        print(f"bench_peers: left out, {', '.join(missing)} missing (requirements/peers.txt)")
        return 0
    # The methods are compared by what they say, not by their threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    os.nice(10)
    from result_tables import fill

    from validation.peers.run import known, run
    from validation.peers.tables import TABLES

    folder = ROOT / "out" / "peers"
    if not options.known:
        run(folder, options.rounds, options.networks)
    answers = known(folder)
    for title, make in TABLES.items():
        print(f"\n{title}\n\n{make(answers)}")
    if options.docs:
        for title, make in TABLES.items():
            fill(PAGE, title, make(answers))
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--rounds", type=int, default=3, help="rounds of 13 effects and 3 empty cases"
    )
    parser.add_argument("--networks", type=int, default=13, help="number of cases for the network")
    parser.add_argument("--known", action="store_true", help="only print stored results")
    parser.add_argument("--docs", action="store_true", help="write docs/results/peers.md")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
