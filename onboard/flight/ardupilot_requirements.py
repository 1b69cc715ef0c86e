"""ArduPilot Copter's parameters that a plan depends on (https://ardupilot.org/copter/docs/parameters.html).

Values of release 4.6 and before are in centimetres and centidegrees.
"""

from __future__ import annotations

import math

from onboard.flight.requirements import Needs, OneOf, Requirement, Severity, Within

__all__ = ["ardupilot_requirements"]

_SHOULD = Severity.SHOULD


def ardupilot_requirements(needs: Needs) -> tuple[Requirement, ...]:
    """What must, and what should hold."""
    speed = needs.speed_m_s + needs.correction_m_s
    return (
        Requirement(
            "ATC_SLEW_YAW",
            Within(low=1e2 * math.degrees(needs.yaw_rate_rad_s), step=1000.0),
            f"primitives turn at {needs.yaw_rate_rad_s:g} rad/s",
            unit="cdeg/s",
        ),
        Requirement(
            "ATC_ACCEL_Y_MAX",
            Within(low=1e2 * math.degrees(needs.yaw_acceleration_rad_s2), off=0.0, step=1000.0),
            "turns that reverse from step to step",
            _SHOULD,
            unit="cdeg/s^2",
        ),
        Requirement(
            "WPNAV_SPEED",
            Within(low=1e2 * speed, step=10.0),
            f"{needs.speed_m_s:g} m/s and position control's {needs.correction_m_s:g}",
            unit="cm/s",
        ),
        Requirement(
            "WPNAV_ACCEL",
            Within(low=1e2 * needs.acceleration_m_s2, step=100.0),
            f"curves need {needs.acceleration_m_s2:g} m/s^2 sideways",
            unit="cm/s^2",
        ),
        Requirement(
            "PSC_JERK_XY",
            Within(low=2.0 * needs.jerk_m_s3, step=5.0),
            f"curves need {needs.jerk_m_s3:g} m/s^3, and as much again to get into them",
            unit="m/s^3",
            aliases=("PSC_JERK_NE",),
        ),
        Requirement("WPNAV_SPEED_UP", Within(low=1e2 * needs.climb_m_s, step=10.0), "flight.climb_m_s", unit="cm/s"),
        Requirement("WPNAV_SPEED_DN", Within(low=1e2 * needs.climb_m_s, step=10.0), "flight.climb_m_s", unit="cm/s"),
        Requirement("GUID_TIMEOUT", Within(0.5, 5.0, step=0.5), "how long setpoints may be silent", unit="s"),
        Requirement("DISARM_DELAY", Within(low=5.0, off=0.0), "from arming to takeoff", unit="s"),
        Requirement("FS_EKF_ACTION", OneOf((1.0,)), "without a position: land", _SHOULD),
        Requirement("FS_GCS_ENABLE", OneOf((0.0,)), "the team flies on when the ground station is closed", _SHOULD),
        *(_mocap() if needs.mocap else _gps()),
    )


def _mocap() -> tuple[Requirement, ...]:
    return (
        Requirement("VISO_TYPE", OneOf((1.0, 2.0, 3.0)), "listens to motion capture", reboot=True),
        Requirement("EK3_SRC1_POSXY", OneOf((6.0,)), "position from motion capture"),
        Requirement("EK3_SRC1_POSZ", OneOf((6.0,)), "height from motion capture"),
        Requirement("EK3_SRC1_YAW", OneOf((6.0,)), "heading from motion capture"),
        Requirement("EK3_SRC1_VELXY", OneOf((6.0, 0.0)), "no velocity from GPS"),
        Requirement("EK3_SRC1_VELZ", OneOf((6.0, 0.0)), "no velocity from GPS"),
        Requirement(
            "GPS1_TYPE", OneOf((0.0,)), "else its checks wait for GPS", _SHOULD, aliases=("GPS_TYPE",), reboot=True
        ),
        Requirement("COMPASS_ENABLE", OneOf((0.0,)), "indoors the compass misleads", _SHOULD, reboot=True),
    )


def _gps() -> tuple[Requirement, ...]:
    return (
        Requirement("EK3_SRC1_POSXY", OneOf((3.0,)), "position from GPS"),
        Requirement("EK3_SRC1_VELXY", OneOf((3.0,)), "velocity from GPS"),
    )
