"""Keeps a slow browser from falling behind: nothing new is sent to one that has not yet seen what was sent before."""

from __future__ import annotations

import time
from collections.abc import Callable

from bokeh.models import CustomJS, Spinner

__all__ = ["Pulse", "PulseCount"]

_UNSEEN = 2
"""Updates that may be on their way at once."""

_FIRST_WAIT_S = 1.0
_LONGEST_WAIT_S = 20.0

_ANSWER = "pulse.value = pulse.tags[0]; document.documentElement.dataset.heard = Date.now();"
"""The page's own script watches for how long nothing has come."""


class PulseCount:
    """Counts updates sent and seen. A core without I/O.

    Args:
        clock: Monotonic time, s.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._sent = 0
        self._seen = 0
        self._wait_s = _FIRST_WAIT_S
        self._last_s = clock()

    @property
    def sent(self) -> int:
        """Number of the last update."""
        return self._sent

    def may_send(self) -> bool:
        """Whether to send an update now; then it counts as sent.

        A page that answers nothing gets one now and then: soon while it is new, for it does not answer what
        it was opened with, rarely once it has answered.
        """
        now_s = self._clock()
        if self._sent - self._seen >= _UNSEEN:
            if now_s - self._last_s < self._wait_s:
                return False
            self._wait_s = min(2.0 * self._wait_s, _LONGEST_WAIT_S)
        self._sent += 1
        self._last_s = now_s
        return True

    def seen(self, number: int) -> None:
        """The browser has seen this update."""
        self._seen = max(self._seen, min(number, self._sent))
        self._wait_s = _LONGEST_WAIT_S


class Pulse:
    """An invisible widget on the page that the browser answers with.

    Attributes:
        widget: To be placed anywhere on the page.
    """

    def __init__(self) -> None:
        self._count = PulseCount()
        self.widget = Spinner(value=0, tags=[0], visible=False)
        self.widget.js_on_change("tags", CustomJS(args={"pulse": self.widget}, code=_ANSWER))
        self.widget.on_change("value", lambda attr, old, new: self._count.seen(int(new or 0)))

    def may_send(self) -> bool:
        """Whether to send an update now; if so, the browser is asked to answer it."""
        if not self._count.may_send():
            return False
        self.widget.tags = [self._count.sent]
        return True
