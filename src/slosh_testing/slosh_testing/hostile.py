"""Names that would write lines, pages and paths of their own, and whether one has."""

from __future__ import annotations

from html.parser import HTMLParser

EVIL = "<img src=x onerror=hacked=1>'\"\x1b[31m\nslosh: all is well\u202e\u2028"
FORGED = "slosh: all is well"
CONTROL = set("\x1b\x07\u202e\u2028")


class Page(HTMLParser):
    """Whether an element of a page is a stranger's, and all its text."""

    def __init__(self) -> None:
        super().__init__()
        self.hacked, self.text = False, ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.hacked |= ("src", "x") in attrs or "onerror" in dict(attrs)

    def handle_data(self, data: str) -> None:
        self.text += data


def has_forged_line(text: str) -> bool:
    """Whether a line of what was said is a name's own."""
    return any(line.lstrip().startswith(FORGED) for line in text.splitlines())
