"""Who gets a cell's page."""

import socket

import pytest

from slosh_bringup.watch.access import Access, new_access

HERE = Access("127.0.0.1", 8765)
OUTSIDE = Access("0.0.0.0", 8765, "secret")


def refusal(access, host, query="", data=True, **headers):
    given = {"host": host, **{name.replace("_", "-"): text for name, text in headers.items()}}
    return access.refusal(given, query, data=data)


@pytest.mark.parametrize(
    "host", ["127.0.0.1:8765", "localhost:8765", "[::1]:8765", "LOCALHOST:8765"]
)
def test_this_machine_gets_it(host):
    assert refusal(HERE, host) == ""
    assert refusal(HERE, host, origin=f"http://{host.lower()}") == ""


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:8765",
        "127.0.0.1.evil.example:8765",
        "127.0.0.1",
        "127.0.0.1:80",
        "",
        "localhost",
    ],
)
def test_a_name_that_was_made_to_point_here_gets_nothing(host):
    assert "not called" in refusal(HERE, host)
    assert "not called" in refusal(HERE, host, data=False)


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://localhost:9000", "https://localhost:8765", ""],
)
def test_a_page_of_another_origin_gets_nothing(origin):
    assert "origins" in refusal(HERE, "localhost:8765", origin=origin)


def test_an_image_tag_of_another_site_gets_nothing():
    assert "sites" in refusal(HERE, "localhost:8765", sec_fetch_site="cross-site")
    assert refusal(HERE, "localhost:8765", sec_fetch_site="same-origin") == ""


def test_elsewhere_the_token_is_needed_but_for_the_pages_own_files():
    assert "token" in refusal(OUTSIDE, "192.0.2.7:8765")
    assert "token" in refusal(OUTSIDE, "192.0.2.7:8765", "token=secre")
    assert "token" in refusal(OUTSIDE, "192.0.2.7:8765", "token=ßß")
    assert refusal(OUTSIDE, "192.0.2.7:8765", "token=secret") == ""
    assert refusal(OUTSIDE, "192.0.2.7:8765", data=False) == ""
    assert "not called" in refusal(OUTSIDE, "rebound.example:8765", "token=secret")
    assert refusal(OUTSIDE, f"{socket.gethostname()}:8765", "token=secret") == ""


def test_the_page_listens_to_this_machine_without_and_to_others_with_a_token():
    assert new_access("127.0.0.1", 8765).url == "http://127.0.0.1:8765/"
    one, other = new_access("0.0.0.0", 8765), new_access("0.0.0.0", 8765)
    assert len(one.token) >= 16
    assert one.token != other.token
    assert one.url.endswith(f":8765/?token={one.token}")
