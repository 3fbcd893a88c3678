"""Tests that untrusted texts are safe on terminals and in logs."""

import io

import pytest

from slosh_base.files.plain_text import LONGEST, PlainStream, plain_line, plain_lines


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a\x1b[31mb", "a\\x1b[31mb"),
        ("title\x1b]0;x\x07", "title\\x1b]0;x\\x07"),
        ("one\nslosh: all is well", "one\\nslosh: all is well"),
        ("\x9b31m\x7f", "\\x9b31m\\x7f"),
        ("gpj\u202exe.", "gpj\\u202exe."),
        ("\udcff", "\\udcff"),
        ("Höhe 3 mm · ζ → 0", "Höhe 3 mm · ζ → 0"),
    ],
)
def test_control_characters_are_written_out(text, expected):
    assert plain_line(text) == expected


def test_a_line_has_a_length():
    assert len(plain_line("x" * 10**6)) == LONGEST
    assert len(plain_line("\x1b" * LONGEST)) == LONGEST
    assert plain_line("x" * LONGEST) == "x" * LONGEST


def test_lines_and_tabs_stay_in_a_text_of_lines():
    assert plain_lines("a\n\tb\x1b") == "a\n\tb\\x1b"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("\r 50%|##  |", "\r 50%|##  |"),
        ("\r    \r", "\r    \r"),
        ("\r", "\r"),
        ("bag a\rb\x1b[2J\n", "bag a\\rb\\x1b[2J\n"),
    ],
)
def test_a_stream_draws_bars_and_obeys_nobody_else(text, expected):
    target = io.StringIO(newline="")
    assert PlainStream(target).write(text) == len(text)
    assert target.getvalue() == expected


def test_a_stream_is_the_old_one_in_all_else():
    target = io.StringIO()
    print("a", "\x1b", sep="\t", file=PlainStream(target), flush=True)
    assert target.getvalue() == "a\t\\x1b\n"
    assert not PlainStream(target).isatty()
