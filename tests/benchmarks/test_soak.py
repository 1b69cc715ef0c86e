"""The soak's judgement: what leaks is found, what is steady passes."""

import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from benchmarks.soak import Minute, Sample, descendants, judge, look_at, name_of


def flight(
    rss_mb: Callable[[float], float] = lambda _: 300.0,
    files: Callable[[float], int] = lambda _: 20,
    pid: Callable[[float], int] = lambda _: 7,
) -> list[Sample]:
    times = [5.0 * index for index in range(1, 181)]
    return [Sample(t, "vehicle 1", pid(t), rss_mb(t), files(t), 4, 0.1 * t, 0.0) for t in times]


def minutes(
    delay_s: Callable[[int], float] = lambda _: 0.002, late: Callable[[int], int] = lambda _: 0
) -> list[Minute]:
    return [Minute(1, n, 60, late(n), 0.1, 0.14, delay_s(n), 0.01, 0.03) for n in range(15)]


def wrong(samples: list[Sample], late: list[Minute]) -> list[str]:
    return [verdict.what for verdict in judge(samples, late) if not verdict.holds]


def test_a_steady_flight_holds_also_when_it_grew_at_first() -> None:
    assert wrong(flight(rss_mb=lambda t: min(300.0, 200.0 + t)), minutes()) == []


def test_each_kind_of_leak_is_found() -> None:
    assert wrong(flight(rss_mb=lambda t: 300.0 + 0.05 * t), minutes()) == ["vehicle 1: resident memory, MB"]
    assert wrong(flight(files=lambda t: 20 + int(t > 600.0)), minutes()) == ["vehicle 1: files"]
    assert wrong(flight(pid=lambda t: 7 + int(t > 600.0)), minutes()) == ["vehicle 1: processes"]
    assert wrong(flight(), minutes(delay_s=lambda n: 0.002 * n)) == ["vehicle 1: a status's delay, ms"]
    assert wrong(flight(), minutes(late=lambda n: int(n == 9))) == ["vehicle 1: late plans, all and after settling"]
    gone = [sample for sample in flight() if sample.time_s < 700.0] + [Sample(900.0, "bridge", 8, 1.0, 1, 1, 0.0, 0.0)]
    assert "vehicle 1: lives all the time" in wrong(gone, minutes())


def test_a_short_flight_is_not_judged() -> None:
    with pytest.raises(ValueError, match="at least 420 s"):
        judge(flight()[:60], minutes())


def test_a_process_is_looked_at_and_its_children_are_found() -> None:
    with subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE) as child:
        assert child.pid in descendants(os.getpid())
        child.communicate(b"\n")
    sample = look_at(os.getpid(), 3.0)
    assert sample is not None
    assert sample.rss_mb > 10.0
    assert sample.files >= 3
    assert look_at(child.pid, 3.0) is None


def test_processes_are_told_by_their_arguments() -> None:
    assert name_of(["python", "-m", "onboard", "soak.yaml", "--vehicle", "3"]) == "vehicle 3"
    assert name_of(["python", "-m", "sim_bridge", "soak.yaml", "--seed", "1"]) == "bridge"
    assert name_of(["python", "leash.py", "77", "python", "-m", "onboard", "--vehicle", "3"]) is None
