"""Creates a true-to-scale page with a calibration board for printing, as SVG or PDF."""

from __future__ import annotations

from dataclasses import dataclass

from slosh_camera.calibrate.aruco import markers_of
from slosh_camera.calibrate.board import Board
from slosh_camera.errors import SloshCameraError
from slosh_camera.intrinsics.views import Chessboard, Target

Box = tuple[float, float, float, float]
"""Left, top, width and height [mm]."""

# Sheets of ISO 216 [mm]; what no printer prints at their edges.
_SHEETS = ((210.0, 297.0), (297.0, 420.0), (420.0, 594.0), (594.0, 841.0), (841.0, 1189.0))
_EDGE = 8.0
_CAPTION, _LETTERS, _RULE = 14.0, 3.5, 50.0
_POINTS = 72.0 / 25.4


@dataclass(frozen=True, slots=True)
class Sheet:
    """A printable page with a calibration board: paper size and drawing.

    Attributes:
        width: of the page [mm].
        height: of the page [mm].
        black: what is black.
        caption: a line of text below the board, and its place (left, base line) [mm].
        place: of the caption.
    """

    width: float
    height: float
    black: tuple[Box, ...]
    caption: str
    place: tuple[float, float]


def sheet_of(target: Target) -> Sheet:
    """Creates the page of a calibration board on the smallest paper, from A4, that fits.

    A line of 50 mm below the board tells whether the printer kept the scale.

    Raises:
        SloshCameraError: it is larger than A0, or OpenCV does not know its markers.
    """
    boxes, width, height = (
        _chessboard(target) if isinstance(target, Chessboard) else _markers(target)
    )
    # White all around belongs to the board: without it the outer squares are not found.
    rim = max(_EDGE, 0.5e3 * (target.square if isinstance(target, Chessboard) else target.inner))
    needed = (max(width, 2.0 * _RULE) + 2.0 * rim, height + 2.0 * rim + _CAPTION)
    page = _page(*needed)
    left = 0.5 * (page[0] - width)
    top = 0.5 * (page[1] - height - _CAPTION)
    below = top + height + 0.7 * rim + _LETTERS
    rule_left = left + 0.5 * (width - 2.0 * _RULE)
    moved = [(left + x, top + y, w, h) for x, y, w, h in boxes]
    rule = (rule_left, below + 0.7 * _LETTERS, _RULE, 0.4)
    caption = f"{_words(target)}; the line is {_RULE:.0f} mm long"
    return Sheet(*page, (*moved, rule), caption, (rule_left, below))


def as_svg(sheet: Sheet) -> str:
    """Formats the printable page of a calibration board as SVG in millimetres."""
    boxes = "".join(f"M{x:.4f} {y:.4f}h{w:.4f}v{h:.4f}h{-w:.4f}z" for x, y, w, h in sheet.black)
    x, y = sheet.place
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{sheet.width:g}mm" '
        f'height="{sheet.height:g}mm" viewBox="0 0 {sheet.width:g} {sheet.height:g}">\n'
        '<rect width="100%" height="100%" fill="white"/>\n'
        f'<path fill="black" d="{boxes}"/>\n'
        f'<text x="{x:.2f}" y="{y:.2f}" font-family="Helvetica, sans-serif" '
        f'font-size="{_LETTERS}">{sheet.caption}</text>\n</svg>\n'
    )


def as_pdf(sheet: Sheet) -> bytes:
    """Formats the printable page of a calibration board as PDF 1.4 in its true size."""
    scale, top = _POINTS, sheet.height
    boxes = "\n".join(
        f"{scale * x:.4f} {scale * (top - y - h):.4f} {scale * w:.4f} {scale * h:.4f} re"
        for x, y, w, h in sheet.black
    )
    x, y = sheet.place
    text = (
        f"BT /F1 {scale * _LETTERS:.2f} Tf {scale * x:.2f} {scale * (top - y):.2f} Td "
        f"({sheet.caption}) Tj ET"
    )
    content = f"0 g\n{boxes}\nf\n{text}\n"
    size = f"[0 0 {scale * sheet.width:.4f} {scale * sheet.height:.4f}]"
    return _pdf(
        [
            "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
            "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
            f"<< /Type /Page /Parent 2 0 R /MediaBox {size} /Contents 4 0 R "
            "/Resources << /Font << /F1 5 0 R >> >> >>",
            f"<< /Length {len(content)} >>\nstream\n{content}endstream",
            "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>",
        ]
    )


def _pdf(objects: list[str]) -> bytes:
    """Formats a PDF file from numbered objects; the first one is the catalogue."""
    text, places = "%PDF-1.4\n", []
    for number, content in enumerate(objects, start=1):
        places.append(len(text))
        text += f"{number} 0 obj\n{content}\nendobj\n"
    start = len(text)
    rows = "".join(f"{place:010d} 00000 n \n" for place in places)
    text += f"xref\n0 {len(objects) + 1}\n0000000000 65535 f \n{rows}"
    text += f"trailer\n<< /Size {len(objects) + 1} /Root 1 0 R >>\nstartxref\n{start}\n%%EOF\n"
    return text.encode("ascii")


def _page(width: float, height: float) -> tuple[float, float]:
    for short, long in _SHEETS:
        for page in ((short, long), (long, short)):
            if width <= page[0] and height <= page[1]:
                return page
    raise SloshCameraError(
        f"board: needs a sheet of {width:.0f} x {height:.0f} mm, larger than A0; are its lengths "
        "in m?"
    )


def _words(target: Target) -> str:
    if isinstance(target, Chessboard):
        return f"{target.columns}x{target.rows} inner corners, squares {1e3 * target.square:g} mm"
    kind, name, gap = (
        ("charuco", "squares", "markers") if target.charuco else ("aruco", "markers", "gaps")
    )
    return (
        f"{kind} {target.columns}x{target.rows}, {name} {1e3 * target.size:g} mm, {gap} "
        f"{1e3 * target.inner:g} mm, {target.dictionary}"
    )


def _chessboard(board: Chessboard) -> tuple[list[Box], float, float]:
    side = 1e3 * board.square
    columns, rows = board.columns + 1, board.rows + 1
    boxes = [
        (side * column, side * row, side, side)
        for row in range(rows)
        for column in range(columns)
        if (row + column) % 2 == 0
    ]
    return boxes, side * columns, side * rows


def _markers(board: Board) -> tuple[list[Box], float, float]:
    """Returns the black rectangles of a board's markers and of squares without a marker."""
    markers = markers_of(*board.opencv())
    boxes: list[Box] = []
    side = 1e3 * board.size
    white = set()
    for (x, y), length, cells in markers:
        white.add((int(x / board.size), int(y / board.size)))
        cell = 1e3 * length / len(cells)
        boxes += [
            (1e3 * x + cell * column, 1e3 * y + cell * row, cell, cell)
            for row, column in zip(*(~cells).nonzero(), strict=True)
        ]
    if not board.charuco:
        step, gap = side + 1e3 * board.inner, 1e3 * board.inner
        return boxes, step * board.columns - gap, step * board.rows - gap
    boxes += [
        (side * column, side * row, side, side)
        for row in range(board.rows)
        for column in range(board.columns)
        if (column, row) not in white
    ]
    return boxes, side * board.columns, side * board.rows
