"""The process that serves the live page of one flight: to whoever comes, as fast as each can take it.

It holds the other end of the flight's window. A page that does not read fills its own connection and nothing else; when it
reads again it is given what it missed, thinned (rsc_swarm.watch.recording). It leaves when the flight's end is closed.
"""

import asyncio
import json
import logging
import secrets
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.resources import files

import uvicorn
from prometheus_client import CONTENT_TYPE_LATEST
from starlette.applications import Starlette
from starlette.datastructures import Headers
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.websockets import WebSocket, WebSocketDisconnect

from rsc_swarm.watch.metrics import metrics
from rsc_swarm.watch.recording import Recording
from rsc_swarm.watch.window import PICTURE
from world.outlets.picture import Picture, unpacked

_LONGEST_MESSAGE = 1 << 20
_FAREWELL_S = 1.0  # for pages to take what is left
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; connect-src 'self' ws: wss:; frame-ancestors 'none'",
    "Cache-Control": "no-cache",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}


class Shown:
    """What there is to show of a flight: pictures, and words, each a JSON object. over: nothing more will come."""

    def __init__(self, end: socket.socket) -> None:
        self.recording = Recording()
        self.words: list[str] = []
        self.over = False
        self._end = end
        self._waiting: set[asyncio.Event] = set()

    def tell_flight(self, hand: bytes) -> str | None:
        """Hand on what a hand wants; why not, if the flight cannot hear it."""
        with suppress(OSError):
            try:
                self._end.send(hand or b"null")  # nothing at all would look like the end
            except BlockingIOError:
                return "the flight has not come to what was said before; say it again"
            if not self.over:
                return None
        return "the flight does not listen any more"

    def take(self) -> None:
        """Take in whatever the flight says now."""
        with suppress(BlockingIOError):
            while not self.over:
                try:
                    message = self._end.recv(_LONGEST_MESSAGE)
                except ConnectionError:
                    message = b""
                if not message:
                    self.over = True
                elif message[:1] == PICTURE:
                    head = json.loads(message[5 : 5 + int.from_bytes(message[1:5], "little")])
                    self.recording.add(head["tick"], message[1:])
                else:
                    self.words.append(message[1:].decode())
                    self.recording.whole |= json.loads(self.words[-1])["kind"] == "replay"
        for news in self._waiting:
            news.set()

    @property
    def pages(self) -> int:
        """How many look on."""
        return len(self._waiting)

    def newest(self) -> Picture | None:
        """The last picture."""
        return unpacked(self.recording.newest) if self.recording.newest else None

    @contextmanager
    def news(self) -> Iterator[asyncio.Event]:
        """An event that is set whenever there is something new."""
        event = asyncio.Event()
        self._waiting.add(event)
        try:
            yield event
        finally:
            self._waiting.discard(event)


async def _feed(page: WebSocket, shown: Shown) -> None:
    """Tell a page all, as fast as it takes it, until the flight is over."""
    tick, told = -1, 0
    with shown.news() as news:
        while True:
            news.clear()
            over = shown.over
            while told < len(shown.words):
                await page.send_text(shown.words[told])
                told += 1
            tick, pictures = shown.recording.since(tick)
            if pictures:
                await page.send_bytes(pictures)
                continue
            if over:
                return
            await news.wait()


def _same_origin(headers: Headers) -> bool:
    """Whether a page of ours asks, or a program: pages of others are not to look in."""
    origin = headers.get("origin")
    return origin is None or origin.split("://")[-1] == headers.get("host")


def application(shown: Shown, hosts: list[str], token: str | None) -> Starlette:
    """The page, its stream at ``/live``. hosts: by which names it may be asked for. token: who knows it may lay hands on the
    flight; None: nobody."""
    told = metrics(shown.newest, lambda: shown.pages)

    async def index(request: Request) -> Response:
        page = files("rsc_swarm.watch").joinpath("page/index.html").read_bytes()
        return Response(page, media_type="text/html", headers=_HEADERS)

    async def measured(request: Request) -> Response:
        return Response(told(), media_type=CONTENT_TYPE_LATEST)

    async def live(page: WebSocket) -> None:
        if not _same_origin(page.headers):
            await page.close()
            return
        await page.accept()
        feeding = asyncio.ensure_future(_feed(page, shown))
        listening = asyncio.ensure_future(_listen(page, shown, token))
        await asyncio.wait((feeding, listening), return_when=asyncio.FIRST_COMPLETED)
        for task in (feeding, listening):
            task.cancel()
        with suppress(WebSocketDisconnect, RuntimeError):
            await page.close()

    return Starlette(
        routes=[
            Route("/", index),
            Route("/metrics", measured),
            WebSocketRoute("/live", live),
            Mount("/page", StaticFiles(packages=[("rsc_swarm.watch", "page")])),
        ],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=hosts)],
    )


async def _listen(page: WebSocket, shown: Shown, token: str | None) -> None:
    """Take in what a page says: first the token, if it has it, then what its hands want."""
    may = False
    with suppress(WebSocketDisconnect, RuntimeError):
        while True:
            said = (await page.receive_text()).encode()
            if not may:
                may = token is not None and secrets.compare_digest(said, token.encode())
                await page.send_text(json.dumps({"kind": "you", "hands": may}))
            elif why := shown.tell_flight(said):
                await page.send_text(json.dumps({"kind": "refused", "text": why}))


class _Server(uvicorn.Server):
    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        """Its launcher answers them."""
        yield


def serve(listener: socket.socket, end: socket.socket, hosts: list[str], token: str | None) -> None:
    """Serve until the flight's window is closed. listener: it listens already; end: the other end of the window."""
    logging.disable()  # else what strangers send to the port is told in the terminal of the flight
    asyncio.run(_serve(listener, end, hosts, token))


async def _serve(listener: socket.socket, end: socket.socket, hosts: list[str], token: str | None) -> None:
    end.setblocking(False)
    shown, loop = Shown(end), asyncio.get_running_loop()
    config = uvicorn.Config(
        application(shown, hosts, token), log_config=None, access_log=False, lifespan="off", ws="websockets-sansio",
        ws_max_size=1 << 16, ws_per_message_deflate=False, timeout_graceful_shutdown=1, server_header=False,
    )  # fmt: skip
    server = _Server(config)

    def hear() -> None:
        shown.take()
        if shown.over:
            loop.remove_reader(end)
            leaving.append(asyncio.ensure_future(_leave(server)))

    leaving: list[asyncio.Future[None]] = []
    loop.add_reader(end, hear)
    await server.serve([listener])


async def _leave(server: uvicorn.Server) -> None:
    """Leave as soon as all pages have been told all, and before long in any case."""
    deadline = asyncio.get_running_loop().time() + _FAREWELL_S
    while server.server_state.connections and asyncio.get_running_loop().time() < deadline:
        await asyncio.sleep(0.02)
    server.should_exit = True
