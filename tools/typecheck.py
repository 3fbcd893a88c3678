"""Checks the types of every package, one mypy run with the packages' roots on its path."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    """Runs mypy over src/ and tools/; returns its exit code."""
    roots = sorted(path.parent for path in ROOT.glob("src/*/setup.py"))
    packages = [str(root / root.name) for root in roots]
    environment = {**os.environ, "MYPYPATH": ":".join(map(str, roots))}
    command = [sys.executable, "-m", "mypy", *packages, str(ROOT / "tools/bootstrap.py")]
    return subprocess.run(command, env=environment, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
