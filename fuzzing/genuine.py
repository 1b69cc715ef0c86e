"""What a well-behaved team says in a mission of the lab; hostile frames are damaged copies of it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.team_messages import primitives_checksum

__all__ = ["BEGUN_S", "HEALTHY", "LAB", "OFFBOARD", "START_S", "belief", "plan", "status", "tile"]

LAB = load_scenario(Path(__file__).parent.parent / "configs" / "lab.yaml")
BEGUN_S = 1_800_000_000.0
"""UNIX time at which everything begins, s."""

START_S = BEGUN_S + 10.0
"""UNIX time of step 0, s."""

OFFBOARD = 6 << 16

HEALTHY = mavlink.MAVLink_sys_status_message(
    0, 0, mavlink.MAV_SYS_STATUS_PREARM_CHECK, 0, 0, 0, battery_remaining=100,
    drop_rate_comm=0, errors_comm=0, errors_count1=0, errors_count2=0, errors_count3=0, errors_count4=0,
)  # fmt: skip

_CHECKSUM = primitives_checksum(LAB.primitive_set)


def _usec(time_s: float) -> int:
    """The step nearest to a UNIX time."""
    step = round((time_s - START_S) / LAB.mission.step_s)
    return round(1e6 * (START_S + step * LAB.mission.step_s))


def belief(time_s: float) -> mavlink.MAVLink_target_belief_message:
    """Of target 2."""
    vector, matrix = [8.0, 16.0, 0.0, 0.0], [4.0, 0.0, 4.0, *[0.0] * 7]
    return mavlink.MAVLink_target_belief_message(_usec(time_s), vector, matrix, 2, 1, 1)


def plan(time_s: float) -> mavlink.MAVLink_arvi_plan_message:
    """Straight ahead."""
    controls = [0] * 64
    return mavlink.MAVLink_arvi_plan_message(
        _usec(time_s), 2.0, 4.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 100, 10, _CHECKSUM, controls, 12, 3
    )


def status(time_s: float) -> mavlink.MAVLink_planner_status_message:
    """In the mission, over its place."""
    kind = mavlink.MAVLink_planner_status_message
    fields: dict[str, Any] = {
        name: [0] * length if length else 0
        for name, length in zip(kind.ordered_fieldnames, kind.array_lengths, strict=True)
    }
    fields |= {"time_usec": _usec(time_s), "mission_start_usec": round(1e6 * START_S), "north": 2.0, "east": 6.0}
    fields |= {"down": -1.7, "state": 5, "group_size": 2, "neighbours": [1] + [0] * 31}
    return kind(**fields)


def tile() -> mavlink.MAVLink_explored_tile_message:
    """All of it is explored."""
    return mavlink.MAVLink_explored_tile_message(0, 0, round(1000 * LAB.exploration.cell_m), [255] * 128, 123)
