"""Hides the add-ons from each Python that has this folder in PYTHONPATH, and from its children.

PYTHONPATH=tools/core_alone tools/run COMMAND
"""

from __future__ import annotations

import sys
from pathlib import Path

_ADD_ONS = {path.name for path in (Path(__file__).resolve().parents[2] / "addons").iterdir()}
sys.path[:] = [entry for entry in sys.path if Path(entry).name not in _ADD_ONS]
