"""Serves the operator's page over HTTP and its updates over a WebSocket."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
import threading
from collections import deque
from collections.abc import Awaitable, Callable, MutableMapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response
from starlette.routing import BaseRoute, Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from slosh_bringup.errors import SloshBringupError
from slosh_bringup.watch.access import HEADERS, Access
from slosh_bringup.watch.recording import RecordedFrames

PAGE = Path(__file__).parent / "page"
FILES = "/files/"
VIEWERS = 50
"""So many may look at once."""
REFUSED = 1008
"""WebSocket code: against the rules."""
LONGEST_MESSAGE = 1024
"""A viewer has nothing to say; more than this ends its connection [bytes]."""
MOST_FRAMES = 600
"""Of a recording in one answer."""

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

KEPT = 300
"""Frames of the drawing: 30 s."""


class Guard:
    """Web middleware that applies the access rules and adds security headers.

    Args:
        app: what is guarded.
        access: the rules.
    """

    def __init__(self, app: Any, access: Access) -> None:
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Handles one HTTP request or WebSocket connection (ASGI interface)."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        headers = {_text(key): _text(value) for key, value in scope["headers"]}
        query = _text(scope["query_string"])
        refusal = self._access.refusal(headers, query, data=not scope["path"].startswith(FILES))
        if refusal and scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": REFUSED, "reason": refusal[:100]})
            return

        async def with_headers(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                own = [(k.lower().encode(), v.encode()) for k, v in HEADERS.items()]
                message["headers"] = [*message.get("headers", []), *own]
            await send(message)

        answer = PlainTextResponse(f"{refusal}\n", 403) if refusal else self._app
        await answer(scope, receive, with_headers)


def live_app(hub: Hub, access: Access) -> Guard:
    """Creates the web application of the operator's page for a running cell."""

    async def watch(socket: WebSocket) -> None:
        if hub.viewers >= VIEWERS:
            await socket.close(REFUSED, f"{VIEWERS} viewers are connected, which is the maximum")
            return
        await socket.accept()
        hub.viewers += 1
        try:
            await _until_it_leaves(socket, _show(socket, hub))
        finally:
            hub.viewers -= 1

    return _guarded("live", [WebSocketRoute("/frames", watch)], access)


def recording_app(recording: RecordedFrames, access: Access) -> Guard:
    """Creates the web application of the operator's page for a recording."""

    def about(request: Request) -> Response:
        return JSONResponse(recording.about())

    def frames(request: Request) -> Response:
        first = _number(request, "from")
        chosen = recording.frames[first : min(_number(request, "to"), first + MOST_FRAMES)]
        return Response(f"[{','.join(chosen)}]", media_type="application/json")

    def picture(request: Request) -> Response:
        found = recording.picture(_number(request, "frame"))
        return (
            Response(found, media_type="application/octet-stream") if found else Response("", 204)
        )

    routes = [Route("/about", about), Route("/part", frames), Route("/picture", picture)]
    return _guarded("recording", routes, access)


def _guarded(mode: str, routes: Sequence[BaseRoute], access: Access) -> Guard:
    page = (PAGE / "index.html").read_text(encoding="utf-8").replace("MODE", mode)
    files = StaticFiles(directory=PAGE, packages=[("slosh_report", "uplot")])
    app = Starlette(
        routes=[
            Route("/", lambda request: HTMLResponse(page)),
            *routes,
            Mount(FILES.rstrip("/"), files),
        ]
    )
    return Guard(app, access)


def _text(data: bytes) -> str:
    return data.decode("latin-1")


def _number(request: Request, name: str) -> int:
    given = request.query_params.get(name, "")
    return int(given) if given.isascii() and given.isdigit() and len(given) < 10 else 0


async def _show(socket: WebSocket, hub: Hub) -> None:
    """Sends new updates of the watch page to one viewer until cancelled."""
    seen = (0, 0)
    while True:
        news = await hub.after(seen)
        seen = news.seen
        if news.frames:
            await socket.send_text(f"[{','.join(news.frames)}]")
        if news.picture is not None:
            await socket.send_bytes(news.picture)


