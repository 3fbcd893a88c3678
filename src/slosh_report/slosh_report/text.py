"""Prints a document as text or JSON, and writes it to files."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from slosh_base.files import write_text
from slosh_base.files.plain_text import plain_lines
from slosh_report.document import Block, Code, Document, Facts, Lines, Paragraph, Table
from slosh_report.json_values import plain
from slosh_report.text_table import aligned
from slosh_report.texts import words


def document_text(document: Document) -> str:
    """Returns the brief blocks of a document as lines of text, parted by empty lines."""
    return blocks_text(document.brief)


def blocks_text(blocks: Sequence[Block]) -> str:
    """Returns blocks as lines of text; control characters are written out."""
    found = ("\n".join(_lines(block)) for block in blocks)
    return "\n\n".join(text for text in found if text)


def _lines(block: Block) -> Iterator[str]:
    if isinstance(block, Table):
        block = block.shown("text")
        rows = [[words(cell) for cell in row] for row in block.rows]
        heads = [[words(column.head) for column in block.columns]]
        sides = "".join(">" if column.kind == "n" else "<" for column in block.columns)
        if rows:
            yield from aligned((heads if any(heads[0]) else []) + rows, sides)
    elif isinstance(block, Lines):
        yield from (_line(words(line)) for line in block.lines)
    elif isinstance(block, Facts):
        yield from aligned([[words(label), words(text)] for label, text in block.rows], "<<")
    elif isinstance(block, Paragraph):
        yield _line(words(block.text))
    elif isinstance(block, Code):
        yield from map(_line, words(block.text).splitlines())


def _line(text: str) -> str:
    """Returns a text as one line, however long it is."""
    return plain_lines(text.replace("\n", "\\n"))


def json_text(data: Any) -> str:
    """Returns data as strict JSON, identical for identical data; what is not known is null."""
    return json.dumps(plain(data), indent=2, allow_nan=False) + "\n"


def printed(document: Document, as_json: bool) -> str:
    """Returns what a command prints: a document's short text, or its data."""
    return json_text(document.data) if as_json else document_text(document) + "\n"


def write_document(page: Path, document: Document, data: Path | None = None) -> None:
    """Writes a document as a page, and its data as JSON if a file for them is given.

    Raises:
        OSError: a file cannot be written; what was there is as it was.
    """
    from slosh_report.page.html import html_page  # it loads the templates

    write_text(page, html_page(document))
    if data is not None:
        write_text(data, json_text(document.data))
