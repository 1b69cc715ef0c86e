"""The table: which fault in which phase asks for which reaction, and by when; flown with PX4."""

from __future__ import annotations

from dataclasses import replace

from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.flight.failsafes import RULES, Condition
from sim_bridge.reliability.case import FENCE_M, Case, Expected
from sim_bridge.reliability.flight import SAMPLE_S, VICTIM
from sim_bridge.reliability.phases import AIR, ORDINARY, Phase
from sim_bridge.reliability.reactions import (
    CARRIES_ON,
    FAILS_SAFE,
    FLIES_IN_THE_END,
    GOES_HOME,
    HOLDS,
    LANDS_HERE,
    SAFE_ALONE,
    STAYS_DOWN,
    all_of,
    others_say,
    reacts_to,
    says,
    somebody_says,
    within,
)

__all__ = ["ANYTIME", "LINK_LOST_S", "PX4_CASES", "SILENT_FENCE_M"]

_C, _T = Component, FaultType
_ALL: tuple[int, ...] = ()
_ONE = (VICTIM,)
_ON = Expected()


def _fault(
    component: Component, kind: FaultType, vehicles: tuple[int, ...], length_s: float | None, **parameters: float
) -> FaultConfig:
    return FaultConfig(
        component=component,
        type=kind,
        vehicles=vehicles,
        since="boot",
        from_s=0.0,
        until_s=length_s,
        parameters=parameters,
    )


def _in(expected: Expected, *phases: Phase) -> dict[Phase, Expected]:
    return dict.fromkeys(phases, expected)


_EVERYWHERE = _in(_ON, *ORDINARY)
_FLYING = _in(_ON, Phase.TAKEOFF, Phase.TRACKING)

SILENT_FENCE_M = 2.2
"""A PX4 flies its last setpoint on for 1.05 to 1.13 s (COM_OF_LOSS_T), then brakes: 1.5 m/s with the correction."""

_FAILSAFE = Expected(FAILS_SAFE, 2.4, fence_m=SILENT_FENCE_M)
"""1.05 to 1.13 s after the last setpoint, shown by the next heartbeat."""

_NOTHING = (Case("nothing", _fault(_C.RADIO, _T.INTERMITTENT, _ALL, 5.0, loss=0.0), _EVERYWHERE),)
"""What flights are like without a fault."""

_MISSED_S = RULES[Condition.PEER_LOST].within_s[0]
_ALONE_S = RULES[Condition.PARTITION].within_s[0]
_HEARD_AGAIN_S = 0.7
"""Something is said twice a second, and a tick passes."""

_MISSES = others_say(f"vehicle {VICTIM} is not heard any more")
_ALONE = "no teammate is heard any more"

