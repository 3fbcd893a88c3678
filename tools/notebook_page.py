"""Runs docs/examples/*.py cell by cell and writes them as pages with output and pictures.

    tools/run python tools/notebook_page.py

A cell begins with `# %%`; one with `# %% [markdown]` holds text as comments. What a cell prints
stands below it, and what it draws goes to docs/images.
"""

from __future__ import annotations

import io
import sys
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.style import context

DOCS = Path(__file__).resolve().parent.parent / "docs"
EXAMPLES = DOCS / "examples"
IMAGES = DOCS / "images"
MARK, TEXT = "# %%", "# %% [markdown]"
STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "notebook",
    "font.size": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e4e4e4",
    "axes.axisbelow": True,
    "figure.constrained_layout.use": True,
}


@dataclass(frozen=True, slots=True)
class Cell:
    """A cell of an example script: Python code or Markdown text.

    Attributes:
        text: Markdown, or Python.
        code: whether it is Python.
    """

    text: str
    code: bool


@dataclass(frozen=True, slots=True)
class Page:
    """The documentation page of an example script, with its pictures.

    Attributes:
        text: of the page.
        images: SVG texts by file name.
    """

    text: str
    images: dict[str, str]


def cells_of(script: str) -> list[Cell]:
    """Splits an example script into cells; ignores text before the first cell mark."""
    cells: list[Cell] = []
    for part in ("\n" + script).split(f"\n{MARK}")[1:]:
        head, _, body = part.partition("\n")
        if head.strip():
            lines = (line.removeprefix("#").removeprefix(" ") for line in body.splitlines())
            cells.append(Cell("\n".join(lines).strip(), code=False))
        else:
            cells.append(Cell(body.strip(), code=True))
    return cells


def run(script: Path) -> Page:
    """Runs all cells of an example script in one namespace and returns its page."""
    names: dict[str, Any] = {"__name__": "notebook"}
    blocks: list[str] = []
    images: dict[str, str] = {}
    plt.switch_backend("svg")
    with context(STYLE):
        for cell in cells_of(script.read_text(encoding="utf-8")):
            if not cell.code:
                blocks.append(cell.text)
                continue
            printed = io.StringIO()
            with redirect_stdout(printed):
                exec(compile(cell.text, str(script), "exec"), names)
            blocks.append(f"```python\n{cell.text}\n```")
            if printed.getvalue():
                blocks.append(f"```text\n{printed.getvalue().rstrip()}\n```")
            for number in plt.get_fignums():
                name = f"{script.stem}_{len(images) + 1}.svg"
                images[name] = _svg(number)
                blocks.append(f"![What the lines above draw](images/{name})")
    return Page("\n\n".join(blocks) + "\n", images)


def _svg(number: int) -> str:
    text = io.StringIO()
    plt.figure(number).savefig(text, format="svg", metadata={"Date": None})
    plt.close(number)
    return "\n".join(line.rstrip() for line in text.getvalue().splitlines()) + "\n"


def main() -> int:
    """Writes the documentation pages of all example scripts."""
    for script in sorted(EXAMPLES.glob("*.py")):
        page = run(script)
        (DOCS / f"{script.stem}.md").write_text(page.text, encoding="utf-8")
        for name, svg in page.images.items():
            (IMAGES / name).write_text(svg, encoding="utf-8")
        print(f"docs/{script.stem}.md")
    return 0


if __name__ == "__main__":
    sys.exit(main())
