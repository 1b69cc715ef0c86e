"""Real-time priority: taken where allowed, never inherited, laid down meanwhile, never an error."""

import os
import threading

import pytest

from onboard.realtime import make_this_thread_urgent, ordinary_meanwhile


def policy() -> int:
    return os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK


def in_a_thread() -> dict[str, object]:
    """What a thread sees of itself and of one that it starts; the test's own thread keeps its priority."""
    seen: dict[str, object] = {}

    def inherit() -> None:
        seen["child"] = policy()

    def work() -> None:
        seen["allowed"] = make_this_thread_urgent()
        seen["policy"] = policy()
        child = threading.Thread(target=inherit)
        child.start()
        child.join()
        with ordinary_meanwhile():
            seen["meanwhile"] = policy()
        seen["afterwards"] = policy()
        with pytest.raises(ZeroDivisionError), ordinary_meanwhile():
            _ = 1 // 0
        seen["after an error"] = policy()

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    return seen


def test_a_thread_is_urgent_if_allowed_and_ordinary_if_not() -> None:
    seen = in_a_thread()
    expected = os.SCHED_RR if seen["allowed"] else policy()
    assert seen["policy"] == seen["afterwards"] == seen["after an error"] == expected
    assert seen["child"] == seen["meanwhile"] == (os.SCHED_OTHER if seen["allowed"] else policy())


def test_an_ordinary_thread_stays_one() -> None:
    before = policy()  # of whoever runs the tests: ordinary, or idle
    with ordinary_meanwhile():
        assert policy() == before
    assert policy() == before


def test_a_system_that_refuses_is_no_error(monkeypatch) -> None:
    def refuse(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    assert not make_this_thread_urgent()
