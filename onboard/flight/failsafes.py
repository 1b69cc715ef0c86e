"""The table of failsafes: which condition, how severe, what is done about it, how soon, and when it is over.

``RULES`` is the truth of what happens; ``docs/failsafes.md`` is generated from it, and ``ladder.py`` climbs it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, IntEnum
from types import MappingProxyType

from onboard.protocol import dialect as mavlink

__all__ = ["RULES", "Action", "Condition", "Rule", "Severity", "Stage"]


class Severity(IntEnum):
    """How grave: MAV_SEVERITY of the text that tells of it."""

    ALERT = mavlink.MAV_SEVERITY_ALERT
    CRITICAL = mavlink.MAV_SEVERITY_CRITICAL
    ERROR = mavlink.MAV_SEVERITY_ERROR
    WARNING = mavlink.MAV_SEVERITY_WARNING
    NOTICE = mavlink.MAV_SEVERITY_NOTICE
    INFO = mavlink.MAV_SEVERITY_INFO


class Action(IntEnum):
    """What is done, the most drastic last."""

    TELL = 0
    """Fly on, and say it."""
    KEEP_OFF = 1
    """The last resort bends the setpoint's velocity."""
    WAIT = 2
    """Hover until the next plan comes."""
    HOLD = 3
    """Hover, and plan nothing."""
    RETURN = 4
    """Fly above home and land there."""
    STOP = 5
    """Brake and hover without trusting the position: no correction, no plan, no way home."""
    LAND = 6
    """Land here."""
    GIVE_UP = 7
    """Stay on the ground."""
    LET_GO = 8
    """Send nothing more."""


class Condition(Enum):
    """What may be wrong, or asked for."""

    LANDING_ORDERED = "landing ordered"
    PROCESS_ENDS = "process ends"
    TAKEN_OVER = "somebody else took the vehicle"
    ARMING_REFUSED = "arming refused"
    NOT_LAUNCHED = "not launched in time"
    LAYER_NOT_REACHED = "layer not reached in time"
    AUTOPILOT_LOST = "autopilot link lost"
    AUTOPILOT_FAILSAFE = "autopilot failsafe"
    FAILSAFE_LASTS = "autopilot failsafe lasts"
    POSITION_STALE = "position stale"
    POSITION_LOST = "position lost"
    POSITION_UNAIDED = "position source lost"
    POSITION_FROZEN = "position frozen"
    POSITION_JUMPS = "position jumps"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMPTY = "battery empty"
    CLOCK_JUMPED = "own clock jumped"
    CLOCK_ASTRAY = "own clock astray"
    CLOCKS_DIFFER = "clocks differ"
    PLANNER_LATE = "planner late"
    PLANNER_CRASHED = "planner crashed"
    PLANNER_HANGS = "planner hangs"
    NO_FEASIBLE_PLAN = "no feasible plan"
    PLAN_FLOWN_OUT = "plan flown out"
    FENCE_NEAR = "fence near"
    OBSTACLE_NEAR = "obstacle near"
    TEAMMATE_NEAR = "teammate near"
    PEER_LOST = "peer lost"
    PARTITION = "partition"
    GROUND_LOST = "ground lost"


@dataclass(frozen=True, slots=True)
class Stage:
    """What is done from some time on.

    Attributes:
        action: What.
        after_s: How long the condition must have been seen, s.
        told: What the operator reads when it begins; ``{}`` is what was seen.
    """

    action: Action
    after_s: float
    told: str


@dataclass(frozen=True, slots=True)
class Rule:
    """One row of the table.

    Attributes:
        severity: How grave.
        watched: What is looked at, in words.
        stages: What is done, milder first.
        noticed_s: From the beginning of the condition until it is seen at the latest, s.
        clears_s: How long it must not be seen until it is over, s.
        over: What the operator reads then; empty if its end needs no words.
    """

    severity: Severity
    watched: str
    stages: tuple[Stage, ...]
    noticed_s: float
    clears_s: float
    over: str

    @property
    def within_s(self) -> tuple[float, ...]:
        """By when each stage has begun after the condition's beginning, s; a tick of the setpoint stream included."""
        return tuple(self.noticed_s + stage.after_s + _TICK_S for stage in self.stages)


_TICK_S = 0.1
"""The slowest setpoint stream that a scenario may ask for (10 Hz)."""


def _rule(
    severity: Severity,
    watched: str,
    *stages: Stage,
    noticed_s: float = 0.0,
    clears_s: float = 0.0,
    over: str = "",
) -> Rule:
    return Rule(severity, watched, stages, noticed_s, clears_s, over)


_S, _C, _A = Severity, Condition, Action

