"""Finds a DDS domain id that no other process on this machine uses.

A demonstration, a recording, a test must not hear the one beside it. What is claimed is a name
in the kernel: two processes cannot hold it, and it is free when its holder has ended, however.
"""

from __future__ import annotations

import errno
import hashlib
import os
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from slosh_msgs_py.errors import SloshMessageError

DOMAINS = range(1, 102)
"""0 is everybody's default; above 101 the ports run into those that the system gives away."""
_FIRST_PORT, _PORTS = 7400, 250
"""RTPS: the ports of domain d are 7400 + 250 d and those up to the next domain's."""


@contextmanager
def own_domain(first: int | None = None) -> Iterator[int]:
    """Reserves an unused DDS domain id within a `with` block.

    Args:
        first: the number, modulo how many there are, from which a free one is looked for; None:
            the process's own.

    Yields:
        its number, for ROS_DOMAIN_ID; no other process has claimed it, and none speaks in it.

    Raises:
        SloshMessageError: all are taken.
    """
    spoken = spoken_domains()
    start = (os.getpid() if first is None else first) % len(DOMAINS)
    for number in (*DOMAINS[start:], *DOMAINS[:start]):
        # An abstract address: seen by whoever can be heard, a container's network or the machine.
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
            if number not in spoken and _bound(claim, f"\0slosh_domain_{number}"):
                yield number
                return
    raise SloshMessageError(
        f"no DDS domain from {DOMAINS[0]} to {DOMAINS[-1]} is free on this machine: stop "
        "another run, or set ROS_DOMAIN_ID to share its domain"
    )


@contextmanager
def claimed_namespace(domain: int, namespace: str) -> Iterator[bool]:
    """Reserves a cell's namespace within a `with` block; yields whether it was free.

    Args:
        domain: DDS domain.
        namespace: of the cell.

    Yields:
        whether it is this process's own: no other run of this machine has claimed it.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
        # An address has 107 bytes: of a long namespace the digest.
        name = hashlib.sha256(namespace.encode()).hexdigest()[:16]
        yield _bound(claim, f"\0slosh_cell_{domain}_{name}")


def _bound(claim: socket.socket, address: str) -> bool:
    try:
        claim.bind(address)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise
        return False
    return True


def spoken_domains(table: Path = Path("/proc/net/udp")) -> set[int]:
    """Returns the DDS domain ids that processes of this machine use.

    Args:
        table: the kernel's list of UDP sockets; where there is none, nothing is known.
    """
    try:
        lines = table.read_text().splitlines()[1:]
    except OSError:
        return set()
    ports = (int(line.split()[1].rpartition(":")[2], 16) for line in lines)
    return {(port - _FIRST_PORT) // _PORTS for port in ports} & {*DOMAINS}
