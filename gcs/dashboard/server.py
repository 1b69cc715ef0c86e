"""The dashboard's web server: bokeh in a thread with an event loop of its own.

Building a page takes bokeh longer than the ground station's loop may wait, so the two share nothing but a
:class:`~gcs.dashboard.board.DashboardFeed`.
"""

from __future__ import annotations

import asyncio
import errno
import ipaddress
import logging
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gcs.dashboard.board import Board, DashboardFeed
from gcs.errors import GroundError
from onboard.config import Scenario

if TYPE_CHECKING:
    from bokeh.document import Document
    from bokeh.server.server import Server

    from gcs.dashboard.page import PageBar

__all__ = ["DEFAULT_PORT", "LOOPBACK", "Address", "find_port", "serve_dashboard"]

DEFAULT_PORT = 5006
"""Bokeh's."""

LOOPBACK = "127.0.0.1"

_PORTS_TRIED = 20
_TOKEN_BYTES = 24
_START_PATIENCE_S = 90.0
_STOP_PATIENCE_S = 2.0
_REFRESH_S = 0.1
_LOGGERS = ("bokeh", "tornado.access", "tornado.application", "tornado.general")


@dataclass(frozen=True, slots=True)
class Address:
    """Where the dashboard is.

    Attributes:
        host: IPv4 address, or name of this machine, that it is bound to.
        port: TCP port.
        token: What a visitor must know; empty where only this machine gets in.
    """

    host: str
    port: int
    token: str = field(default="", repr=False)

    @property
    def url(self) -> str:
        """For a browser on this machine, or on the network when bound to more than the loopback interface."""
        host = socket.gethostname() if self.host == "0.0.0.0" else self.host
        return f"http://{host}:{self.port}/"

    @property
    def entrance(self) -> str:
        """The same with the token, for the operator's eyes only."""
        return f"{self.url}?token={self.token}" if self.token else self.url

    @property
    def loopback_only(self) -> bool:
        """Whether other machines cannot reach it."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"


def find_port(host: str, port: int) -> Address:
    """The first free TCP port from this one on, and a new token if other machines can reach it.

    Raises:
        GroundError: None of twenty is free, or the host's address is not this machine's.
    """
    last = min(port + _PORTS_TRIED, 65536)
    for candidate in range(port, last):
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as sock:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                sock.bind((host, candidate))
            except OSError as error:
                if error.errno == errno.EADDRINUSE:
                    continue
                reason = error.strerror or str(error)
                raise GroundError(f"dashboard: {host}:{candidate} cannot be had: {reason}") from None
            token = "" if Address(host, candidate).loopback_only else secrets.token_urlsafe(_TOKEN_BYTES)
            return Address(host, candidate, token)
    raise GroundError(
        f"dashboard: TCP ports {port} to {last - 1} of {host} are all in use; choose another with --dashboard-port, "
        "or fly without: --no-dashboard"
    )


@contextmanager
def serve_dashboard(
    scenario: Scenario,
    feed: DashboardFeed,
    address: Address,
    make_board: Callable[[Scenario, DashboardFeed], Board] = Board,
    make_bar: Callable[[], PageBar] | None = None,
) -> Iterator[None]:
    """Serve the dashboard while this lasts.

    Args:
        scenario: Whose team is shown.
        feed: Tells what is to be shown, and why the server ended.
        address: Where.
        make_board: Makes what all pages show, in the server's thread.
        make_bar: Makes the bar of each page, there, too; that of orders unless given.

    Raises:
        GroundError: It does not start.
    """
    thread = _ServerThread(scenario, feed, address, make_board, make_bar)
    thread.start()
    try:
        thread.wait_until_served()
        yield
    finally:
        thread.stop()


class _ServerThread(threading.Thread):
    """Runs bokeh's server in an event loop of its own."""

    def __init__(
        self,
        scenario: Scenario,
        feed: DashboardFeed,
        address: Address,
        make_board: Callable[[Scenario, DashboardFeed], Board],
        make_bar: Callable[[], PageBar] | None,
    ) -> None:
        super().__init__(name="dashboard", daemon=True)
        self._scenario = scenario
        self._feed = feed
        self._address = address
        self._make_board = make_board
        self._make_bar = make_bar
        self._loop = asyncio.new_event_loop()
        self._ended = asyncio.Event()
        self._served = threading.Event()

    def wait_until_served(self) -> None:
        """Wait for the first page to be possible.

        Raises:
            GroundError: It does not start.
        """
        if not self._served.wait(_START_PATIENCE_S):
            raise GroundError(f"dashboard: not up after {_START_PATIENCE_S:.0f} s")
        if self._feed.failure is not None:
            raise GroundError(f"dashboard: {self._feed.failure}")

    def stop(self) -> None:
        """End the server; browsers that are connected see that it is gone."""
        if not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._ended.set)
        self.join(_STOP_PATIENCE_S)

    def run(self) -> None:
        """Thread: serve until stopped."""
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._serve())
        except Exception as error:  # whatever ends this thread is told, and never ends the flight
            self._feed.failure = f"{type(error).__name__}: {error}"
        finally:
            self._served.set()
            self._loop.close()

    async def _serve(self) -> None:
        board = self._make_board(self._scenario, self._feed)
        server = _make_server(board, self._address, self._make_bar)
        try:
            server.start()
            self._served.set()
            while not self._ended.is_set():
                board.refresh()
                try:
                    await asyncio.wait_for(self._ended.wait(), _REFRESH_S)
                except TimeoutError:
                    continue
        finally:
            server.stop()


def _make_server(board: Board, address: Address, make_bar: Callable[[], PageBar] | None) -> Server:
    # Bokeh takes most of a second to import: only who shows a dashboard pays for it, in the dashboard's thread.
    from bokeh.application import Application  # noqa: PLC0415
    from bokeh.application.handlers import FunctionHandler  # noqa: PLC0415
    from bokeh.server.auth_provider import NullAuth  # noqa: PLC0415
    from bokeh.server.server import Server  # noqa: PLC0415
    from tornado.ioloop import IOLoop  # noqa: PLC0415

    from gcs.dashboard.access import TokenAccess  # noqa: PLC0415
    from gcs.dashboard.page import COOKIE, build_page  # noqa: PLC0415

    for name in _LOGGERS:  # a browser that leaves is no news for the operator's terminal
        logging.getLogger(name).setLevel(logging.ERROR)

    def open_page(document: Document) -> None:
        context = document.session_context
        request = context.request if context is not None else None
        theme = None
        if request is not None:
            asked = request.arguments.get("theme", [])
            theme = asked[0].decode("ascii", "replace") if asked else request.cookies.get(COOKIE)
        build_page(document, board, theme, make_bar)

    local = f"{address.port}"
    origins = [f"127.0.0.1:{local}", f"localhost:{local}"]
    if not address.loopback_only:
        origins.append(f"*:{local}")
    access = TokenAccess(address.token, address.port) if address.token else None
    return Server(
        {"/": Application(FunctionHandler(open_page))},
        io_loop=IOLoop.current(),
        address=address.host,
        port=address.port,
        allow_websocket_origin=origins,
        auth_provider=access or NullAuth(),
        # Bokeh copies a visitor's cookies into the page; this one is for the browser alone.
        exclude_cookies=[] if access is None else [access.cookie],
        exclude_headers=["Cookie"],
        check_unused_sessions_milliseconds=5_000,
        unused_session_lifetime_milliseconds=10_000,
        session_token_expiration=3600,
    )
