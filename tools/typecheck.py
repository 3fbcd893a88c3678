"""Checks the types of every package, one mypy run with the packages' roots on its path."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCRIPTS = ("tools", "tools/scenes", "tools/packaging", "benchmarks")


def main() -> int:
    """Runs mypy over the packages, tools and benchmarks; returns its exit code."""
    roots = sorted(path.parent for path in ROOT.glob("src/*/setup.py"))
    packages = [str(root / root.name) for root in roots]
    # A script finds what lies beside it.
    beside = [ROOT, *(ROOT / name for name in SCRIPTS)]
    scripts = [str(path) for folder in beside[1:] for path in sorted(folder.glob("*.py"))]
    environment = {**os.environ, "MYPYPATH": ":".join(map(str, [*beside[1:], *roots, ROOT]))}
    command = [sys.executable, "-m", "mypy", "--explicit-package-bases", *packages, *scripts]
    return subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