async def _until_it_leaves(socket: WebSocket, work: Any) -> None:
    """Runs a task until the viewer disconnects; ignores data that the viewer sends."""
    task = asyncio.ensure_future(work)
    try:
        while not task.done():
            message = asyncio.ensure_future(socket.receive())
            await asyncio.wait((task, message), return_when=asyncio.FIRST_COMPLETED)
            if not message.done():
                message.cancel()
            elif message.result()["type"] == "websocket.disconnect":
                return
    finally:
        task.cancel()
        # A viewer that leaves in the midst of a message is nothing to report.
        with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
            await task


class WatchServer:
    """Web server that runs in its own thread.

    Args:
        listener: a listening socket; see `listen`.
        make: makes the application, in the server's loop.
    """

    def __init__(self, listener: socket.socket, make: Callable[[], Any]) -> None:
        self._listener, self._make = listener, make
        self._loop: asyncio.AbstractEventLoop | None = None
        self._server: uvicorn.Server | None = None
        self._started = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="watch server", daemon=True)

    def start(self) -> None:
        """Starts the web server's thread."""
        self._thread.start()
        self._started.wait()

    def call(self, function: Callable[..., None], *arguments: Any) -> None:
        """Schedules a function call in the server's event loop."""
        if self._loop is not None:
            with contextlib.suppress(RuntimeError):  # the loop has ended
                self._loop.call_soon_threadsafe(function, *arguments)

    def stop(self) -> None:
        """Stops the server and disconnects its viewers."""
        if self._server is not None:
            self._server.should_exit = self._server.force_exit = True
        self._thread.join(timeout=5.0)

    def wait(self) -> None:
        """Waits until the server's thread has ended."""
        while self._thread.is_alive():
            self._thread.join(timeout=0.2)

    def _serve(self) -> None:
        asyncio.run(self._run())

    async def _run(self) -> None:
        self._loop = asyncio.get_running_loop()
        config = uvicorn.Config(
            self._make(), log_level="error", access_log=False, server_header=False, lifespan="off",
            ws="websockets-sansio", ws_max_size=LONGEST_MESSAGE, ws_per_message_deflate=False,
            timeout_graceful_shutdown=1,
        )  # fmt: skip
        self._server = uvicorn.Server(config)
        self._started.set()
        await self._server.serve(sockets=[self._listener])


def listen(host: str, port: int) -> socket.socket:
    """Opens a TCP socket on which the web server listens.

    Raises:
        SloshBringupError: the address is none of this machine's, or the port is taken.
    """
    try:
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        return socket.create_server((host, port), family=family)
    except (OSError, OverflowError) as error:
        # Its own text repeats the address.
        reason = os.strerror(error.errno) if isinstance(error, OSError) and error.errno else error
        raise SloshBringupError(
            f"the page cannot be served on {host}, port {port}: {reason}; choose another port"
        ) from None


class News(NamedTuple):
    """Updates and picture for the watch page that a viewer has not received yet.

    Attributes:
        frames: as JSON, in their order.
        picture: the newest camera image with its heading; None: it has seen that.
        seen: numbers of the last frame and picture, for the next time.
    """

    frames: list[str]
    picture: bytes | None
    seen: tuple[int, int]


class Hub:
    """Distributes updates and pictures of the watch page to its viewers.

    What is new is put once; each viewer takes what has come since it took last. A slow viewer
    gets more at once and at last misses what is older than the drawing; it holds nobody up.

    Attributes:
        viewers: how many there are.
    """

    def __init__(self) -> None:
        self.viewers = 0
        self._frames: deque[str] = deque(maxlen=KEPT)
        self._picture = b""
        self._last = (0, 0)
        self._news = asyncio.Event()

    def put_frame(self, frame: str) -> None:
        """Adds an update of the operator's page, to be sent to all viewers."""
        self._frames.append(frame)
        self._last = (self._last[0] + 1, self._last[1])
        self._tell()

    def put_picture(self, picture: bytes) -> None:
        """Sets the newest camera picture, to be sent to all viewers."""
        self._picture = picture
        self._last = (self._last[0], self._last[1] + 1)
        self._tell()

    async def after(self, seen: tuple[int, int] = (0, 0)) -> News:
        """Waits for watch-page updates or a picture that a viewer lacks; returns them."""
        while seen == self._last:
            await self._news.wait()
        missed = min(self._last[0] - seen[0], len(self._frames))
        frames = list(self._frames)[len(self._frames) - missed :]
        picture = self._picture if seen[1] != self._last[1] else None
        return News(frames, picture, self._last)

    def _tell(self) -> None:
        news, self._news = self._news, asyncio.Event()
        news.set()
