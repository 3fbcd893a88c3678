"""Tuning numbers of the eigenvalue problems."""

from __future__ import annotations

import math
from dataclasses import dataclass

from slosh_base.tuning import number


@dataclass(frozen=True, slots=True)
class PotentialFlowTuning:
    """Initial mesh sizes of the eigenvalue problems."""

    # finite_elements.py, by axisymmetric.py and plane.py
    change: float = number(1e-5, "1", "relative change of ω by a division that ends them")
    most_divisions: int = number(3, "1", "number of divisions, at most")
    # axisymmetric.py
    surface_parts: float = number(17.0, "1", "first triangles across the surface")
    growth: float = number(0.3, "1", "growth of the size with depth")
    bend: float = number(0.45, "rad", "largest part of a bend along one triangle")
    gap: float = number(0.8, "1", "size per distance from the surface")
    narrowest: float = number(0.25, "1", "smallest size for a narrow gap, of that at the surface")
    sharp_corner: float = number(math.radians(100.0), "rad", "angle of a corner that is graded")
    clear_corner: float = number(math.radians(45.0), "rad", "turn of a full corner")
    at_corner: float = number(0.3, "1", "size at such a corner, of that beside it")
    corner_decade: float = number(math.radians(80.0), "rad", "angle that makes it ten times finer")
    deep_bend: float = number(0.12, "1", "size that a bend may have in any case, per depth")
    fading: float = number(1.8, "1/R", "fading of a wave with depth, for corners far below")
    core: float = number(0.5, "1", "size at a core, per distance from the axis")
    # trough.py
    wave_part: float = number(2.0, "rad", "largest part of a wave along a trough, one triangle")
    most_parts: float = number(24.0, "1", "first triangles across half of a surface, at most")
    # plane.py
    outline_parts: float = number(15.0, "1", "first triangles across an outline")
    narrow_parts: float = number(10.0, "1", "and across its narrower extent")
    whole: float = number(1.4, "1", "first size over a whole outline, of that over a part")
    most_slender: float = number(12.0, "1", "largest ratio of an outline's length to its width")
    asymmetry: float = number(1e-4, "1", "distance of a symmetric outline from its mirror image")
    on_axis: float = number(1e-3, "1", "longest part of an outline that counts as on an axis")


TUNING = PotentialFlowTuning()
