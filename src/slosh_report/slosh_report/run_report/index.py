"""A sortable index page over many runs, with links to their pages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from urllib.parse import quote

from slosh_report.document import Column, Document, Paragraph, numbers, table
from slosh_report.json_values import plain
from slosh_report.run_report.rows import RunVerdict
from slosh_report.texts import Mark, Place, Text

MARK = '<meta name="generator" content="slosh index">'
"""What an index holds and nothing else does: who finds it may replace the file."""
NAN = float("nan")


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


_VERDICTS = {
    RunVerdict.PASSED: "✓ passed",
    RunVerdict.FAILED: "✗ failed",
    RunVerdict.NO_EXPECTATION: "–",
    None: "✗ not replayed",
}


def _name(row: Place) -> Text:
    name = row.data["name"]
    return name if row.data["verdict"] is None else Mark(name, link=row.data["link"])


COLUMNS = (
    Column("run", _name, "name"),
    Column("verdict", lambda row: _VERDICTS[row.data["verdict"]], "verdict"),
    Column("model", lambda row: row.data["model"]),
    numbers("MAE [mm]", "sigma", "mm"),
    numbers("ε [%]", "epsilon", "%"),
    numbers("highest [mm]", "peak", "mm"),
    numbers("events", "events"),
    numbers("images", "images"),
    numbers("dropped", "dropped"),
    Column("estimates", lambda row: row.data["reason"] or row.data["estimates"], "name"),
)


def index_document(title: str, rows: Sequence[IndexRow]) -> Document:
    """Returns a sortable table of runs with links to their pages.

    Args:
        title: heading.
        rows: in the order in which they are shown until somebody sorts them.
    """
    data = Place({"rows": [{**plain(row), "link": row.link} for row in rows]})
    failed = sum(row.verdict in (None, RunVerdict.FAILED) for row in rows)
    told = (", ", Mark(f"{failed} failed", "b failed")) if failed else ""
    count = (f"{len(rows)} runs", told, ". Click a column’s heading to sort by it.")
    caption = "One row for each run, with a link to its page"
    runs = table(caption, COLUMNS, data["rows"], seen=False, sorts=True, most=len(rows))
    head = (Paragraph(count, "subtitle"), runs)
    return Document(title, head, data=data.data, mark=MARK)
