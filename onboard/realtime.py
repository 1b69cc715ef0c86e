"""Real-time priorities for the threads of a flight computer, where the system allows them.

The setpoint stream goes before the planner, and both before ordinary programs. The planner needs one, too: whenever it
holds Python's interpreter lock while an ordinary program holds its processor, the stream would wait for both.
"""

from __future__ import annotations

import os
from enum import IntEnum

__all__ = ["Urgency", "make_this_thread"]


class Urgency(IntEnum):
    """Round-robin real-time priorities, the least that keep this order."""

    PLANNING = 1
    STREAMING = 2


def make_this_thread(urgency: Urgency) -> bool:
    """Give this thread a real-time priority; threads that it starts do not inherit it.

    Needs CAP_SYS_NICE or an RTPRIO limit (systemd: ``LimitRTPRIO=2``).

    Returns:
        Whether the system allowed it; if not, nothing is changed.
    """
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(urgency))
    except (AttributeError, OSError):  # not Linux; not permitted
        return False
    return True
