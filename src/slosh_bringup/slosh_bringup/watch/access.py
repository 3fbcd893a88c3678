"""Access rules of the operator's page, which keep other web sites' scripts out.

A page of a stranger must get nothing, whatever name its server has taken on: a request names the
host that its sender believes to speak to (against DNS rebinding) and, from within a page, that
page's origin. Where other machines are served, a token in the address is asked for, too.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import parse_qs

LOOPBACK = ("127.0.0.1", "::1", "localhost")
TOKEN = "token"
HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}
"""Of each answer: the page runs what this server sends and nothing else, and nobody frames it."""


@dataclass(frozen=True, slots=True)
class Access:
    """Access rules of one web server.

    Attributes:
        host: the address on which it listens.
        port: its port.
        token: what an address must hold; empty: nothing.
    """

    host: str
    port: int
    token: str = ""

    @property
    def url(self) -> str:
        """Address of the web page, with the access token if there is one."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        name = socket.gethostname() if self.host in ("0.0.0.0", "::") else host
        return f"http://{name}:{self.port}/" + (f"?{TOKEN}={self.token}" if self.token else "")

    def refusal(self, headers: Mapping[str, str], query: str, *, data: bool) -> str:
        """Returns why a request is refused, or an empty text if it is allowed.

        Args:
            headers: of the request, their names in lower case.
            query: what follows the question mark of its address.
            data: it asks for more than the page's own files, which hold nothing of a cell.
        """
        host = headers.get("host", "").lower()
        if not self._is_named(host):
            return f"unknown host name: {host[:100]!r}"
        origin = headers.get("origin")
        if origin is not None and origin.lower() != f"http://{host}":
            return "requests from other origins are refused"
        if data and not _is_own_or_link(headers):
            return "requests from other sites are refused"
        if data and self.token:
            given = parse_qs(query).get(TOKEN, [""])[0]
            if not hmac.compare_digest(given.encode(), self.token.encode()):
                return "the URL lacks the token that was printed when the page was started"
        return ""

    def _is_named(self, host: str) -> bool:
        name, _, port = host.rpartition(":") if not host.endswith("]") else (host, "", "")
        if not name:
            name, port = port, ""
        if (port or "80") != str(self.port):
            return False
        name = name.strip("[]")
        if self.host in LOOPBACK:
            return name in LOOPBACK
        return name in _own_names() or _is_address(name)


def _is_own_or_link(headers: Mapping[str, str]) -> bool:
    """Whether a request comes from the watch page itself, or from a link on the same host."""
    site = headers.get("sec-fetch-site", "none")
    followed = headers.get("sec-fetch-mode") == "navigate"
    return site in ("none", "same-origin") or (site == "same-site" and followed)


def new_access(host: str, port: int) -> Access:
    """Creates the access rules, with a new token if other hosts can reach the server."""
    return Access(host, port, "" if host in LOOPBACK else secrets.token_urlsafe(16))


def _own_names() -> tuple[str, ...]:
    name = socket.gethostname().lower()
    return ("localhost", name, f"{name}.local")


def _is_address(name: str) -> bool:
    """Whether a host name is a numeric address, which DNS cannot redirect."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True
