"""Tests the page in a real browser: its appearance, and that it loads nothing else."""

import json
import re
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest
from headless_browser import View

from slosh_report.run_report import render_report, report_document
from slosh_testing.reports import A4, LOOK, EveryPage, at, check_numbers, on_paper


class Listener:
    """A local web server that records the requests it receives."""

    def __init__(self):
        asked = self.asked = []

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self):
                asked.append(self.path)
                self.send_error(404)

            def log_message(self, *_):
                pass

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.address = f"http://127.0.0.1:{self.server.server_port}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()


@pytest.fixture(scope="module")
def listener():
    listener = Listener()
    yield listener
    listener.server.shutdown()
    listener.server.server_close()


@pytest.fixture(scope="module")
def page(full_report):
    return render_report(full_report)


@pytest.fixture(scope="module")
def seen(headless, page, hostile_report, listener):
    """Renders all views of the page in one run of the browser."""
    hostile = render_report(hostile_report).replace("http://127.0.0.1:9", listener.address)
    views = {
        "desktop": View(page),
        "dark": View(page, dark=True),
        "phone": View(page, width=390),
        "small phone": View(page, width=320),
        "paper": View(on_paper(page), width=A4, dark=True),
        "hostile": View(hostile, width=390),
    }
    look = headless.look(list(views.values()), LOOK)
    return {**dict(zip(views, look.values, strict=True)), "console": look.console}


class TestEveryScreen(EveryPage):
    pass


def test_letters_in_charts_are_large_enough_to_read(seen):
    for view in ("desktop", "phone", "paper"):
        assert len(seen[view]["charts"]) == 7, view
        assert min(seen[view]["letters"]) > 7.5, view


def test_differences_are_folded_on_screens_and_open_on_paper(seen):
    assert seen["desktop"]["folded"] == 0
    assert seen["paper"]["folded"] == 3 * 5


def test_every_number_is_that_of_the_document(seen, full_report):
    document = json.loads(json.dumps(report_document(full_report), allow_nan=False))
    assert len(seen["desktop"]["numbers"]) > 70
    check_numbers(seen["desktop"], document)


def test_every_shown_number_is_the_rounded_one(seen, full_report):
    document = report_document(full_report)
    for path, value, text in seen["desktop"]["numbers"]:
        number = json.loads(value)
        if number is None:
            assert text == "–", path
            continue
        digits = len(text.split(".")[1]) if "." in text and "e" not in text else 0
        shown = float(text.replace("−", "-"))
        if "e" in text:
            assert shown == pytest.approx(number, rel=0.01), path
            continue
        expected = SCALES[unit(document, path)] * number
        assert abs(shown - expected) <= 0.5000001 * 10.0**-digits, path


def test_texts_of_a_hostile_bag_are_texts(seen):
    assert seen["hostile"]["hacked"] is None
    assert seen["hostile"]["scripts"] == seen["desktop"]["scripts"]
    assert seen["hostile"]["heading"].startswith("title</pre></title></style><script>")
    assert seen["hostile"]["images"] == [8]
    assert not set(seen["hostile"]["heading"]) & set("\x00\x1b\u202e")


def test_no_request_leaves_and_an_error_would_be_seen(headless, page, seen, listener):
    """Pages that send requests or raise errors are noticed by the same test."""
    open_page = page[: page.index("<meta http-equiv")] + page[page.index("<meta name=") :]
    wish = "<main><img alt='any image' src='{}/{}'><script>throw new Error('seen')</script>"
    pages = [
        text.replace("<main>", wish.format(listener.address, name))
        for text, name in ((open_page, "open"), (page, "strict"))
    ]
    assert listener.asked == []  # of the hostile page, looked at before
    look = headless.look([View(text) for text in pages], LOOK)
    assert listener.asked == ["/open"]
    assert any("seen" in line for line in look.console)
    assert sum("Content Security Policy" in line for line in look.console) == 2


@pytest.mark.long
def test_it_prints_on_several_sheets(headless, page, tmp_path):
    target = tmp_path / "page.pdf"
    headless.print_pdf(page, target)
    content = target.read_bytes()
    assert content.startswith(b"%PDF-")
    assert 2 <= len(re.findall(rb"/Type\s*/Page\b", content)) <= 8


SCALES = {"mm": 1e3, "%": 1e2, "s": 1.0, "°": 57.29577951308232, "": 1.0}
UNITS = {
    "measured": "mm", "estimated": "mm",
    "sigma": "mm", "rms": "mm", "peak": "mm", "limit": "mm", "threshold": "mm", "epsilon": "%",
    "offset": "s", "start": "s", "end": "s", "duration": "s", "peak_time": "s", "first": "s",
    "median": "°", "count": "", "same": "", "total": "", "rate": "", "lost": "",
    "recorded": "", "replayed": "", "largest": "",
}  # fmt: skip


def unit(document, path):
    """Returns the unit in which a number is displayed."""
    steps = path.split("/")[1:]
    if steps[0] in ("checks", "key_figures"):
        return at(document, f"/{steps[0]}/{steps[1]}/unit")
    return UNITS[steps[-1]]
