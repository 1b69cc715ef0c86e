"""Rows that are flown with ArduPilot, too, and what it does otherwise than PX4.

Where setpoints stop it tells nobody: after GUID_TIMEOUT (1 s in the lab) it stops in GUIDED and hovers until somebody
lands it, or its onboard process is back and flies on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from onboard.flight.failsafes import RULES, Condition
from sim_bridge.reliability.case import Case, Expected
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.px4_cases import LINK_LOST_S, PX4_CASES, SILENT_FENCE_M
from sim_bridge.reliability.reactions import (
    CARRIES_ON,
    COMES_TO_REST,
    FLIES_IN_THE_END,
    HOLDS,
    LANDS_HERE,
    SAFE_ALONE,
    all_of,
    says,
)

__all__ = ["COPTER_CASES"]

_PHASES = (Phase.TRACKING, Phase.RETURNING, Phase.LANDING)

_RESTS = Expected(COMES_TO_REST, 3.0, fence_m=SILENT_FENCE_M, ground_lands=True)
"""GUID_TIMEOUT, and what braking takes."""

_LINK_LOST = says("autopilot link lost")
_LINK_OFF = replace(_RESTS, reaction=all_of(COMES_TO_REST, _LINK_LOST), deadline_s=LINK_LOST_S)
_BACK = Expected(FLIES_IN_THE_END, fence_m=SILENT_FENCE_M)
_LANDS_ALONE = Expected(SAFE_ALONE, 1.2)
"""It lands already, as its next heartbeat says."""


def _as_px4(name: str) -> Case:
    """What is expected of PX4 is expected of ArduPilot."""
    case = _px4(name)
    return _copter(case, {phase: case.expected[phase] for phase in _PHASES if phase in case.expected})


def _otherwise(name: str, expected: Mapping[Phase, Expected]) -> Case:
    return _copter(_px4(name), expected)


def _px4(name: str) -> Case:
    return next(case for case in PX4_CASES if case.name == name)


def _copter(case: Case, expected: Mapping[Phase, Expected]) -> Case:
    return replace(case, name=f"ArduPilot: {case.name}", autopilot="ardupilot", expected=expected)


_SAME = (
    "nothing",
    "radio: 30 % lost",
    "radio: of one vehicle off",
    "mocap: off for 1.5 s",
    "mocap: off for good",
    "mocap: repeats itself for 1 s",
    "mocap: repeats itself for 4 s",
    "mocap: jumps by 0.3 m",
    "mocap: jumps by 1.5 m",
    "mocap: scatters by 0.1 m",
    "mocap: 5 Hz",
    "mocap: 100 ms late",
    "mocap: half lost",
    "autopilot: reboots",
    "autopilot: mode stuck for 5 s",
    "autopilot link: off for 0.5 s",
    "autopilot link: 30 % lost",
    "autopilot link: 80 % lost",
    "autopilot link: 100 ms late",
    "autopilot link: 300 ms late",
    "battery: low",
    "battery: critical",
    "battery: empty",
    "ground link: off for 6 s",
    "process: stopped for 0.5 s",
    "process: a fifth of its time",
    "planner: hangs for good",
    "clock: jumps by 0.3 s for 5 s",
)

_FREEZES_S = RULES[Condition.POSITION_FROZEN].within_s
_FREEZES_FENCE_M = 2.0
"""Its estimate follows a frozen pose more slowly than PX4's, so that it is noticed up to 0.5 s later."""

COPTER_CASES = (
    *(_as_px4(name) for name in _SAME),
    _otherwise(
        "mocap: frozen, with noise, for 1 s",
        {Phase.TRACKING: Expected(all_of(HOLDS, says("position frozen")), _FREEZES_S[0], fence_m=_FREEZES_FENCE_M)},
    ),
    _otherwise(
        "mocap: frozen, with noise, for 4 s",
        {Phase.TRACKING: Expected(all_of(LANDS_HERE, says("still frozen")), _FREEZES_S[1], fence_m=_FREEZES_FENCE_M)},
    ),
    _otherwise(
        "autopilot link: off for 7 s",
        {
            Phase.TRACKING: Expected(all_of(CARRIES_ON, _LINK_LOST), LINK_LOST_S, fence_m=SILENT_FENCE_M),
            Phase.RETURNING: Expected(_LINK_LOST, LINK_LOST_S, fence_m=SILENT_FENCE_M),
        },
    ),
    _otherwise(
        "autopilot link: off for good",
        dict.fromkeys((Phase.TRACKING, Phase.RETURNING), _LINK_OFF),
    ),
    _otherwise("process: killed", {Phase.TRACKING: _RESTS, Phase.RETURNING: _RESTS, Phase.LANDING: _LANDS_ALONE}),
    _otherwise("process: killed, starts again after 3 s", {Phase.TRACKING: _BACK}),
    _otherwise("process: killed, starts again after 1 s", {Phase.TRACKING: _BACK}),
    _otherwise("process: stopped for 3 s", {Phase.TRACKING: replace(_BACK, reaction=CARRIES_ON)}),
)
