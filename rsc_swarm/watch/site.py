"""A live page for one flight: its address, the process that serves it, and the window through which it is shown."""

import html
import os
import secrets
import socket
import webbrowser
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from ipaddress import ip_address
from pathlib import Path

from protocols.errors import SwarmError
from rsc_swarm.flight.processes import Supervisor
from rsc_swarm.machine.leaving import passing_folder
from rsc_swarm.watch.hands import Pace
from rsc_swarm.watch.window import Window

USUAL_PORT = 8750
_NEEDS = ("starlette", "uvicorn", "websockets", "prometheus_client")
_LEAVE_S = 2.0  # for the server, once the flight is over
_ROOM_BYTES = 1 << 20  # in the socket; the kernel may give less


class ViewError(SwarmError, ValueError):
    """No page can be served as asked; one line says why."""


@dataclass(frozen=True)
class Asked:
    """Where a page is to be served. port: None: the usual one, or any if that is taken; 0: any."""

    host: str = "127.0.0.1"
    port: int | None = None
    open_browser: bool = False


@dataclass(frozen=True)
class Site:
    """A page that is served. address: with the token of who may lay hands on the flight."""

    address: str
    window: Window


@contextmanager
def served(
    asked: Asked, speed: float | None = None, paced: bool = True, hands: bool = True
) -> Iterator[Site]:
    """Serve a page within the block, in a process of its own; then see it off. ``speed``: at first; ``paced``: as
    Window. ``hands``: whether who has the token may lay hands on the flight.

    Raises:
        ViewError: what it needs is not installed, or the address cannot be had.
    """
    for name in _NEEDS:
        if find_spec(name) is None:
            raise ViewError(f"--view needs {name}: pip install -e '.[view]', in the clone of rsc-swarm")
    listener = _listen(asked)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _ROOM_BYTES)
    host, port = listener.getsockname()[:2]
    named = socket.gethostname() if ip_address(host).is_unspecified else f"[{host}]" if ":" in host else host
    token = secrets.token_urlsafe(12) if hands else None
    address = f"http://{named}:{port}/{f'#{token}' if token else ''}"
    with ours, Supervisor() as supervisor, _opened(address, asked.open_browser):
        supervisor.start("view", _serve, listener, theirs, ours, _hosts(host), token)
        listener.close()
        theirs.close()
        window = Window(ours, Pace(speed), paced)
        yield Site(address, window)
        window.see_off(_LEAVE_S)
        ours.shutdown(socket.SHUT_RDWR)  # drones may still hold it
        supervisor.wait(_LEAVE_S)


def _serve(
    listener: socket.socket, end: socket.socket, flights: socket.socket, hosts: list[str], token: str | None
) -> None:
    flights.close()
    from rsc_swarm.watch.server import serve

    serve(listener, end, hosts, token)


def _listen(asked: Asked) -> socket.socket:
    """The socket at which the page is to be had."""
    ports = (USUAL_PORT, 0) if asked.port is None else (asked.port,)
    try:
        family, _, _, _, address = socket.getaddrinfo(asked.host, 0, type=socket.SOCK_STREAM)[0]
    except (OSError, UnicodeError) as error:  # the latter of a name like 10.0.0..1
        why = getattr(error, "strerror", None) or "no machine can be called so"
        raise ViewError(f"--view-host {asked.host}: {why}; give an address of this machine") from None
    for port in ports:
        listener = socket.socket(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((address[0], port))
            listener.listen(64)
            return listener
        except OSError as error:
            listener.close()
            why = error.strerror
    raise ViewError(
        f"--view-port {ports[-1]}: cannot be had at {asked.host} ({why}); give another, or 0 for any"
    )


def _hosts(host: str) -> list[str]:
    """By which names the page may be asked for: on loopback no other, so that no name of others leads here."""
    return ["localhost", "127.0.0.1", "[::1]", "::1", host] if ip_address(host).is_loopback else ["*"]


@contextmanager
def _opened(address: str, wanted: bool) -> Iterator[None]:
    """Open the page in a browser, by way of a private file: the token is to stand in no list of processes."""
    if not wanted:
        yield
        return
    private = os.environ.get("XDG_RUNTIME_DIR")
    usable = private and os.access(private, os.W_OK | os.X_OK)
    with passing_folder("rsc-swarm-view-", Path(private) if private and usable else None) as folder:
        way = folder / "view.html"
        way.write_text(f'<meta http-equiv="refresh" content="0; url={html.escape(address)}">')
        with suppress(OSError, webbrowser.Error):
            webbrowser.open(way.absolute().as_uri())
        yield
