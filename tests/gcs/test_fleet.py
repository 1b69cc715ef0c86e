"""Orders through MAVSDK's process: the core's verdicts, and a shell that no worker can hurt."""

import asyncio
import json
import sys
import time

import pytest

from gcs.fleet import FleetAction, FleetClient, FleetOutcome, FleetProcess, Verdict


@pytest.mark.parametrize(
    ("result", "verdict", "reason"),
    [
        ("SUCCESS", Verdict.ACCEPTED, ""),
        ("COMMAND_DENIED", Verdict.REFUSED, "command denied"),
        ("TIMEOUT", Verdict.TIMED_OUT, "no answer"),
        ("NO_SYSTEM", Verdict.UNAVAILABLE, "MAVSDK has not heard this vehicle"),
        ("BUSY", Verdict.UNAVAILABLE, "busy"),
    ],
)
def test_mavsdks_results_as_verdicts(result, verdict, reason):
    client = FleetClient()
    asked = json.loads(client.request(FleetAction.LAND, 2, 0.0))
    assert (asked["vehicle"], asked["action"]) == (2, "land")
    answer = json.dumps({"id": asked["id"], "result": result}).encode()
    assert client.receive(answer, 0.0) == FleetOutcome(2, FleetAction.LAND, verdict, reason)
    assert client.receive(answer, 0.0) is None, "an order ends once"


def test_a_worker_that_hangs_or_dies_leaves_no_order_open():
    client = FleetClient()
    client.receive(b'{"vehicles": [1, 2]}', 0.0)
    client.request(FleetAction.STOP, 1, 0.0)
    client.request(FleetAction.HOLD, 2, 1.0)
    assert client.overdue(2.4) == []
    assert not client.hangs(2.4)
    assert [(o.vehicle, o.verdict) for o in client.overdue(2.5)] == [(1, Verdict.UNAVAILABLE)]
    assert client.hangs(2.5), "it has left an order unanswered"
    assert [(o.vehicle, o.verdict) for o in client.worker_ended()] == [(2, Verdict.UNAVAILABLE)]
    assert not client.hangs(2.5)
    assert not client.reaches(1, 2.5)
    assert client.overdue(99.0) == []


def test_a_worker_that_falls_silent_gets_no_orders_and_hangs_after_four_seconds():
    client = FleetClient()
    assert not client.hangs(99.0), "it takes a while to start"
    client.receive(b'{"vehicles": [1]}', 100.0)
    assert client.reaches(1, 101.4)
    assert not client.reaches(1, 101.5)
    assert not client.hangs(103.9)
    assert client.hangs(104.0)
    client.receive(b'{"vehicles": [1]}', 104.0)
    assert client.reaches(1, 104.0)
    assert not client.hangs(104.0)


@pytest.mark.parametrize(
    "line", [b"", b"[INFO] MAVSDK version", b"17", b'{"id": [1]}', b'{"id": 99, "result": "SUCCESS"}']
)
def test_other_lines_are_ignored(line):
    assert FleetClient().receive(line, 0.0) is None


WORKER = """
import json, select, sys, time
print("a log line of some library", flush=True)
print(json.dumps({"vehicles": [1]}), flush=True)
while True:
    if not select.select([sys.stdin], [], [], 0.25)[0]:
        print(json.dumps({"vehicles": [1]}), flush=True)
        continue
    order = json.loads(sys.stdin.readline())
    if order["action"] == "hold":
        time.sleep(100)
    if order["action"] == "stop":
        sys.exit("it broke")
    print(json.dumps({"id": order["id"], "result": "SUCCESS"}), flush=True)
"""


async def until(condition, limit_s=10.0):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end
        await asyncio.sleep(0.02)


async def test_a_worker_that_dies_is_told_and_started_again():
    told = []
    fleet = FleetProcess(1, (255, 25), told.append, program=[sys.executable, "-c", WORKER])
    assert not fleet.order(FleetAction.LAND, 1), "it does not run yet"
    fleet.start()
    outcomes = []
    try:
        await until(lambda: fleet.reaches(1))
        assert not fleet.order(FleetAction.LAND, 2), "a vehicle that it does not know"
        assert fleet.order(FleetAction.LAND, 1)
        await until(lambda: outcomes.extend(fleet.poll()) or outcomes)
        assert outcomes == [FleetOutcome(1, FleetAction.LAND, Verdict.ACCEPTED, "")]
        assert fleet.order(FleetAction.STOP, 1)
        outcomes.clear()
        await until(lambda: outcomes.extend(fleet.poll()) or outcomes)
        assert outcomes == [FleetOutcome(1, FleetAction.STOP, Verdict.UNAVAILABLE, "MAVSDK ended")]
        assert "exit code 1: it broke" in told[0]
        await until(lambda: fleet.reaches(1))
        assert fleet.order(FleetAction.HOLD, 1)
        outcomes.clear()
        await until(lambda: outcomes.extend(fleet.poll()) or outcomes)
        assert outcomes == [FleetOutcome(1, FleetAction.HOLD, Verdict.UNAVAILABLE, "MAVSDK does not answer")]
        await until(lambda: len(told) == 2)
        assert "it did not answer" in told[1], "one that hangs is ended: it might obey in a minute"
    finally:
        await fleet.stop()
