"""Formats tables as lines of text."""

from __future__ import annotations

from collections.abc import Sequence

from slosh_base.files.plain_text import plain_line


def aligned(rows: Sequence[Sequence[str]], sides: str) -> list[str]:
    """Formats rows as text lines with aligned columns.

    Args:
        rows: cells, as many in each row; control characters in them are written out.
        sides: '<' or '>' for each column: where its text stands; the last one goes on.
    """
    rows = [[plain_line(text) for text in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = sides.ljust(len(widths), sides[-1])
    return [
        "  ".join(
            f"{text:{side}{width}}" for text, side, width in zip(row, sides, widths, strict=False)
        ).rstrip()
        for row in rows
    ]