_RADIO = (
    Case("radio: 5 % lost", _fault(_C.RADIO, _T.INTERMITTENT, _ALL, 6.0, loss=0.05), _EVERYWHERE),
    Case("radio: 30 % lost", _fault(_C.RADIO, _T.INTERMITTENT, _ALL, 6.0, loss=0.3), _EVERYWHERE),
    Case("radio: 80 % lost", _fault(_C.RADIO, _T.INTERMITTENT, _ALL, 6.0, loss=0.8), _EVERYWHERE),
    Case("radio: 100 ms late, jitter 100 ms", _fault(_C.RADIO, _T.DELAYED, _ALL, 6.0, jitter_s=0.1), _EVERYWHERE),
    Case("radio: 1 s late", _fault(_C.RADIO, _T.DELAYED, _ALL, 6.0, delay_s=1.0), _EVERYWHERE),
    Case("radio: doubled and reordered", _fault(_C.RADIO, _T.WRONG, _ALL, 6.0), _EVERYWHERE),
    Case("radio: 30 % damaged", _fault(_C.RADIO, _T.GARBAGE, _ALL, 6.0), _EVERYWHERE),
    Case("radio: repeats old datagrams", _fault(_C.RADIO, _T.STUCK, _ALL, 4.0), _EVERYWHERE),
    Case("radio: 1 kB/s", _fault(_C.RADIO, _T.SLOW, _ALL, 6.0), _EVERYWHERE),
    Case(
        "radio: of one vehicle off",
        _fault(_C.RADIO, _T.OFF, _ONE, 6.0),
        _EVERYWHERE
        | _in(
            Expected(
                all_of(
                    CARRIES_ON,
                    within(_MISSED_S, _MISSES),
                    within(_ALONE_S, says(_ALONE)),
                    others_say("peers are heard again"),
                    says("teammates are heard again"),
                ),
                6.0 + _HEARD_AGAIN_S,
            ),
            Phase.TOGETHER,
        ),
    ),
    Case(
        "radio: of one vehicle off for good",
        _fault(_C.RADIO, _T.OFF, _ONE, None),
        _EVERYWHERE
        | _in(
            Expected(all_of(CARRIES_ON, _MISSES, says(_ALONE)), max(_MISSED_S, _ALONE_S)),
            Phase.TOGETHER,
        ),
    ),
    Case(
        "radio: off",
        _fault(_C.RADIO, _T.OFF, _ALL, 6.0),
        _EVERYWHERE
        | _in(
            Expected(
                all_of(
                    CARRIES_ON,
                    within(_ALONE_S, somebody_says(_ALONE)),
                    somebody_says("teammates are heard again"),
                ),
                6.0 + _HEARD_AGAIN_S,
            ),
            Phase.TOGETHER,
        ),
    ),
    Case(
        "radio: off for good",
        _fault(_C.RADIO, _T.OFF, _ALL, None),
        _EVERYWHERE | _in(Expected(all_of(CARRIES_ON, somebody_says(_ALONE)), _ALONE_S), Phase.TOGETHER),
    ),
    Case("radio: partition", _fault(_C.RADIO, _T.OFF, (1, 2), 6.0, among_themselves=1.0), _EVERYWHERE),
)

_DETECTOR = (
    Case("detector: off", _fault(_C.DETECTOR, _T.OFF, _ONE, 5.0), _EVERYWHERE),
    Case("detector: off for good", _fault(_C.DETECTOR, _T.OFF, _ALL, None), _FLYING),
    Case("detector: repeats", _fault(_C.DETECTOR, _T.STUCK, _ALL, 5.0), _FLYING),
    Case("detector: ghosts", _fault(_C.DETECTOR, _T.GARBAGE, _ALL, 5.0), _FLYING),
    Case("detector: ranges 0.5 m too long", _fault(_C.DETECTOR, _T.WRONG, _ALL, 5.0), _FLYING),
    Case("detector: one look in four", _fault(_C.DETECTOR, _T.SLOW, _ALL, 5.0), _FLYING),
    Case("detector: 0.5 s late", _fault(_C.DETECTOR, _T.DELAYED, _ALL, 5.0), _FLYING),
    Case("detector: 3 s late", _fault(_C.DETECTOR, _T.DELAYED, _ALL, 5.0, delay_s=3.0), _FLYING),
    Case("detector: half lost", _fault(_C.DETECTOR, _T.INTERMITTENT, _ALL, 5.0), _FLYING),
)

_UNAIDED = Expected(all_of(HOLDS, says("position source does not come back"), LANDS_HERE), 4.0, fence_m=0.8)
"""Noticed within 1.1 s, landed 2.3 s later; blind, the vehicle drifts meanwhile."""

_ASTRAY_M = 1.3
"""How far a vehicle flies, mostly unseen, until its frozen position is noticed after 0.4 s and it has braked."""

_FREEZES = Expected(all_of(HOLDS, says("position frozen")), 0.7, fence_m=_ASTRAY_M)
_FREEZES_LONG = Expected(all_of(LANDS_HERE, says("still frozen")), 2.3, fence_m=2.0)
"""It drifts while it waits for the position to come back, and comes down."""

