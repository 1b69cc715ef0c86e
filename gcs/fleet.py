"""Orders that go straight to the autopilots, through MAVSDK in a process of its own (``mavsdk_worker.py``).

:class:`FleetClient` is the core: orders and lines in, lines and outcomes out. :class:`FleetProcess` is its shell: it
starts the worker, starts it again when it dies, and never makes the ground station wait.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib.util
import json
import os
import shutil
import sys
import tempfile
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from gcs.leash import leashed
from gcs.output import printable

__all__ = ["FleetAction", "FleetClient", "FleetOutcome", "FleetProcess", "Verdict"]

_PATIENCE_S = 2.5
"""MAVSDK itself repeats a command for 1.5 s; a worker that has not answered an order after so long hangs."""

_QUIET_S = 1.5
"""The worker says something every half second; after so long a silence no order is entrusted to it."""

_HANGS_S = 4.0
"""Silence after which a worker hangs."""

_RESTART_S = (1.0, 2.0, 5.0, 10.0, 30.0)
_LAST_LINES = 3


class FleetAction(Enum):
    """What an autopilot can be told; the value is the worker's word for it."""

    LAND = "land"
    HOLD = "hold"
    RETURN = "return"
    STOP = "stop"


class Verdict(Enum):
    """How an order ended."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    TIMED_OUT = "timed out"
    UNAVAILABLE = "unavailable"


@dataclass(frozen=True, slots=True)
class FleetOutcome:
    """How an order to one vehicle ended.

    Attributes:
        vehicle: System id.
        action: What was ordered.
        verdict: Unavailable is what never reached the autopilot, because MAVSDK could not send it.
        reason: In words; empty when accepted.
    """

    vehicle: int
    action: FleetAction
    verdict: Verdict
    reason: str


_VERDICTS = {
    "SUCCESS": Verdict.ACCEPTED,
    "TIMEOUT": Verdict.TIMED_OUT,
    "NO_SYSTEM": Verdict.UNAVAILABLE,
    "CONNECTION_ERROR": Verdict.UNAVAILABLE,
    "BUSY": Verdict.UNAVAILABLE,
    "UNKNOWN": Verdict.UNAVAILABLE,
}
"""By MAVSDK's ActionResult; every other result is a refusal."""

_REASONS = {"NO_SYSTEM": "MAVSDK has not heard this vehicle", "TIMEOUT": "no answer"}


@dataclass(frozen=True, slots=True)
class _Order:
    vehicle: int
    action: FleetAction
    until_s: float


class FleetClient:
    """Orders under way, by number. Times are in s of the clock that the worker has, too."""

    def __init__(self) -> None:
        self._vehicles: tuple[int, ...] = ()
        self._orders: dict[int, _Order] = {}
        self._next = 1
        self._said_s: float | None = None
        self._failed = False

    def reaches(self, vehicle: int, now_s: float) -> bool:
        """Whether MAVSDK is connected to a vehicle, and the worker is awake."""
        return vehicle in self._vehicles and self._said_s is not None and now_s - self._said_s < _QUIET_S

    def hangs(self, now_s: float) -> bool:
        """Whether the worker is alive no more: an order went unanswered, or it has been silent for long."""
        return self._failed or (self._said_s is not None and now_s - self._said_s >= _HANGS_S)

    def request(self, action: FleetAction, vehicle: int, now_s: float) -> bytes:
        """The line that orders an action; one outcome will follow, and a worker that reads it too late ignores it."""
        number, self._next = self._next, self._next + 1
        until_s = now_s + _PATIENCE_S
        self._orders[number] = _Order(vehicle, action, until_s)
        order = {"id": number, "vehicle": vehicle, "action": action.value, "until_s": until_s}
        return json.dumps(order).encode() + b"\n"

    def receive(self, line: bytes, now_s: float) -> FleetOutcome | None:
        """Take a line of the worker; the outcome if it ends an order. What is no such line is ignored."""
        self._said_s = now_s
        try:
            said = json.loads(line)
        except ValueError:
            return None
        if not isinstance(said, dict):
            return None
        if isinstance(vehicles := said.get("vehicles"), list):
            self._vehicles = tuple(vehicles)
            return None
        number = said.get("id")
        order = self._orders.pop(number, None) if isinstance(number, int) else None
        if order is None:
            return None
        result = str(said.get("result"))
        verdict = _VERDICTS.get(result, Verdict.REFUSED)
        reason = "" if verdict is Verdict.ACCEPTED else _REASONS.get(result, result.lower().replace("_", " "))
        return FleetOutcome(order.vehicle, order.action, verdict, reason)

    def overdue(self, now_s: float) -> list[FleetOutcome]:
        """Orders that a worker which hangs has not answered."""
        overdue = [number for number, order in self._orders.items() if now_s >= order.until_s]
        self._failed = self._failed or bool(overdue)
        return self._end(overdue, "MAVSDK does not answer")

    def worker_ended(self) -> list[FleetOutcome]:
        """The worker is gone, and with it all orders under way."""
        self._vehicles = ()
        self._said_s, self._failed = None, False
        return self._end(list(self._orders), "MAVSDK ended")

    def _end(self, numbers: list[int], reason: str) -> list[FleetOutcome]:
        orders = [self._orders.pop(number) for number in numbers]
        return [FleetOutcome(order.vehicle, order.action, Verdict.UNAVAILABLE, reason) for order in orders]


