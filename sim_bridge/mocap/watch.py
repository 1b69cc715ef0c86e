"""What is wrong with the poses that motion capture delivers; said once when it begins and once when it ends.

A pose that repeats to the last bit is no measurement: many systems go on telling the last pose of a body that they have
lost. An autopilot that is fed with it takes it for the truth (a tenth of a second of it bends a fast vehicle's velocity
by half a metre per second), and its vehicle drifts off unseen; one that is fed with nothing knows that it has lost its
position source, and fails safe. So no repetition is to be handed on, not even the first one.
"""

from __future__ import annotations

import math
from collections import deque
from enum import Enum

from onboard.protocol import dialect as mavlink
from sim_bridge.mocap.pose import MocapPose
from sim_bridge.notices import Notice

__all__ = ["Trouble", "Watch"]

_SILENT_PERIODS = 10
_MIN_SILENCE_S = 0.25
_WINDOW_S = 2.0
_SLOW_SHARE = 0.7
_SLOW_ENDS_SHARE = 0.85
_FROZEN_S = 0.1
"""What repeats itself for longer is told: systems that send more often than their cameras look repeat themselves."""
_LATE_S = 0.15
_MAX_SPEED_M_S = 15.0
_CALM_S = 2.0
"""After the last jump, until jumping is over."""


class Trouble(Enum):
    """What can be wrong."""

    SILENT = "silent"
    SLOW = "slow"
    FROZEN = "frozen"
    JUMPING = "jumping"
    LATE = "late"


class Watch:
    """Looks at the poses of one vehicle.

    Args:
        vehicle_id: Whose.
        rate_hz: What should arrive.
        jump_m: A step from one pose to the next that no vehicle can fly, m, beside what its speed allows.
        noisy: Whether a measurement that repeats itself exactly is impossible.
    """

    def __init__(self, vehicle_id: int, rate_hz: float, jump_m: float, *, noisy: bool) -> None:
        self._name = f"motion capture of vehicle {vehicle_id}"
        self._rate_hz = rate_hz
        self._jump_m = jump_m
        self._noisy = noisy
        self._silence_s = max(_MIN_SILENCE_S, _SILENT_PERIODS / rate_hz)
        self._last: MocapPose | None = None
        self._last_s = -math.inf
        self._changed_s = -math.inf
        self._jump_s = -math.inf
        self._arrivals: deque[float] = deque()
        self._since: dict[Trouble, float] = {}
        self._notices: list[Notice] = []

    @property
    def troubles(self) -> frozenset[Trouble]:
        """What is wrong now."""
        return frozenset(self._since)

    def receive(self, pose: MocapPose, time_s: float) -> bool:
        """A pose has arrived at a UNIX time (s); whether an autopilot may have it."""
        self._set(Trouble.SILENT, False, time_s)
        last = self._last
        repeats = last is not None and pose.position == last.position and pose.attitude == last.attitude
        if not repeats:
            self._changed_s = time_s
        if last is not None:
            step_m = math.dist(pose.position, last.position)
            if step_m > self._jump_m + _MAX_SPEED_M_S * max(pose.time_s - last.time_s, 0.0):
                self._jump_s = time_s
                self._set(Trouble.JUMPING, True, time_s, f" ({step_m:.2f} m from one pose to the next)")
        age_s = time_s - pose.time_s
        self._set(Trouble.LATE, age_s > _LATE_S, time_s, f" ({1e3 * age_s:.0f} ms old)")
        if time_s - self._last_s > _WINDOW_S:
            self._arrivals.clear()
        self._arrivals.append(time_s)
        self._last, self._last_s = pose, time_s
        self._set(Trouble.FROZEN, self._noisy and time_s - self._changed_s > _FROZEN_S, time_s)
        return not (self._noisy and repeats)

    def step(self, time_s: float) -> None:
        """Let time pass until a UNIX time (s); a body that was never seen is not missed."""
        if self._last is None:
            return
        silent = time_s - self._last_s > self._silence_s
        self._set(Trouble.SILENT, silent, time_s, since_s=self._last_s)
        if silent:
            return
        if time_s - self._jump_s > _CALM_S:
            self._set(Trouble.JUMPING, False, time_s)
        while self._arrivals and time_s - self._arrivals[0] > _WINDOW_S:
            self._arrivals.popleft()
        if len(self._arrivals) > 1 and self._arrivals[-1] - self._arrivals[0] > 0.75 * _WINDOW_S:
            rate_hz = (len(self._arrivals) - 1) / (self._arrivals[-1] - self._arrivals[0])
            share = _SLOW_ENDS_SHARE if Trouble.SLOW in self._since else _SLOW_SHARE
            self._set(
                Trouble.SLOW, rate_hz < share * self._rate_hz, time_s, f" ({rate_hz:.0f} of {self._rate_hz:.0f} Hz)"
            )

    def notices(self) -> list[Notice]:
        """Take out what an operator should know."""
        taken, self._notices = self._notices, []
        return taken

    def _set(
        self, trouble: Trouble, present: bool, time_s: float, detail: str = "", *, since_s: float | None = None
    ) -> None:
        began_s = self._since.get(trouble)
        if present and began_s is None:
            self._since[trouble] = time_s if since_s is None else since_s
            self._notices.append(Notice(f"{self._name} is {trouble.value}{detail}", mavlink.MAV_SEVERITY_WARNING))
        elif not present and began_s is not None:
            del self._since[trouble]
            text = f"{self._name} is no longer {trouble.value}, after {time_s - began_s:.1f} s"
            self._notices.append(Notice(text, mavlink.MAV_SEVERITY_NOTICE))