_MOCAP = (
    Case("mocap: off for 1.5 s", _fault(_C.MOCAP, _T.OFF, _ONE, 1.5), _EVERYWHERE),
    Case(
        "mocap: off for good",
        _fault(_C.MOCAP, _T.OFF, _ONE, None),
        _in(_UNAIDED, Phase.TRACKING)
        | _in(replace(_UNAIDED, reaction=LANDS_HERE), Phase.TAKEOFF, Phase.PAUSED, Phase.RETURNING),
    ),
    Case("mocap: repeats itself for 1 s", _fault(_C.MOCAP, _T.STUCK, _ONE, 1.0), _EVERYWHERE),
    Case(
        "mocap: repeats itself for 4 s",
        _fault(_C.MOCAP, _T.STUCK, _ONE, 4.0),
        _in(_ON, Phase.GROUND)
        | _in(_UNAIDED, Phase.TRACKING)
        | _in(replace(_UNAIDED, reaction=LANDS_HERE), Phase.TAKEOFF, Phase.PAUSED, Phase.RETURNING),
    ),
    Case(
        "mocap: frozen, with noise, for 1 s",
        _fault(_C.MOCAP, _T.STUCK, _ONE, 1.0, std_m=0.003),
        _EVERYWHERE
        | _in(_FREEZES, Phase.TRACKING)
        | _in(replace(_ON, fence_m=_ASTRAY_M), Phase.PAUSED, Phase.RETURNING),
    ),
    Case(
        "mocap: frozen, with noise, for 4 s",
        _fault(_C.MOCAP, _T.STUCK, _ONE, 4.0, std_m=0.003),
        _in(_ON, Phase.GROUND) | _in(_FREEZES_LONG, Phase.TRACKING),
    ),
    Case(
        "mocap: jumps by 0.3 m",
        _fault(_C.MOCAP, _T.WRONG, _ONE, 3.0, north_m=0.3),
        _in(Expected(fence_m=FENCE_M + 0.3), *ORDINARY),
    ),
    Case(
        "mocap: jumps by 1.5 m",
        _fault(_C.MOCAP, _T.WRONG, _ONE, 3.0, north_m=1.5),
        _in(Expected(all_of(HOLDS, says("position jumps")), 0.5, fence_m=2.0), Phase.TRACKING),
    ),
    Case("mocap: scatters by 0.1 m", _fault(_C.MOCAP, _T.GARBAGE, _ONE, 3.0, std_m=0.1), _EVERYWHERE),
    Case("mocap: 5 Hz", _fault(_C.MOCAP, _T.SLOW, _ONE, 4.0), _EVERYWHERE),
    Case("mocap: 100 ms late", _fault(_C.MOCAP, _T.DELAYED, _ONE, 4.0), _EVERYWHERE),
    Case("mocap: half lost", _fault(_C.MOCAP, _T.INTERMITTENT, _ONE, 4.0), _EVERYWHERE),
)

LINK_LOST_S = 5.7
"""4.5 s after the last heartbeat, which was up to 1 s old."""

_NO_LINK = Expected(all_of(FAILS_SAFE, says("autopilot link lost")), LINK_LOST_S, fence_m=SILENT_FENCE_M)

_LATE_FENCE_M = 0.9
"""0.6 s pass until what is seen is answered: as much farther as a plan flies meanwhile, at 1 m/s."""

_REFUSES = Expected(all_of(says("gave up"), STAYS_DOWN), 22.0)

