"""A page over many runs' pages: one row each, to be sorted, with a link to the run's own page."""

from slosh_report.index_page.page import MARK, IndexRow, render_index

__all__ = ["MARK", "IndexRow", "render_index"]
