"""``arvi mocap``: what a motion capture system shows of each vehicle, before anybody flies on it."""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from onboard.config import Scenario
    from sim_bridge.mocap.bodies import Frame
    from sim_bridge.mocap.pose import MocapPose

__all__ = ["MocapView", "mocap"]

_BAD_INPUT = 2
_WINDOW_S = 2.0


class MocapView:
    """What was seen lately of each body.

    Args:
        scenario: Has a section ``mocap``.
    """

    def __init__(self, scenario: Scenario) -> None:
        from sim_bridge.mocap.bodies import RigidBodies  # noqa: PLC0415

        assert scenario.mocap is not None
        self._names = {vehicle_id: name for name, vehicle_id in scenario.mocap.bodies.items()}
        self._bodies = RigidBodies(scenario.mocap)
        self._last: dict[int, MocapPose] = {}
        self._arrivals: dict[int, deque[float]] = {vehicle_id: deque() for vehicle_id in self._names}

    def receive(self, frame: Frame) -> None:
        """Take a frame."""
        for pose in self._bodies.poses(frame):
            self._last[pose.vehicle_id] = pose
            self._arrivals[pose.vehicle_id].append(frame.received_s)

    def lines(self, now_s: float) -> list[str]:
        """One line for each body of the configuration, and one for what is no vehicle's; at a UNIX time, s."""
        lines = [self._line(vehicle_id, now_s) for vehicle_id in self._names]
        if self._bodies.unknown:
            lines.append(f"not in mocap.bodies: {', '.join(sorted(self._bodies.unknown))}")
        return lines

    def _line(self, vehicle_id: int, now_s: float) -> str:
        head = f"vehicle {vehicle_id} ({self._names[vehicle_id]}):"
        arrivals = self._arrivals[vehicle_id]
        while arrivals and now_s - arrivals[0] > _WINDOW_S:
            arrivals.popleft()
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
    from onboard.config import ConfigError, load_scenario  # noqa: PLC0415

    try:
        scenario = load_scenario(config)
    except ConfigError as error:
        sys.stderr.write(f"{error}\n")
        raise typer.Exit(_BAD_INPUT) from None
    if scenario.mocap is None:
        sys.stderr.write(f"{config}: has no section mocap, so there is no system to look at (docs/mocap.md)\n")
        raise typer.Exit(_BAD_INPUT)
    try:
        asyncio.run(_look(scenario, duration))
    except KeyboardInterrupt:
        return


async def _look(scenario: Scenario, duration_s: float) -> None:
    from sim_bridge.mocap.library import LibraryReader  # noqa: PLC0415

    assert scenario.mocap is not None
    view = MocapView(scenario)
    reader = asyncio.ensure_future(
        LibraryReader(scenario.mocap, view.receive, lambda notice: typer.echo(notice.text)).run()
    )
    end_s = time.monotonic() + duration_s
    try:
        while time.monotonic() < end_s and not reader.done():
            await asyncio.sleep(1.0)
            for line in view.lines(time.time()):
                typer.echo(line)
    finally:
        reader.cancel()
        await asyncio.wait([reader])