_AUTOPILOT = (
    Case(
        "autopilot: reboots",
        _fault(_C.AUTOPILOT, _T.OFF, _ONE, 1.0),
        _in(Expected(says("letting go"), 4.0), Phase.TRACKING, Phase.PAUSED, Phase.RETURNING),
    ),
    Case("autopilot: refuses to arm", _fault(_C.AUTOPILOT, _T.WRONG, _ONE, None), _in(_REFUSES, Phase.ARMING)),
    Case(
        "autopilot: refuses to arm for 3 s",
        _fault(_C.AUTOPILOT, _T.WRONG, _ONE, 3.0),
        _in(_ON, Phase.GROUND, Phase.ARMING),
    ),
    Case("autopilot: mode stuck", _fault(_C.AUTOPILOT, _T.STUCK, _ONE, None), _in(_REFUSES, Phase.ARMING)),
    Case(
        "autopilot: mode stuck for 5 s",
        _fault(_C.AUTOPILOT, _T.STUCK, _ONE, 5.0),
        _in(_ON, Phase.TRACKING, Phase.PAUSED, Phase.RETURNING, Phase.LANDING),
    ),
    Case("autopilot link: off for 0.5 s", _fault(_C.AUTOPILOT_LINK, _T.OFF, _ONE, 0.5), _EVERYWHERE),
    Case(
        "autopilot link: off for 7 s",
        _fault(_C.AUTOPILOT_LINK, _T.OFF, _ONE, 7.0),
        _in(_NO_LINK, *AIR),
    ),
    Case(
        "autopilot link: off for good",
        _fault(_C.AUTOPILOT_LINK, _T.OFF, _ONE, None),
        _in(_NO_LINK, *AIR),
    ),
    Case("autopilot link: 30 % lost", _fault(_C.AUTOPILOT_LINK, _T.INTERMITTENT, _ONE, 5.0), _EVERYWHERE),
    Case("autopilot link: 80 % lost", _fault(_C.AUTOPILOT_LINK, _T.INTERMITTENT, _ONE, 5.0, loss=0.8), _EVERYWHERE),
    Case("autopilot link: 100 ms late", _fault(_C.AUTOPILOT_LINK, _T.DELAYED, _ONE, 5.0), _EVERYWHERE),
    Case(
        "autopilot link: 300 ms late",
        _fault(_C.AUTOPILOT_LINK, _T.DELAYED, _ONE, 5.0, delay_s=0.3),
        _in(Expected(fence_m=_LATE_FENCE_M), *ORDINARY),
    ),
    Case(
        "battery: low",
        _fault(_C.BATTERY, _T.WRONG, _ONE, None, remaining=0.15),
        _in(Expected(all_of(CARRIES_ON, says("battery low")), 1.3), Phase.TAKEOFF, Phase.TRACKING, Phase.PAUSED)
        | _in(Expected(says("battery low"), 1.3), Phase.RETURNING),
    ),
    Case(
        "battery: critical",
        _fault(_C.BATTERY, _T.WRONG, _ONE, None, remaining=0.07),
        _in(Expected(all_of(GOES_HOME, says("battery critical")), 1.3), *AIR),
    ),
    Case(
        "battery: empty",
        _fault(_C.BATTERY, _T.WRONG, _ONE, None, remaining=0.04),
        _in(Expected(all_of(LANDS_HERE, says("battery empty")), 1.3), *AIR),
    ),
)

_GROUND_LOST = reacts_to(Condition.GROUND_LOST)
_GROUND_LOST_S = RULES[Condition.GROUND_LOST].within_s[0] + SAMPLE_S
"""Read from the vehicle's own log; the ground cannot hear it."""

_GROUND = (
    Case(
        "ground link: off for 6 s",
        _fault(_C.GROUND_LINK, _T.OFF, _ONE, 6.0),
        _in(Expected(all_of(CARRIES_ON, _GROUND_LOST), _GROUND_LOST_S), *ORDINARY)
        | _in(
            Expected(
                all_of(CARRIES_ON, within(_GROUND_LOST_S, _GROUND_LOST), says("ground station is heard again")), 7.2
            ),
            Phase.TRACKING,
        ),
    ),
    Case("ground link: half lost", _fault(_C.GROUND_LINK, _T.INTERMITTENT, _ALL, 6.0, loss=0.5), _EVERYWHERE),
    Case("ground link: 1 s late", _fault(_C.GROUND_LINK, _T.DELAYED, _ALL, 6.0, delay_s=1.0), _EVERYWHERE),
)

