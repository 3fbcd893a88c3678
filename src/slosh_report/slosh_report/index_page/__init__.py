"""A sortable index page over many runs, with links to their pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from urllib.parse import quote

from jinja2 import Template

from slosh_report.json_values import plain
from slosh_report.page.template import make_environment, script
from slosh_report.run_report.rows import RunVerdict

__all__ = ["MARK", "IndexRow", "render_index"]

MARK = '<meta name="generator" content="slosh index">'
"""What an index holds and nothing else does: who finds it may replace the file."""
NAN = float("nan")
_FOLDER = "slosh_report.index_page"


@dataclass(frozen=True, slots=True)
class IndexRow:
    """Row of the index with the main results of one run.

    Attributes:
        name: of the run; its page is NAME.html beside the index.
        verdict: what its checks came to; None: it could not be replayed.
        model: the one that MAE and ε are of.
        sigma: mean absolute error [m]; NaN: unknown.
        epsilon: relative error of the maximum [1]; NaN: unknown.
        peak: greatest measured height [m]; NaN: none is known.
        images, events, dropped: numbers of each.
        estimates: how recorded and replayed estimates compare, in words.
        reason: why it could not be replayed or what failed first; may be empty.
    """

    name: str
    verdict: RunVerdict | None
    model: str = ""
    sigma: float = NAN
    epsilon: float = NAN
    peak: float = NAN
    images: int = 0
    events: int = 0
    dropped: int = 0
    estimates: str = ""
    reason: str = ""

    @property
    def link(self) -> str:
        """Relative link from the index to the run's page."""
        return f"{quote(self.name)}.html"


def render_index(title: str, rows: Sequence[IndexRow]) -> str:
    """Renders an index page of runs as HTML.

    Args:
        title: heading.
        rows: in the order in which they are shown until somebody sorts them.
    """
    document = [{**plain(row), "link": row.link} for row in rows]
    failed = sum(row.verdict in (None, RunVerdict.FAILED) for row in rows)
    return _template().render(
        title=title,
        rows=document,
        failed=failed,
        mark=MARK,
        scripts=[script("slosh_report.page", "sort.js")],
    )


@cache
def _template() -> Template:
    return make_environment(_FOLDER).get_template("index.html.j2")
