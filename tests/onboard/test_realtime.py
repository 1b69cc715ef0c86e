"""Real-time priorities: taken where allowed, never inherited, never an error."""

import os
import threading

from onboard.realtime import Urgency, make_this_thread


def in_a_thread(urgency: Urgency) -> dict[str, object]:
    """What a thread sees of itself and of one that it starts; the test's own thread keeps its priority."""
    seen: dict[str, object] = {}

    def inherit() -> None:
        seen["child"] = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK

    def work() -> None:
        seen["allowed"] = make_this_thread(urgency)
        seen["policy"] = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK
        seen["priority"] = os.sched_getparam(0).sched_priority
        child = threading.Thread(target=inherit)
        child.start()
        child.join()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    return seen


def test_a_thread_is_urgent_if_allowed_and_ordinary_if_not() -> None:
    for urgency in Urgency:
        seen = in_a_thread(urgency)
        expected = (os.SCHED_RR, int(urgency)) if seen["allowed"] else (os.SCHED_OTHER, 0)
        assert (seen["policy"], seen["priority"]) == expected
        assert seen["child"] == os.SCHED_OTHER


def test_the_stream_goes_before_the_planner() -> None:
    assert Urgency.STREAMING > Urgency.PLANNING


def test_a_system_that_refuses_is_no_error(monkeypatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert not make_this_thread(Urgency.STREAMING)