_PROCESS = (
    Case(
        "process: killed",
        _fault(_C.PROCESS, _T.OFF, _ONE, None),
        _in(_FAILSAFE, *AIR) | _in(Expected(STAYS_DOWN), Phase.GROUND, Phase.ARMING),
    ),
    Case(
        "process: killed, starts again after 3 s",
        _fault(_C.PROCESS, _T.OFF, _ONE, 3.0),
        _in(_FAILSAFE, *AIR) | _in(Expected(FLIES_IN_THE_END), Phase.GROUND),
    ),
    Case(
        "process: killed, starts again after 1 s",
        _fault(_C.PROCESS, _T.OFF, _ONE, 1.0),
        _in(replace(_FAILSAFE, reaction=FLIES_IN_THE_END), Phase.TRACKING, Phase.PAUSED),
    ),
    Case("process: stopped for 0.5 s", _fault(_C.PROCESS, _T.STUCK, _ONE, 0.5), _EVERYWHERE),
    Case(
        "process: stopped for 3 s",
        _fault(_C.PROCESS, _T.STUCK, _ONE, 3.0),
        _in(_FAILSAFE, *AIR) | _in(_ON, Phase.GROUND, Phase.ARMING, Phase.LANDING),
    ),
    Case("process: all stopped for 0.5 s", _fault(_C.PROCESS, _T.STUCK, _ALL, 0.5), _EVERYWHERE),
    Case("process: a fifth of its time", _fault(_C.PROCESS, _T.SLOW, _ONE, 5.0), _EVERYWHERE),
    Case("process: a twentieth of its time", _fault(_C.PROCESS, _T.SLOW, _ONE, 5.0, share=0.05), _EVERYWHERE),
)

_PLANNER = (
    Case(
        "planner: fails for 3 s",
        _fault(_C.PLANNER, _T.OFF, _ONE, 3.0),
        _in(Expected(says("planner failed"), 1.6), Phase.TRACKING),
    ),
    Case(
        "planner: hangs for 3 s",
        _fault(_C.PLANNER, _T.STUCK, _ONE, 3.0),
        _in(Expected(all_of(CARRIES_ON, says("late")), 4.5), Phase.TRACKING),
    ),
    Case(
        "planner: hangs for good",
        _fault(_C.PLANNER, _T.STUCK, _ONE, None),
        _in(Expected(all_of(HOLDS, says("no new plan")), 7.6), Phase.TRACKING),
    ),
    Case(
        "planner: nothing feasible for 3 s",
        _fault(_C.PLANNER, _T.WRONG, _ONE, 3.0),
        _in(Expected(says("no feasible plan"), 2.1), Phase.TRACKING),
    ),
    Case(
        "planner: 0.3 s late",
        _fault(_C.PLANNER, _T.DELAYED, _ALL, 4.0),
        _in(Expected(all_of(CARRIES_ON, says("late")), 2.5), Phase.TRACKING),
    ),
)

_CLOCK = (
    Case("clock: 15 ms ahead", _fault(_C.CLOCK, _T.WRONG, _ONE, None, offset_s=0.015), _EVERYWHERE),
    Case(
        "clock: jumps by 0.3 s for 5 s",
        _fault(_C.CLOCK, _T.WRONG, _ONE, 5.0, offset_s=0.3),
        _in(Expected(says("own clock jumped"), 2.6), *AIR, Phase.GROUND)
        | _in(Expected(all_of(HOLDS, says("own clock is wrong")), 2.6), Phase.TRACKING),
    ),
    Case(
        "clock: 5 s behind for 5 s",
        _fault(_C.CLOCK, _T.WRONG, _ONE, 5.0, offset_s=-5.0),
        _in(Expected(says("own clock jumped"), 2.6), *AIR, Phase.GROUND)
        | _in(Expected(all_of(HOLDS, says("own clock is wrong")), 2.6), Phase.TRACKING),
    ),
    Case(
        "clock: gains 10 ms/s",
        _fault(_C.CLOCK, _T.WRONG, _ONE, None, offset_s=0.0, drift_ppm=10_000.0),
        # Only the autopilot is always within reach; on the ground all teammates are.
        _in(Expected(says("own clock jumped"), 6.0), Phase.TRACKING)
        | _in(Expected(all_of(says("own clock jumped"), says("clocks differ")), 8.0), Phase.GROUND),
    ),
)

_ANYTIME = Case(
    "process: killed at a random moment",
    _fault(_C.PROCESS, _T.OFF, _ONE, None),
    _in(Expected(SAFE_ALONE, 2.4, fence_m=SILENT_FENCE_M), *ORDINARY),
)

PX4_CASES = (*_NOTHING, *_RADIO, *_DETECTOR, *_MOCAP, *_AUTOPILOT, *_GROUND, *_PROCESS, *_PLANNER, *_CLOCK)
"""What happens at the beginning of a phase."""

ANYTIME = (_ANYTIME,)
"""What happens at a random moment of a phase, to a random vehicle."""
