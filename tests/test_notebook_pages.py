"""Tests that the pages made by scripts run and equal the files in the repository."""

import re

import notebook_page
import pytest

SCRIPTS = sorted(notebook_page.EXAMPLES.glob("*.py"))
NUMBER = re.compile(r"-?\d+(\.\d+)?")


def outputs(page):
    """Returns the printed outputs of a page's cells, and the rest of the page."""
    pattern = re.compile(r"```text\n.*?```", re.DOTALL)
    return pattern.findall(page), pattern.sub("", page)


@pytest.mark.long
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_a_page_is_what_its_script_gives(script):
    made = notebook_page.run(script)
    kept = (notebook_page.DOCS / f"{script.stem}.md").read_text()
    (printed, rest), (printed_then, rest_then) = outputs(made.text), outputs(kept)
    assert rest == rest_then
    # Another machine's last digits may differ.
    assert len(printed) == len(printed_then) > 0
    for now, then in zip(printed, printed_then, strict=True):
        assert NUMBER.sub("#", now) == NUMBER.sub("#", then)
        pairs = zip(NUMBER.finditer(now), NUMBER.finditer(then), strict=True)
        for number, other in pairs:
            assert float(number[0]) == pytest.approx(float(other[0]), rel=0.02, abs=0.1)
    for name in made.images:
        assert f"](images/{name})" in kept
        assert (notebook_page.IMAGES / name).exists()


def test_cells_are_told_apart():
    cells = notebook_page.cells_of(
        "# no cell\n# %% [markdown]\n# # Title\n#\n# A.\n\n# %%\na = 1\n"
    )
    assert [(cell.text, cell.code) for cell in cells] == [
        ("# Title\n\nA.", False),
        ("a = 1", True),
    ]
