"""Frames to viewers: none waits for another, none misses what is still drawn."""

import asyncio

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
