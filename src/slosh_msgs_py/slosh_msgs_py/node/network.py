"""Restricts DDS communication to this machine by default.

ROS's own LOCALHOST keeps a node from looking for others beyond this machine, but its sockets are
open on every network, and whoever knows the address is answered. With the profile
`profiles/this_machine.xml` Fast DDS has sockets on the loopback interface only. On one machine
large messages go through shared memory, with either profile.

Shared memory does not work between users or containers: a node there is discovered, but its
messages do not arrive. With FASTDDS_BUILTIN_TRANSPORTS=UDPv4 the profile `this_machine_udp.xml`
goes without. rmw_fastrtps ignores that variable with the range LOCALHOST, and adds shared memory
by itself; so the range is SUBNET then, and the profile keeps to the loopback interface.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTDDS_DEFAULT_PROFILES_FILE", "FASTRTPS_DEFAULT_PROFILES_FILE")
"""Fast DDS's variable, and its name in older versions."""
TRANSPORTS = "FASTDDS_BUILTIN_TRANSPORTS"
WITHOUT_SHARED_MEMORY = "UDPv4"
ALONE = ("LOCALHOST", "OFF")
_FOLDER = Path(__file__).parent / "profiles"
_UDP = str(_FOLDER / "this_machine_udp.xml")


def network_environment(given: Mapping[str, str]) -> dict[str, str]:
    """Returns environment variables that restrict ROS to this machine, unless set otherwise.

    Args:
        given: the process's environment; what it sets stays.
    """
    reach = given.get(RANGE) or "LOCALHOST"
    profile = str(_FOLDER / ("this_machine.xml" if reach in ALONE else "network.xml"))
    if not has_shared_memory(given) and not any(given.get(name) for name in PROFILES):
        if reach not in ALONE:
            return {RANGE: reach}  # Fast DDS reads the variable itself
        reach, profile = "SUBNET" if reach == "LOCALHOST" else reach, _UDP
    return {RANGE: reach, **{variable: given.get(variable) or profile for variable in PROFILES}}


def has_shared_memory(given: Mapping[str, str]) -> bool:
    """Returns whether nodes with these environment variables send through shared memory."""
    return given.get(TRANSPORTS) != WITHOUT_SHARED_MEMORY


def is_local(given: Mapping[str, str]) -> bool:
    """Returns whether nodes with these environment variables reach this machine only."""
    found = {**given, **network_environment(given)}
    return found[RANGE] in ALONE or found.get(PROFILES[0]) == _UDP


def bound() -> None:
    """Restricts this process to local communication, before ROS is started."""
    os.environ.update(network_environment(os.environ))
