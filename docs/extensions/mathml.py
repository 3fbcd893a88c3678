"""Formulae as MathML, written when the pages are built: no script, no address outside."""

from __future__ import annotations

from html import escape
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.nodes import get_node_line


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the renderer `mathml` for HTML."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(_mathml(node, "inline"))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f'<div class="math">{_mathml(node, "block")}</div>\n')
    raise nodes.SkipNode


def _mathml(node: nodes.Element, display: str) -> str:
    """The formula, with its LaTeX for those who copy it or hear it.

    Raises:
        ValueError: a command that is not known; the build ends with page, line and formula.
    """
    latex = node.astext()
    text = str(convert(latex, display=display))
    if "\\" in text:
        place = f"{node.source}:{get_node_line(node)}"
        raise ValueError(f"{place}: a command in {latex!r} has no MathML")
    return text.replace("<math ", f'<math aria-label="{escape(latex)}" ', 1)
