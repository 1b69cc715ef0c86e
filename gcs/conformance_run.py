"""Performing a conformance session over a link, in real time."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import time
from collections.abc import Callable

from gcs.errors import GroundError
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import Link, TransportError, open_link
from sim_bridge.conformance import CatalogueError, Family, Plan, Session, family_of, load_catalogue

__all__ = ["ConformanceError", "perform"]

_STEP_S = 0.004
_CONNECT_S = 15.0
_HEARTBEAT_S = 1.0


class ConformanceError(GroundError):
    """A session that cannot begin; the text says why and what would help."""


class _Shell:
    """One link, and the session on it once an autopilot was heard."""

    def __init__(self, plan: Plan, family: Family | None, system_id: int | None) -> None:
        self.session: Session | None = None
        self.others: set[str] = set()
        self._plan, self._family, self._system_id = plan, family, system_id
        self._codecs: dict[tuple[int, int], Codec] = {}
        self._decoder = Codec(255, 0)
        self._link: Link | None = None
        self._next_greeting_s = 0.0

    def attach(self, link: Link) -> None:
        self._link = link

    def receive(self, datagram: bytes) -> None:
        """Take what arrived."""
        now_s = time.monotonic()
        for message in self._decoder.decode(datagram):
            if self.session is None and isinstance(message, mavlink.MAVLink_heartbeat_message):
                self._meet(message)
            if self.session is not None:
                self.session.receive(message, now_s)
        self._flush()

    def advance(self) -> None:
        """Let time pass."""
        now_s = time.monotonic()
        if self.session is not None:
            self.session.advance(now_s)
            self._flush()
        elif now_s >= self._next_greeting_s:  # on some links the autopilot speaks only to whom it has heard
            self._next_greeting_s = now_s + _HEARTBEAT_S
            kind, active = mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_STATE_ACTIVE
            greeting = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, active, 3)
            self._send(greeting, (self._system_id or 1, mavlink.MAV_COMP_ID_ONBOARD_COMPUTER))

    def _meet(self, heartbeat: mavlink.MAVLink_heartbeat_message) -> None:
        """Begin with the first autopilot that is wanted."""
        if heartbeat.get_srcComponent() != mavlink.MAV_COMP_ID_AUTOPILOT1:
            return
        family, system_id = family_of(heartbeat), heartbeat.get_srcSystem()
        if family is None or (self._family not in (None, family)) or self._system_id not in (None, system_id):
            self.others.add(f"system {system_id}, {family or f'MAV_AUTOPILOT {heartbeat.autopilot}'}")
            return
        self.session = Session(load_catalogue(family), self._plan)

    def _flush(self) -> None:
        if self.session is not None:
            for outgoing in self.session.outbox():
                self._send(outgoing.message, outgoing.source)

    def _send(self, message: mavlink.MAVLink_message, source: tuple[int, int]) -> None:
        codec = self._codecs.setdefault(source, Codec(*source))
        if self._link is not None:
            self._link.send(codec.encode(message))


async def perform(
    url: str,
    plan: Plan,
    family: Family | None,
    system_id: int | None,
    watch: Callable[[Session], None],
) -> Session:
    """Perform a plan against the autopilot that is heard on a link; the session at its end.

    The first SIGINT or SIGTERM lands the vehicle, puts its parameters back and ends; a second one ends at once.

    Args:
        url: The link.
        plan: Which entries.
        family: Which autopilot it has to be; None takes what is heard.
        system_id: Which system it has to be; None takes the first that is heard.
        watch: Called again and again while the session goes on.

    Raises:
        ConformanceError: The link cannot be opened, nobody is heard, or not who is wanted.
    """
    shell = _Shell(plan, family, system_id)
    try:
        link = await open_link(url, shell.receive)
    except (TransportError, CatalogueError) as error:
        raise ConformanceError(str(error)) from None
    shell.attach(link)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()

    def interrupt() -> None:
        if shell.session is None or shell.session.problem == "aborted":
            stop.set()
        else:
            shell.session.abort()

    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, interrupt)
    try:
        session = await _meet(url, shell, stop)
        while not session.finished and not stop.is_set():
            shell.advance()
            watch(session)
            await asyncio.sleep(_STEP_S)
        watch(session)
        if stop.is_set() and not session.finished:
            session.problem = "ended at once: the vehicle may still be flying"
        return session
    finally:
        for number in (signal.SIGINT, signal.SIGTERM):
            with contextlib.suppress(ValueError):
                loop.remove_signal_handler(number)
        link.close()


async def _meet(url: str, shell: _Shell, stop: asyncio.Event) -> Session:
    """Wait for the autopilot."""
    deadline_s = time.monotonic() + _CONNECT_S
    while shell.session is None:
        if stop.is_set():
            raise ConformanceError("interrupted before an autopilot was heard")
        if time.monotonic() > deadline_s:
            heard = f"; heard were: {'; '.join(sorted(shell.others))}" if shell.others else ""
            silence = f"{url}: no heartbeat of the autopilot within {_CONNECT_S:g} s{heard}"
            raise ConformanceError(f"{silence}. Is it started, and does it send here?")
        shell.advance()
        await asyncio.sleep(_STEP_S)
    return shell.session
