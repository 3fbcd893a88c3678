"""Whether modes of containers without closed forms can be computed here."""

import pytest

from slosh_model.shapes.solved import installed_solver

_solver = installed_solver()
needs_solver = pytest.mark.skipif(
    _solver is None or not _solver.available(),
    reason="no add-on slosh_shapes with scikit-fem (requirements/modes.txt)",
)
"""Skips a test where they cannot."""