RULES: Mapping[Condition, Rule] = MappingProxyType(
    {
        _C.TAKEN_OVER: _rule(
            _S.WARNING,
            "heartbeat: a mode that nobody here asked for, disarmed in the air, or booted anew",
            Stage(_A.LET_GO, 0.0, "somebody else took the vehicle ({}); letting go"),
            noticed_s=1.1,
        ),
        _C.PROCESS_ENDS: _rule(_S.NOTICE, "SIGINT or SIGTERM", Stage(_A.LAND, 0.0, "this process ends; landing here")),
        _C.BATTERY_EMPTY: _rule(
            _S.ALERT,
            "SYS_STATUS.battery_remaining at or below flight.battery.empty",
            Stage(_A.LAND, 0.2, "battery empty ({}); landing here"),
            noticed_s=1.0,
            clears_s=10.0,
            over="battery no longer empty",
        ),
        _C.FAILSAFE_LASTS: _rule(
            _S.CRITICAL,
            "heartbeat: a failsafe that lands, has disarmed, or has waited 2 s for sticks",
            Stage(_A.LAND, 0.0, "{}"),
            noticed_s=1.1,
        ),
        _C.POSITION_LOST: _rule(
            _S.CRITICAL,
            "the autopilot talks, but tells no position",
            Stage(_A.LAND, 1.5, "no position from the autopilot; landing here"),
            noticed_s=0.5,
            clears_s=0.5,
            over="position is back",
        ),
        _C.POSITION_UNAIDED: _rule(
            _S.CRITICAL,
            "ESTIMATOR_STATUS without PRED_POS_HORIZ_REL, or SYS_STATUS with an unhealthy vision position",
            Stage(_A.STOP, 0.0, "the autopilot has lost its position source; stopping"),
            Stage(_A.LAND, 2.3, "the autopilot's position source does not come back; landing here"),
            noticed_s=1.1,
            clears_s=0.3,
            over="the autopilot has its position source again",
        ),
        _C.POSITION_FROZEN: _rule(
            _S.CRITICAL,
            "the position stands still while the vehicle's tilt says that it moves (PX4: within 0.6 s)",
            Stage(_A.STOP, 0.0, "position frozen ({}); stopping"),
            Stage(_A.LAND, 1.5, "position still frozen; landing here"),
            noticed_s=1.1,
            clears_s=1.0,
            over="the position moves again",
        ),
        _C.POSITION_STALE: _rule(
            _S.WARNING,
            "no position from the autopilot for 0.5 s",
            Stage(_A.STOP, 0.05, "position stale; stopping"),
            noticed_s=0.5,
            clears_s=0.3,
            over="position is fresh again",
        ),
        _C.POSITION_JUMPS: _rule(
            _S.WARNING,
            "the position moves 0.5 m more in 0.2 s than the vehicle can",
            Stage(_A.STOP, 0.0, "position jumps ({}); stopping"),
            noticed_s=0.3,
            clears_s=1.0,
            over="the position is steady again",
        ),
        _C.LAYER_NOT_REACHED: _rule(
            _S.ERROR,
            "TAKEOFF for longer than flight.takeoff_patience_s and twice the climb",
            Stage(_A.LAND, 0.0, "height not reached in time ({}); landing here"),
        ),
        _C.NOT_LAUNCHED: _rule(
            _S.ERROR,
            "ARM for 20 s",
            Stage(_A.GIVE_UP, 0.0, "not in the air within 20 s ({}); gave up"),
        ),
        _C.BATTERY_CRITICAL: _rule(
            _S.CRITICAL,
            "SYS_STATUS.battery_remaining at or below flight.battery.critical",
            Stage(_A.RETURN, 0.2, "battery critical ({}); going home"),
            noticed_s=1.0,
            clears_s=10.0,
            over="battery no longer critical",
        ),
        _C.LANDING_ORDERED: _rule(
            _S.INFO, "MAV_CMD_NAV_LAND from the ground station", Stage(_A.RETURN, 0.0, "landing ordered")
        ),
        _C.CLOCK_ASTRAY: _rule(
            _S.CRITICAL,
            "own clock 0.25 s or more from where it was by the autopilot's, or from most peers'",
            Stage(_A.HOLD, 0.0, "own clock is wrong by {}; holding"),
            noticed_s=2.5,
            clears_s=1.0,
            over="own clock is right again",
        ),
        _C.CLOCK_JUMPED: _rule(
            _S.WARNING,
            "TIMESYNC with the autopilot: 20 ms or more from where it was, the round trip allowed for",
            Stage(_A.TELL, 0.0, "own clock jumped by {}"),
            noticed_s=2.5,
            clears_s=2.0,
            over="own clock goes evenly again",
        ),
        _C.CLOCKS_DIFFER: _rule(
            _S.WARNING,
            "TIMESYNC with peers: 20 ms or more apart, the round trip allowed for",
            Stage(_A.TELL, 0.0, "clocks differ: {}"),
            noticed_s=3.0,
            clears_s=3.0,
            over="clocks agree again",
        ),
        _C.PLAN_FLOWN_OUT: _rule(
            _S.WARNING,
            "the end of the last plan",
            Stage(_A.WAIT, 0.0, "no new plan until the end of the last one; holding"),
            over="a new plan at last",
        ),
        _C.TEAMMATE_NEAR: _rule(
            _S.WARNING,
            "stopping distance to a teammate, from its word and its plan",
            Stage(_A.KEEP_OFF, 0.0, "last resort: too close to a teammate; keeping off"),
            clears_s=2.0,
            over="last resort: teammates are clear again",
        ),
        _C.FENCE_NEAR: _rule(
            _S.WARNING,
            "stopping distance to the fence",
            Stage(_A.KEEP_OFF, 0.0, "last resort: too close to the fence; keeping off"),
            clears_s=2.0,
            over="last resort: the fence is clear again",
        ),
        _C.OBSTACLE_NEAR: _rule(
            _S.WARNING,
            "stopping distance to obstacles",
            Stage(_A.KEEP_OFF, 0.0, "last resort: too close to an obstacle; keeping off"),
            clears_s=2.0,
            over="last resort: obstacles are clear again",
        ),
        _C.AUTOPILOT_LOST: _rule(
            _S.CRITICAL,
            "no heartbeat of the autopilot for flight.autopilot_timeout_s",
            Stage(_A.TELL, 0.0, "autopilot link lost"),
            noticed_s=4.5,
            over="autopilot link is back",
        ),
        _C.AUTOPILOT_FAILSAFE: _rule(
            _S.CRITICAL,
            "heartbeat: a failsafe from which it comes back by itself while setpoints come",
            Stage(_A.TELL, 0.0, "{}"),
            noticed_s=1.1,
            over="the autopilot follows again",
        ),
        _C.ARMING_REFUSED: _rule(
            _S.WARNING,
            "COMMAND_ACK of the launch's commands",
            Stage(_A.TELL, 0.0, "the launch is refused: {}"),
            clears_s=2.5,
        ),
        _C.PLANNER_CRASHED: _rule(
            _S.ERROR,
            "the planner raises",
            Stage(_A.TELL, 0.0, "planner failed {}"),
            clears_s=2.0,
            over="the planner plans again",
        ),
        _C.PLANNER_HANGS: _rule(
            _S.ERROR,
            "no answer a step after the epoch that was planned for",
            Stage(_A.TELL, 0.0, "planner hangs: no answer {}"),
            noticed_s=0.5,
            clears_s=2.0,
            over="the planner answers again",
        ),
        _C.PLANNER_LATE: _rule(
            _S.WARNING,
            "a plan after the end of its slot",
            Stage(_A.TELL, 0.0, "plan late by {}"),
            clears_s=3.0,
            over="plans are in time again",
        ),
        _C.NO_FEASIBLE_PLAN: _rule(
            _S.WARNING,
            "the plan that was made",
            Stage(_A.TELL, 0.0, "no feasible plan: it ends in a stop"),
            clears_s=2.0,
            over="a feasible plan again",
        ),
        _C.BATTERY_LOW: _rule(
            _S.WARNING,
            "SYS_STATUS.battery_remaining at or below flight.battery.low",
            Stage(_A.TELL, 0.2, "battery low ({})"),
            noticed_s=1.0,
            clears_s=10.0,
            over="battery no longer low",
        ),
        _C.PARTITION: _rule(
            _S.WARNING,
            "all peers silent, one of them after it was well within reach",
            Stage(_A.TELL, 0.0, "no teammate is heard any more; flying alone"),
            noticed_s=3.6,
            over="teammates are heard again",
        ),
        _C.PEER_LOST: _rule(
            _S.NOTICE,
            "a peer in flight silent for 3 s after it was nearer than half of the farthest that was heard",
            Stage(_A.TELL, 0.0, "{} is not heard any more"),
            noticed_s=3.6,
            over="peers are heard again",
        ),
        _C.GROUND_LOST: _rule(
            _S.NOTICE,
            "no message of the ground station for 5 s after the last one",
            Stage(_A.TELL, 0.0, "the ground station is not heard any more; flying on"),
            noticed_s=5.0,
            over="the ground station is heard again",
        ),
    }
)
"""The table, most drastic first; what is not told apart by the action is told apart by the order here."""
