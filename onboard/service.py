"""Tells systemd how the onboard process is: sd_notify(3)'s protocol, one datagram for each state.

The pings of the watchdog come from the loop that streams setpoints, after a tick's frames are sent: whoever hangs there
is started anew by systemd, while the autopilot has long been in its failsafe.
"""

from __future__ import annotations

import contextlib
import math
import os
import socket
from collections.abc import Mapping

__all__ = ["NotifySocket", "ServiceReport"]

PINGS_PER_WATCHDOG = 4
"""sd_watchdog_enabled(3) advises two; more forgive a busy machine."""
STATUS_PERIOD_S = 1.0


class ServiceReport:
    """What is due to be told, without sockets.

    Args:
        watchdog_s: Silence after which systemd acts, s; None where it does not watch.
    """

    def __init__(self, watchdog_s: float | None = None) -> None:
        self._ping_period_s = math.inf if watchdog_s is None else watchdog_s / PINGS_PER_WATCHDOG
        self._next_ping_s = -math.inf if watchdog_s is not None else math.inf
        self._next_status_s = -math.inf
        self._status = ""
        self._ready = False

    def wants_status(self, time_s: float) -> bool:
        """Whether a new text would be told; it need not be made otherwise."""
        return time_s >= self._next_status_s

    def ticked(self, time_s: float, status: str | None = None) -> list[str]:
        """The loop has turned; what to tell.

        Args:
            time_s: Of a clock that never jumps, s.
            status: What it is doing, one line; None leaves what was said.
        """
        states = []
        if not self._ready:
            self._ready = True
            states.append("READY=1")
        if status is not None:
            self._next_status_s = time_s + STATUS_PERIOD_S
            if status != self._status:
                self._status = status
                states.append(f"STATUS={' '.join(status.split())}")
        if time_s >= self._next_ping_s:
            self._next_ping_s = time_s + self._ping_period_s
            states.append("WATCHDOG=1")
        return states


class NotifySocket:
    """Where systemd listens; does nothing where there is no systemd, or it does not ask.

    Args:
        address: ``NOTIFY_SOCKET``: a path, or a name in the abstract namespace after ``@``; None is nowhere.
        watchdog_s: Silence after which systemd acts, s; None if it does not watch this process.
    """

    def __init__(self, address: str | None, watchdog_s: float | None = None) -> None:
        self.watchdog_s = watchdog_s
        self._socket: socket.socket | None = None
        if address is not None:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
            self._address = "\0" + address[1:] if address.startswith("@") else address

    @classmethod
    def of(cls, environment: Mapping[str, str]) -> NotifySocket:
        """As systemd says in the environment; a watchdog that is meant for another process is none."""
        address = environment.get("NOTIFY_SOCKET")
        if not address or address[0] not in "/@":
            return cls(None)
        watchdog_s = None
        with contextlib.suppress(KeyError, ValueError):
            if int(environment.get("WATCHDOG_PID", os.getpid())) == os.getpid():
                watchdog_s = int(environment["WATCHDOG_USEC"]) / 1e6
        return cls(address, watchdog_s)

    def send(self, states: list[str]) -> None:
        """Tell states; a socket that is full or gone never stops the caller."""
        if states and self._socket is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto("\n".join(states).encode(), self._address)

    def close(self) -> None:
        """Tell nothing more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
