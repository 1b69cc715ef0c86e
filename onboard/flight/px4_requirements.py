"""PX4's parameters that a plan depends on (https://docs.px4.io/main/en/advanced_config/parameter_reference.html)."""

from __future__ import annotations

import math

from onboard.flight.requirements import Bits, Needs, OneOf, Requirement, Severity, Within

__all__ = ["px4_requirements"]

_SHOULD = Severity.SHOULD
_GRAVITY_M_S2 = 9.81
_TILT_MARGIN_DEG = 10.0


def px4_requirements(needs: Needs) -> tuple[Requirement, ...]:
    """What must, and what should hold."""
    speed = needs.speed_m_s + needs.correction_m_s
    tilt_deg = math.degrees(math.atan(needs.acceleration_m_s2 / _GRAVITY_M_S2)) + _TILT_MARGIN_DEG
    return (
        Requirement(
            "MC_YAWRATE_MAX",
            Within(low=math.degrees(needs.yaw_rate_rad_s)),
            f"primitives turn at {needs.yaw_rate_rad_s:g} rad/s",
            unit="deg/s",
        ),
        Requirement(
            "MPC_XY_VEL_MAX",
            Within(low=speed, step=0.1),
            f"{needs.speed_m_s:g} m/s and position control's {needs.correction_m_s:g}",
            unit="m/s",
        ),
        Requirement("MPC_Z_VEL_MAX_UP", Within(low=needs.climb_m_s, step=0.1), "flight.climb_m_s", unit="m/s"),
        Requirement("MPC_Z_VEL_MAX_DN", Within(low=needs.climb_m_s, step=0.1), "flight.climb_m_s", unit="m/s"),
        Requirement(
            "MPC_TILTMAX_AIR",
            Within(low=tilt_deg),
            f"curves need {needs.acceleration_m_s2:g} m/s^2 sideways",
            unit="deg",
        ),
        Requirement(
            "MPC_XY_VEL_P_ACC",
            Within(low=min(needs.yaw_rate_rad_s, 4.0), step=0.5),
            "velocity that follows as fast as primitives turn",
            _SHOULD,
            unit="1/s",
        ),
        Requirement("COM_OF_LOSS_T", Within(0.5, 5.0), "how long setpoints may be silent", unit="s"),
        Requirement(
            "COM_DISARM_PRFLT",
            Within(low=5.0, off=-1.0),
            "armed in OFFBOARD, the climb begins after 2 s",
            unit="s",
        ),
        Requirement("COM_OBL_RC_ACT", OneOf((4.0,)), "silent setpoints without a pilot: land", _SHOULD),
        Requirement("NAV_DLL_ACT", OneOf((0.0,)), "the team flies on when the ground station is closed", _SHOULD),
        *(_mocap() if needs.mocap else _gps()),
    )


def _mocap() -> tuple[Requirement, ...]:
    return (
        Requirement("EKF2_EV_CTRL", Bits(11), "position, height and heading from motion capture"),
        Requirement("EKF2_GPS_CTRL", OneOf((0.0,)), "GPS would fight motion capture"),
        Requirement("EKF2_HGT_REF", OneOf((3.0,)), "height from motion capture"),
        Requirement("SYS_HAS_GPS", OneOf((0.0,)), "else its checks wait for GPS", _SHOULD, reboot=True),
        Requirement("EKF2_MAG_TYPE", OneOf((5.0,)), "indoors the compass misleads", _SHOULD),
        Requirement("EKF2_BARO_CTRL", OneOf((1.0,)), "height to land by when motion capture is silent", _SHOULD),
    )


def _gps() -> tuple[Requirement, ...]:
    return (
        Requirement("EKF2_GPS_CTRL", Bits(5), "position and velocity from GPS"),
        Requirement("SYS_HAS_GPS", OneOf((1.0,)), "mission.position_source is gps", reboot=True),
    )
