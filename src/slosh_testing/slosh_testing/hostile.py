"""Malicious names that try to inject text into lines, pages and paths, with checks."""

from __future__ import annotations

from html.parser import HTMLParser

EVIL = "<img src=x onerror=hacked=1>'\"\x1b[31m\nslosh: all is well\u202e\u2028"
FORGED = "slosh: all is well"
CONTROL = set("\x1b\x07\u202e\u2028")


class Page(HTMLParser):
    """Parsed page that shows whether injected elements appear, and its text."""

    def __init__(self) -> None:
        super().__init__()
        self.hacked, self.text = False, ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hacked |= ("src", "x") in attrs or "onerror" in dict(attrs)

    def handle_data(self, data: str) -> None:
        self.text += data


def has_forged_line(text: str) -> bool:
    """Returns whether a name has injected a line into a text."""
    return any(line.lstrip().startswith(FORGED) for line in text.splitlines())


def evil(where: str) -> str:
    """Returns a malicious text: markup, formulas, requests, control characters and a long word."""

    return (
        f'{where}</pre></title></style><script>window.hacked="{where}"</script>'
        f"<img src=http://127.0.0.1:9/{where} onerror=\"window.hacked='{where}'\">"
        f'" onmouseover="window.hacked=1" {{{{7*7}}}} $\\frac{{1}}{{0$ #010101 url(#x)'
        f" \x00\x1b[31m \ud800 \u202e {'W' * 300}"
    )
