"""Tests that slow viewers of the operator's page neither delay others nor miss events."""

import asyncio
import socket

import pytest

from slosh_bringup.watch.access import Access, new_access
from slosh_bringup.watch.server import KEPT, Hub


def test_who_comes_late_gets_what_is_still_drawn_and_the_newest_picture():
    async def run():
        hub = Hub()
        for number in range(KEPT + 50):
            hub.put_frame(str(number))
            hub.put_picture(bytes([number % 256]))
        return await hub.after()

    news = asyncio.run(run())
    assert news.frames == [str(number) for number in range(50, KEPT + 50)]
    assert news.picture == bytes([(KEPT + 49) % 256])


def test_a_viewer_gets_each_frame_once_however_slow_it_is():
    async def run():
        hub, got = Hub(), []

        async def view():
            seen = (0, 0)
            while len(got) < 30:
                news = await hub.after(seen)
                seen = news.seen
                got.extend(news.frames)
                await asyncio.sleep(0)

        viewer = asyncio.create_task(view())
        for number in range(30):
            hub.put_frame(str(number))
            if number % 7 == 0:
                await asyncio.sleep(0)
        await viewer
        return got

    assert asyncio.run(run()) == [str(number) for number in range(30)]


def test_who_has_seen_all_waits_for_what_comes():
    async def run():
        hub = Hub()
        hub.put_frame("0")
        seen = (await hub.after()).seen
        waiting = asyncio.create_task(hub.after(seen))
        await asyncio.sleep(0)
        assert not waiting.done()
        hub.put_picture(b"jpeg")
        return await waiting

    news = asyncio.run(run())
    assert (news.frames, news.picture) == ([], b"jpeg")


# Who gets a cell's page.


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


def test_a_link_on_another_page_of_this_host_is_followed():
    same = {"sec_fetch_site": "same-site"}
    assert refusal(HERE, "localhost:7567", **same, sec_fetch_mode="navigate") == ""
    assert "sites" in refusal(HERE, "localhost:7567", **same, sec_fetch_mode="no-cors")
    foreign = {"sec_fetch_site": "cross-site", "sec_fetch_mode": "navigate"}
    assert "sites" in refusal(HERE, "localhost:7567", **foreign)


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
