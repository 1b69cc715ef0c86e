"""All rows of the fault suite, and those that every test run flies."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from sim_bridge.reliability.copter_cases import COPTER_CASES
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.px4_cases import ANYTIME, PX4_CASES

__all__ = ["ANYTIME", "CASES", "REPRESENTATIVE"]

CASES = (*PX4_CASES, *COPTER_CASES)
"""What happens at the beginning of a phase."""

REPRESENTATIVE: Mapping[Phase, tuple[str, ...]] = MappingProxyType(
    {
        Phase.TRACKING: (
            "radio: 30 % lost",
            "radio: off",
            "detector: ghosts",
            "mocap: off for 1.5 s",
            "mocap: repeats itself for 4 s",
            "autopilot: reboots",
            "autopilot link: off for 7 s",
            "process: killed",
            "process: killed, starts again after 1 s",
            "process: stopped for 3 s",
            "planner: hangs for good",
            "mocap: frozen, with noise, for 4 s",
            "mocap: jumps by 1.5 m",
            "battery: empty",
            "clock: jumps by 0.3 s for 5 s",
            "planner: fails for 3 s",
            "planner: nothing feasible for 3 s",
            "planner: 0.3 s late",
            "ground link: off for 6 s",
            "ArduPilot: process: killed",
            "ArduPilot: mocap: off for good",
        ),
        Phase.ARMING: (
            "autopilot: refuses to arm for 3 s",
            "autopilot: refuses to arm",
            "ground link: half lost",
        ),
        Phase.TOGETHER: ("radio: of one vehicle off",),
        Phase.RETURNING: ("process: killed", "autopilot: mode stuck for 5 s"),
    }
)
"""The flights that every test run flies; nearly every condition of the failsafe ladder is told in one of them."""
