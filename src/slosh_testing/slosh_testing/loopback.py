"""Finds the network sockets of processes in /proc."""

from __future__ import annotations

import contextlib
import ipaddress
import os
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

_TABLES = ("tcp", "tcp6", "udp", "udp6")
_WORD = 8
"""Hexadecimal digits of 4 bytes, which /proc shows in the machine's own order."""


class Socket(NamedTuple):
    """An open socket of this machine: protocol (such as tcp or udp6), local address and port."""

    table: str
    address: ipaddress.IPv4Address | ipaddress.IPv6Address
    port: int

    @property
    def is_loopback(self) -> bool:
        """Whether the socket can only be reached from this machine."""
        mapped = getattr(self.address, "ipv4_mapped", None)
        return (mapped or self.address).is_loopback


def sockets(pid: int) -> list[Socket]:
    """Returns the network sockets of a process."""
    held = _held(pid)
    found = []
    for table in _TABLES:
        found += [_socket(table, line) for line in _lines(pid, table) if line.split()[9] in held]
    return found


def waiting_bytes(pid: int, table: str, port: int) -> int:
    """Returns the number of bytes that wait to be read at a socket of a process."""
    held = _held(pid)
    waiting = [
        int(line.split()[4].partition(":")[2], 16)
        for line in _lines(pid, table)
        if line.split()[9] in held and _socket(table, line).port == port
    ]
    return max(waiting, default=0)


def descendants(pids: Iterable[int]) -> Iterator[int]:
    """Yields the ids of processes and of all their descendants."""
    for pid in pids:
        yield pid
        with contextlib.suppress(OSError):
            for task in Path(f"/proc/{pid}/task").iterdir():
                yield from descendants(map(int, (task / "children").read_text().split()))


def _held(pid: int) -> set[str]:
    """Returns the inode numbers of a process's sockets."""
    matches = map(re.compile(r"socket:\[(\d+)\]").match, _open_files(pid))
    return {match[1] for match in matches if match}


def _lines(pid: int, table: str) -> list[str]:
    with contextlib.suppress(OSError):
        return Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]
    return []


def _open_files(pid: int) -> Iterator[str]:
    with contextlib.suppress(OSError):
        for entry in Path(f"/proc/{pid}/fd").iterdir():
            with contextlib.suppress(OSError):
                yield os.readlink(entry)


def _socket(table: str, line: str) -> Socket:
    digits, port = line.split()[1].split(":")
    words = [digits[at : at + _WORD] for at in range(0, len(digits), _WORD)]
    raw = b"".join(bytes.fromhex(word)[::-1] for word in words)
    return Socket(table, ipaddress.ip_address(raw), int(port, 16))
