"""Tests that each user mistake gets the right answer, or one line with a remedy."""

import pytest
import stranger

NORMAL = 4
"""Of so many mistakes one is tried in each run; all of them in the long suite."""


@pytest.fixture(scope="module")
def mistakes(tmp_path_factory):
    """Creates the folder for the mistakes; returns all of them."""
    folder = tmp_path_factory.mktemp("stranger")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        yield folder, stranger.prepare(folder)


def wrong(folder, mistakes):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        marks = {one.words: stranger.rated(one, stranger.typed(one.words)) for one in mistakes}
    return {words: mark for words, mark in marks.items() if mark not in ("right", "remedy")}


def test_there_are_as_many_as_the_page_says(mistakes):
    kinds = [one.kind for one in mistakes[1]]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "motion table": 28, "model.yaml": 9, "command line": 100,
    }  # fmt: skip
    page = stranger.PAGE.read_text(encoding="utf-8")
    tables = sorted((stranger.PAGE.parent / "results" / "tables").glob("mistakes_*.csv"))
    assert all(table.name in page for table in tables)
    shown = page + "".join(table.read_text(encoding="utf-8") for table in tables)
    assert shown.count(",0\n") == 3  # of each kind none is wrong
    assert all(one.name in shown for one in mistakes[1] if one.kind != stranger.LINES)
    assert "{literalinclude} ../tools/stranger_mistakes.txt" in page


def test_a_quarter_of_the_answers_is_right_or_has_the_remedy(mistakes):
    folder, every = mistakes
    assert wrong(folder, every[::NORMAL]) == {}


@pytest.mark.long
def test_every_answer_is_right_or_has_the_remedy(mistakes):
    assert wrong(*mistakes) == {}


@pytest.mark.parametrize(
    ("code", "errors", "mark"),
    [
        (2, ["slosh simulate: a.csv: line 4: fill the cell"], "remedy"),
        (2, ["slosh simulate: a.csv: cannot"], "wrong: no 'fill'"),
        (2, ["fill the cell", "and more"], "wrong: 2 lines"),
        (1, ["fill the cell"], "wrong: exit code 1 for 2"),
        (-1, ["Traceback (most recent call last):"], "wrong: a traceback"),
    ],
)
def test_what_is_no_remedy_is_rated_wrong(code, errors, mark):
    mistake = stranger.Mistake("motion table", "an empty cell", "simulate", 2, "fill")
    assert stranger.rated(mistake, stranger.Answer(code, "", errors, 0.0)).startswith(mark)
