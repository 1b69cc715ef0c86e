"""Real-time priority for the threads of a flight computer that must not wait, where the system allows it.

The setpoint stream goes before ordinary programs. So does a planner's thread while it holds Python's interpreter lock:
if it lost its processor meanwhile, the stream would wait for both. While its compiled search runs it holds no lock and
is an ordinary thread.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["make_this_thread_urgent", "ordinary_meanwhile"]

_PRIORITY = 1


def make_this_thread_urgent() -> bool:
    """Give this thread the lowest round-robin real-time priority; threads that it starts do not inherit it.

    Needs CAP_SYS_NICE or an RTPRIO limit (systemd: ``LimitRTPRIO=1``).

    Returns:
        Whether the system allowed it; if not, nothing is changed.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(_PRIORITY))
    except (AttributeError, OSError):  # not Linux; not permitted
        return False
    return True


@contextmanager
def ordinary_meanwhile() -> Iterator[None]:
    """Around long work without the interpreter lock: an urgent thread is an ordinary one inside."""
    urgent = hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_RR
    if urgent:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    try:
        yield
    finally:
        if urgent:
            make_this_thread_urgent()
