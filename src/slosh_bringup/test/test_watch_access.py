"""Who gets a cell's page."""

import socket

import pytest

from slosh_bringup.watch.access import Access, new_access

HERE = Access("127.0.0.1", 7567)
OUTSIDE = Access("0.0.0.0", 7567, "secret")


def refusal(access, host, query="", data=True, **headers):
    given = {"host": host, **{name.replace("_", "-"): text for name, text in headers.items()}}
    return access.refusal(given, query, data=data)


@pytest.mark.parametrize(
    "host", ["127.0.0.1:7567", "localhost:7567", "[::1]:7567", "LOCALHOST:7567"]
)
def test_this_machine_gets_it(host):
    assert refusal(HERE, host) == ""
    assert refusal(HERE, host, origin=f"http://{host.lower()}") == ""


@pytest.mark.parametrize(
    "host",
    [
        "evil.example:7567",
        "127.0.0.1.evil.example:7567",
        "127.0.0.1",
        "127.0.0.1:80",
        "",
        "localhost",
    ],
)
def test_a_name_that_was_made_to_point_here_gets_nothing(host):
    assert "unknown host" in refusal(HERE, host)
    assert "unknown host" in refusal(HERE, host, data=False)


@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "null", "http://localhost:9000", "https://localhost:7567", ""],
)
def test_a_page_of_another_origin_gets_nothing(origin):
    assert "origins" in refusal(HERE, "localhost:7567", origin=origin)


def test_an_image_tag_of_another_site_gets_nothing():
    assert "sites" in refusal(HERE, "localhost:7567", sec_fetch_site="cross-site")
    assert refusal(HERE, "localhost:7567", sec_fetch_site="same-origin") == ""


def test_elsewhere_the_token_is_needed_but_for_the_pages_own_files():
    assert "token" in refusal(OUTSIDE, "192.0.2.7:7567")
    assert "token" in refusal(OUTSIDE, "192.0.2.7:7567", "token=secre")
    assert "token" in refusal(OUTSIDE, "192.0.2.7:7567", "token=ßß")
    assert refusal(OUTSIDE, "192.0.2.7:7567", "token=secret") == ""
    assert refusal(OUTSIDE, "192.0.2.7:7567", data=False) == ""
    assert "unknown host" in refusal(OUTSIDE, "rebound.example:7567", "token=secret")
    assert refusal(OUTSIDE, f"{socket.gethostname()}:7567", "token=secret") == ""


def test_the_page_listens_to_this_machine_without_and_to_others_with_a_token():
    assert new_access("127.0.0.1", 7567).url == "http://127.0.0.1:7567/"
    one, other = new_access("0.0.0.0", 7567), new_access("0.0.0.0", 7567)
    assert len(one.token) >= 16
    assert one.token != other.token
    assert one.url.endswith(f":7567/?token={one.token}")
