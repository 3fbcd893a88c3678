"""Checks the types of packages, tests, tools and benchmarks in one mypy run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = ("tools", "validation/scenes", "benchmarks", "validation/studies")
TESTS = (
    "*/slosh*/test/*.py",
    "tests/**/*.py",
    *(f"validation/{name}/*.py" for name in ("blind", "long_runs", "peers", "test_peers")),
)


def main() -> int:
    """Runs mypy on all Python code; returns its exit code."""
    roots = sorted(path.parent for path in ROOT.glob("*/slosh*/setup.py"))
    packages = [str(root / root.name) for root in roots]
    # A script finds what lies beside it.
    beside = [ROOT, *(ROOT / name for name in SCRIPTS)]
    scripts = [str(path) for folder in beside[1:] for path in sorted(folder.glob("*.py"))]
    # A package's `test` folder is the module `test`, whichever package: one name, one file.
    tests = [path for folder in TESTS for path in sorted(ROOT.glob(folder))]
    scripts += [str(path) for path in tests if path.name != "conftest.py"]
    environment = {**os.environ, "MYPYPATH": ":".join(map(str, [*beside[1:], *roots, ROOT]))}
    command = [sys.executable, "-m", "mypy", "--explicit-package-bases", *packages, *scripts]
    return subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
