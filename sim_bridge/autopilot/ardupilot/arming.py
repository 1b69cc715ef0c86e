"""Whether Copter arms, and what it says if it does not (https://ardupilot.org/copter/docs/common-prearm-safety-checks.html)."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.modes import is_armable, needs_position

__all__ = ["Readiness", "arming_failures", "mandatory_failures", "prearm_failures"]

_NO_POSITION = "Need Position Estimate"


@dataclass(frozen=True, slots=True)
class Readiness:
    """What the checks are about.

    Attributes:
        initialised: The firmware has started up.
        attitude: Tilt and heading are known.
        origin: The local frame's place on Earth is known.
        position: There is an estimate of the position.
        vision_wanted: Motion capture is configured as a source.
        vision_healthy: It arrives.
        gcs_failsafe: The ground station's heartbeats have failed.
    """

    initialised: bool
    attitude: bool
    origin: bool
    position: bool
    vision_wanted: bool
    vision_healthy: bool
    gcs_failsafe: bool


def mandatory_failures(mode: CopterMode, ready: Readiness) -> list[str]:
    """What even forced arming does not override."""
    if not ready.initialised:
        return ["System not initialised"]
    failures = []
    if not is_armable(mode):
        failures.append(f"{mode.name.replace('_', ' ')} mode not armable")
    if needs_position(mode) and not ready.position:
        failures.append(_NO_POSITION)
    return failures


def prearm_failures(mode: CopterMode, ready: Readiness) -> list[str]:
    """What is amiss before anybody arms: SYS_STATUS's health bit is set while nothing is."""
    if not ready.initialised:
        return mandatory_failures(mode, ready)
    failures = []
    if not ready.attitude:
        failures.append("EKF attitude is bad")
    if not ready.origin:
        failures.append("AHRS: waiting for home")
    elif needs_position(mode) and not ready.position:
        # As recorded: while home is unknown, the position is not asked about.
        failures.append(_NO_POSITION)
    if ready.vision_wanted and not ready.vision_healthy:
        failures.append("VisOdom: not healthy")
    if ready.gcs_failsafe:
        failures.append("GCS failsafe on")
    return failures


def arming_failures(mode: CopterMode, ready: Readiness, *, force: bool) -> list[str]:
    """All that keeps the vehicle from being armed in a mode, in the autopilot's words; empty if nothing does."""
    mandatory = mandatory_failures(mode, ready)
    if force:
        return mandatory
    failures = prearm_failures(mode, ready)
    return failures + [failure for failure in mandatory if failure != _NO_POSITION and failure not in failures]