class FleetProcess:
    """Runs the worker beside an event loop.

    Args:
        port: UDP port of the ground station on this machine.
        identity: System and component id that MAVSDK takes.
        tell: Called with a sentence when the worker comes or goes.
        program: Another program in the worker's place, for tests.
        clock: The system's monotonic time, s, which the worker reads, too.

    Attributes:
        outcomes: Ended orders, to be taken away by the reader.
    """

    def __init__(
        self,
        port: int,
        identity: tuple[int, int],
        tell: Callable[[str], None],
        *,
        program: list[str] | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        url = f"udpout://127.0.0.1:{port}"
        self.outcomes: deque[FleetOutcome] = deque()
        self._program = program or [sys.executable, "-m", "gcs.mavsdk_worker", url, *map(str, identity)]
        self._needs_mavsdk = program is None
        self._tell = tell
        self._clock = clock
        self._client = FleetClient()
        self._process: asyncio.subprocess.Process | None = None
        self._task: asyncio.Task[None] | None = None
        self._folder: str | None = None
        self._hung = False

    def start(self) -> None:
        """Start the worker, in the running event loop."""
        if self._needs_mavsdk and importlib.util.find_spec("mavsdk") is None:
            self._tell(
                "MAVSDK is not installed: orders go to the autopilots directly over MAVLink (pip install mavsdk)"
            )
            return
        # MAVSDK leaves folders behind in the temporary folder: it gets one of its own, which goes with it.
        self._folder = tempfile.mkdtemp(prefix="arvi-mavsdk-")
        self._task = asyncio.get_running_loop().create_task(self._keep_running(), name="fleet")

    async def stop(self) -> None:
        """End the worker, and wait for it to be gone."""
        if self._task is not None:
            self._task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await self._task
            self._task = None
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
            self._folder = None

    def reaches(self, vehicle: int) -> bool:
        """Whether MAVSDK is connected to a vehicle."""
        return self._process is not None and self._client.reaches(vehicle, self._clock())

    def order(self, action: FleetAction, vehicle: int) -> bool:
        """Order an action; False, and no outcome, if MAVSDK cannot pass it on now."""
        process = self._process
        if process is None or process.stdin is None or process.stdin.is_closing() or not self.reaches(vehicle):
            return False
        process.stdin.write(self._client.request(action, vehicle, self._clock()))
        return True

    def poll(self) -> list[FleetOutcome]:
        """The outcomes since the last call; a worker that hangs is ended, lest it obey when nobody expects it."""
        now_s = self._clock()
        self.outcomes.extend(self._client.overdue(now_s))
        if self._process is not None and self._client.hangs(now_s):
            self._hung = True
            with contextlib.suppress(ProcessLookupError):
                self._process.kill()
        ended = list(self.outcomes)
        self.outcomes.clear()
        return ended

    async def _keep_running(self) -> None:
        failures = 0
        while True:
            began = self._clock()
            try:
                reason = await self._run_once()
            except OSError as error:
                reason = error.strerror or str(error)
            self.outcomes.extend(self._client.worker_ended())
            failures = failures + 1 if self._clock() - began < _RESTART_S[-1] else 1
            wait_s = _RESTART_S[min(failures, len(_RESTART_S)) - 1]
            self._tell(
                f"MAVSDK ended ({reason}); again in {wait_s:.0f} s, until then orders go to the autopilots directly"
            )
            await asyncio.sleep(wait_s)

    async def _run_once(self) -> str:
        """One life of the worker; why it ended."""
        pipe = asyncio.subprocess.PIPE
        environment = {**os.environ, **({"TMPDIR": self._folder} if self._folder is not None else {})}
        process = await asyncio.create_subprocess_exec(
            *leashed(self._program), stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True, env=environment
        )
        self._process = process
        assert process.stdout is not None
        assert process.stderr is not None
        last_words: deque[str] = deque(maxlen=_LAST_LINES)
        log = asyncio.create_task(_read_log(process.stderr, last_words))
        try:
            while line := await process.stdout.readline():
                outcome = self._client.receive(line, self._clock())
                if outcome is not None:
                    self.outcomes.append(outcome)
            code = await process.wait()
            await log
        finally:
            if process.returncode is None:
                with contextlib.suppress(ProcessLookupError):
                    process.kill()
                await process.wait()
            log.cancel()
            self._process = None
            hung, self._hung = self._hung, False
        if hung:
            return "it did not answer"
        if code < 0:
            return f"killed by signal {-code}"
        return f"exit code {code}{': ' if last_words else ''}{last_words[-1] if last_words else ''}"


async def _read_log(stream: asyncio.StreamReader, last_words: deque[str]) -> None:
    """Keep the worker's last words, and its pipe empty."""
    while chunk := await stream.read(65536):
        last_words.extend(printable(line) for line in chunk.decode("utf-8", "replace").splitlines() if line.strip())
