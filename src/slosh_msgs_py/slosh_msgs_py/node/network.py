"""Restricts DDS communication to this machine by default.

ROS's own LOCALHOST keeps a node from looking for others beyond this machine, but its sockets are
open on every network, and whoever knows the address is answered. With the profile
`profiles/this_machine.xml` Fast DDS has sockets on the loopback interface only. On one machine
large messages go through shared memory, with either profile.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
"""Fast DDS's variable, and its name in older versions."""
ALONE = ("LOCALHOST", "OFF")


def network_environment(given: Mapping[str, str]) -> dict[str, str]:
    """Returns environment variables that restrict ROS to this machine, unless set otherwise.

    Args:
        given: the process's environment; what it sets stays.
    """
    reach = given.get(RANGE) or "LOCALHOST"
    name = "this_machine.xml" if reach in ALONE else "network.xml"
    profile = str(Path(__file__).parent / "profiles" / name)
    return {RANGE: reach, **{variable: given.get(variable) or profile for variable in PROFILES}}


def bound() -> None:
    """Restricts this process to local communication, before ROS is started."""
    os.environ.update(network_environment(os.environ))
