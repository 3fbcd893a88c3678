"""What this add-on brings to the core: see slosh_base.addons."""

from __future__ import annotations

from slosh_base.addons import AddOn, Command

_GROUP = "recordings"

ADDON = AddOn(
    commands={
        "report": Command(
            _GROUP,
            "write a signed validation report of a container and a motion, or check one",
            "slosh_fleet.report_command",
        ),
        "ingest": Command(
            _GROUP,
            "add the motions of recordings to a store for queries over months",
            "slosh_fleet.ingest_command",
        ),
        "query": Command(
            _GROUP,
            "query the stored motions by SQL, or write a page about them",
            "slosh_fleet.query_command",
        ),
    }
)
