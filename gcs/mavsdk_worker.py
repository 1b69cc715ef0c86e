"""MAVSDK in a process of its own: orders as JSON lines on standard input, results as JSON lines on standard output.

MAVSDK runs threads and C++ of its own. Whatever happens to it happens here, and the ground station sees a process that
ended. It reaches the vehicles through the ground station's local port. Ends when its standard input does.

Run as ``python -m gcs.mavsdk_worker URL SYSTEM COMPONENT``. In: ``{"id": 1, "vehicle": 2, "action": "land", "until_s":
1.5}``; an order that is read after that monotonic time is not carried out. Out: ``{"id": 1, "result": "SUCCESS"}``, and
``{"vehicles": [1, 2]}`` when these change and every half second, as a sign of life.
"""

from __future__ import annotations

import json
import math
import os
import select
import sys
import threading
import time
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action import Action

__all__ = ["main"]

_LOOK_S = 0.25
_SIGN_OF_LIFE_S = 0.5
_ACTIONS = {"land": "land_async", "hold": "hold_async", "return": "return_to_launch_async", "stop": "kill_async"}


class _Results:
    """Where results go: a descriptor of its own, for MAVSDK logs to standard output, which becomes standard error."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._file = os.dup(sys.stdout.fileno())
        os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def say(self, **message: Any) -> None:
        """One line; MAVSDK calls back from a thread of its own."""
        with self._lock:
            os.write(self._file, json.dumps(message).encode() + b"\n")


class _Fleet:
    """The vehicles that MAVSDK has found."""

    def __init__(self, url: str, system_id: int, component_id: int, results: _Results) -> None:
        self._say = results.say
        configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
        configuration.system_id, configuration.component_id = system_id, component_id
        self.mavsdk = Mavsdk(configuration)
        result = self.mavsdk.add_any_connection(url)
        if result != 0:
            raise SystemExit(f"MAVSDK cannot open {url}: {result.name}")
        self._systems: dict[int, Any] = {}
        self._actions: dict[int, Any] = {}
        self._told: list[int] | None = None
        self._told_s = -math.inf

    def look(self) -> None:
        """Tell which vehicles are connected, when that has changed or nothing was told for a while."""
        if self.mavsdk.system_count() != len(self._systems):
            for system in self.mavsdk.get_systems():
                self._systems.setdefault(system.get_system_id(), system)
        connected = sorted(i for i, system in self._systems.items() if system.is_connected() and system.has_autopilot())
        now_s = time.monotonic()
        if connected != self._told or now_s - self._told_s >= _SIGN_OF_LIFE_S:
            self._told, self._told_s = connected, now_s
            self._say(vehicles=connected)

    def order(self, number: int, vehicle: int, action: str, until_s: float) -> None:
        """Start an action; its result is told when it is there."""
        if time.monotonic() > until_s:  # this process stood still: whoever ordered it has found another way
            self._say(id=number, result="TOO_LATE")
            return
        system = self._systems.get(vehicle)
        if system is None or not system.is_connected():
            self._say(id=number, result="NO_SYSTEM")
            return
        if vehicle not in self._actions:
            self._actions[vehicle] = Action(system)
        start = getattr(self._actions[vehicle], _ACTIONS[action])
        start(lambda result, _: self._say(id=number, result=result.name))


def main(arguments: list[str]) -> None:
    """Obey until standard input ends."""
    url, system_id, component_id = arguments
    fleet = _Fleet(url, int(system_id), int(component_id), _Results())
    fleet.look()
    pending = b""
    while True:
        if select.select([sys.stdin], [], [], _LOOK_S)[0]:
            data = os.read(sys.stdin.fileno(), 65536)
            if not data:
                break
            *lines, pending = (pending + data).split(b"\n")
            for line in lines:
                order = json.loads(line)
                fleet.order(order["id"], order["vehicle"], order["action"], order["until_s"])
        fleet.look()
    os._exit(0)  # nothing is worth waiting for MAVSDK's threads


if __name__ == "__main__":
    main(sys.argv[1:])
