"""``arvi mocap``: what a motion capture system shows of each vehicle, before anybody flies on it."""

from __future__ import annotations

import asyncio
import math
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.arguments import load, refuse
from gcs.checks import Check, Outcome

if TYPE_CHECKING:
    from onboard.config import Scenario
    from sim_bridge.mocap.bodies import Frame
    from sim_bridge.mocap.pose import MocapPose

__all__ = ["MocapView", "look_at_mocap", "mocap"]

_WINDOW_S = 2.0
_GOOD_SHARE = 0.7
"""Of mocap.rate_hz."""
_LEAST_RATE_HZ = 10.0
_OLD_S = 0.1
_FROZEN_S = 0.5
"""Two poses of a real camera system are never the same to the last bit."""


class MocapView:
    """What was seen lately of each body.

    Args:
        scenario: Has a section ``mocap``.
    """

    def __init__(self, scenario: Scenario) -> None:
        from sim_bridge.mocap.bodies import RigidBodies  # noqa: PLC0415

        assert scenario.mocap is not None
        self._names = {vehicle_id: name for name, vehicle_id in scenario.mocap.bodies.items()}
        self._rate_hz = scenario.mocap.rate_hz
        self._bodies = RigidBodies(scenario.mocap)
        self._last: dict[int, MocapPose] = {}
        self._moved_s: dict[int, float] = {}
        self._arrivals: dict[int, deque[float]] = {vehicle_id: deque() for vehicle_id in self._names}

    def receive(self, frame: Frame) -> None:
        """Take a frame."""
        for pose in self._bodies.poses(frame):
            last = self._last.get(pose.vehicle_id)
            if last is None or _place(last) != _place(pose):
                self._moved_s[pose.vehicle_id] = frame.received_s
            self._last[pose.vehicle_id] = pose
            self._arrivals[pose.vehicle_id].append(frame.received_s)

    def lines(self, now_s: float) -> list[str]:
        """One line for each body of the configuration, and one for what is no vehicle's; at a UNIX time, s."""
        lines = [self._line(vehicle_id, now_s) for vehicle_id in self._names]
        if self._bodies.unknown:
            lines.append(f"not in mocap.bodies: {', '.join(sorted(self._bodies.unknown))}")
        return lines

    def checks(self, now_s: float) -> list[Check]:
        """Whether each vehicle's body is seen often, lately and anew; at a UNIX time, s."""
        return [self._check(vehicle_id, now_s) for vehicle_id in self._names]

    def _check(self, vehicle_id: int, now_s: float) -> Check:
        name = f"motion capture of vehicle {vehicle_id}"
        wanted = f"body {self._names[vehicle_id]} at {self._rate_hz:g} Hz, not older than {_OLD_S:g} s"
        arrivals = self._recent(vehicle_id, now_s)
        if not arrivals:
            return Check(name, Outcome.FAIL, "not seen", wanted)
        rate_hz, age_s = len(arrivals) / _WINDOW_S, now_s - self._last[vehicle_id].time_s
        found = f"{rate_hz:.0f} Hz, {1e3 * age_s:.0f} ms old"
        frozen_s = now_s - self._moved_s[vehicle_id]
        if frozen_s > _FROZEN_S:
            return Check(name, Outcome.FAIL, f"{found}, the same pose for {frozen_s:.1f} s: frozen", wanted)
        if rate_hz < _LEAST_RATE_HZ:
            return Check(name, Outcome.FAIL, found, wanted)
        good = rate_hz >= _GOOD_SHARE * self._rate_hz and age_s <= _OLD_S
        return Check.of(name, Outcome.PASS if good else Outcome.WARN, found, wanted)

    def _recent(self, vehicle_id: int, now_s: float) -> deque[float]:
        arrivals = self._arrivals[vehicle_id]
        while arrivals and now_s - arrivals[0] > _WINDOW_S:
            arrivals.popleft()
        return arrivals

    def _line(self, vehicle_id: int, now_s: float) -> str:
        head = f"vehicle {vehicle_id} ({self._names[vehicle_id]}):"
        arrivals = self._recent(vehicle_id, now_s)
        if not arrivals:
            return f"{head} not seen"
        pose = self._last[vehicle_id]
        roll, pitch, yaw = (math.degrees(angle) for angle in pose.roll_pitch_yaw_rad)
        return (
            f"{head} {len(arrivals) / _WINDOW_S:5.1f} Hz, {1e3 * (now_s - pose.time_s):4.0f} ms old, "
            f"north {pose.north_m:7.3f} m, east {pose.east_m:7.3f} m, up {-pose.down_m:6.3f} m, "
            f"yaw {yaw:6.1f}°, roll {roll:5.1f}°, pitch {pitch:5.1f}°"
        )


def mocap(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="Scenario file with a section mocap.")],
    duration: Annotated[
        float, typer.Option(metavar="S", min=1.0, help="How long to look, s; until Ctrl-C unless given.")
    ] = math.inf,
) -> None:
    """Look at a motion capture system: rate, age and pose of each vehicle's body in the mission frame, once a second.

    **Example**: `arvi mocap lab.yaml`, then carry a vehicle north, east and up, and turn it.
    """
    scenario = load(config)
    if scenario.mocap is None:
        refuse(f"{config}: has no section mocap, so there is no system to look at (docs/mocap.md)")
    try:
        asyncio.run(_look(scenario, duration))
    except KeyboardInterrupt:
        return


async def _look(scenario: Scenario, duration_s: float) -> None:
    def tell(view: MocapView) -> None:
        for line in view.lines(time.time()):
            typer.echo(line)

    await look_at_mocap(scenario, duration_s, tell, typer.echo)


async def look_at_mocap(
    scenario: Scenario, duration_s: float, show: Callable[[MocapView], None], say: Callable[[str], None]
) -> None:
    """Read a motion capture system for a while.

    Args:
        scenario: Has a section ``mocap``.
        duration_s: How long, s.
        show: Called once a second with what was seen.
        say: Called with what an operator should know of the reader.
    """
    from sim_bridge.mocap.library import LibraryReader  # noqa: PLC0415

    assert scenario.mocap is not None
    view = MocapView(scenario)
    reader = asyncio.ensure_future(LibraryReader(scenario.mocap, view.receive, lambda notice: say(notice.text)).run())
    end_s = time.monotonic() + duration_s
    try:
        while time.monotonic() < end_s and not reader.done():
            await asyncio.sleep(1.0)
            show(view)
    finally:
        reader.cancel()
        await asyncio.wait([reader])


def _place(pose: MocapPose) -> tuple[float, ...]:
    return (pose.north_m, pose.east_m, pose.down_m, *pose.attitude)
