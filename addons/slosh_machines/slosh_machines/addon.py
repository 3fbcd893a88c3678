"""What this add-on brings to the core: see slosh_base.addons."""

from __future__ import annotations

from slosh_base.addons import AddOn, Command

ADDON = AddOn(
    commands={
        "motion-map": Command(
            "motions",
            "find the stroke with the lowest waves for each speed of a machine",
            "slosh_machines.map_command",
        )
    }
)
