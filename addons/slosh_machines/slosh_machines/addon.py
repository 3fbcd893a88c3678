"""What this add-on brings to the `slosh` command: see slosh_bringup.addons."""

from __future__ import annotations

from slosh_bringup.addons import AddOn, Command

ADDON = AddOn(
    commands={
        "motion-map": Command(
            "motions",
            "find the stroke with the lowest waves for each speed of a machine",
            "slosh_machines.map_command",
        )
    }
)
