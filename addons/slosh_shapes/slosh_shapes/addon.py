"""What this add-on brings to the core: see slosh_base.addons."""

from __future__ import annotations

from slosh_base.addons import AddOn

ADDON = AddOn(mode_solver="slosh_shapes.solver")
