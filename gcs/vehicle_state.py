"""A vehicle as the ground sees it: at one moment, and its whole flight in figures."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from gcs.tracking import TrackingFigures
from onboard.messages import FlightState, PeerPlan
from onboard.protocol.link_quality import LinkQuality

__all__ = ["HEARTBEAT_TIMEOUT_S", "VehicleFigures", "VehicleState"]

HEARTBEAT_TIMEOUT_S = 4.5
"""A component is lost after 4–5 missed heartbeats of 1 Hz (https://mavlink.io/en/services/heartbeat.html)."""


@dataclass(frozen=True, slots=True)
class VehicleState:
    """A vehicle at one moment; None is what has not been heard.

    Attributes:
        id: System id.
        flight_state: What its onboard process is doing.
        mode: Its autopilot's mode: the name that PX4 or ArduPilot has for it, or the number of another autopilot.
        armed: Whether its motors are armed.
        battery: Charge left, from 0 to 1.
        north_m: Position in the mission frame, m.
        east_m: Position in the mission frame, m.
        height_m: Above the ground, m.
        autopilot_age_s: Since its autopilot's last heartbeat arrived, s; time in which the ground station could hear
            nobody does not count.
        onboard_age_s: The same of its onboard process.
        mission_start_s: UNIX time of step 0 that it has taken.
        plan_age_s: Since the start of the epoch whose plan it flies, s.
        planning_time_s: Time that its last plan took, s.
        planning_budget_s: Time that this plan was given, s.
        plans: Plans made.
        deadline_misses: Plans that were late.
        setpoint_rate_hz: Setpoints sent per second lately.
        tracking_error_m: Horizontal distance from its planned trajectory, m.
        neighbours: System ids that it hears.
        targets: Targets that it knows.
        flew: Whether it has been in the air since the ground station started.
        landed: Whether it has flown and is on the ground again.
        status_text: The last text that it sent.
        yaw_rad: Heading, clockwise from north, rad.
        speed_m_s: Over ground, m/s.
        position_age_s: Since its position arrived, s.
        plan: The last plan that it published; its step counts from 1970.
        autopilot: MAV_AUTOPILOT.
        link: Frames of both its components in the last ten seconds; None if there were none.
        delay_s: From its last status to its arrival, by the clocks of both sides, s.
        peer_loss: Frames lost over frames sent, 0 to 1, of each neighbour that it hears; without those unknown.
        landmarks: North m, east m of its exploration landmarks.
    """

    id: int
    flight_state: FlightState | None
    mode: str | None
    armed: bool | None
    battery: float | None
    north_m: float | None
    east_m: float | None
    height_m: float | None
    autopilot_age_s: float | None
    onboard_age_s: float | None
    mission_start_s: float | None
    plan_age_s: float | None
    planning_time_s: float | None
    planning_budget_s: float | None
    plans: int
    deadline_misses: int
    setpoint_rate_hz: float | None
    tracking_error_m: float | None
    neighbours: tuple[int, ...]
    targets: int
    flew: bool
    landed: bool
    status_text: str | None
    yaw_rad: float | None = None
    speed_m_s: float | None = None
    position_age_s: float | None = None
    plan: PeerPlan | None = None
    autopilot: int | None = None
    link: LinkQuality | None = None
    delay_s: float | None = None
    peer_loss: Mapping[int, float] = field(default_factory=dict)
    landmarks: tuple[tuple[float, float], ...] = ()

    @property
    def onboard_alive(self) -> bool:
        """Whether its onboard process is heard."""
        return self.onboard_age_s is not None and self.onboard_age_s < HEARTBEAT_TIMEOUT_S

    @property
    def autopilot_alive(self) -> bool:
        """Whether its autopilot is heard."""
        return self.autopilot_age_s is not None and self.autopilot_age_s < HEARTBEAT_TIMEOUT_S

    @property
    def safe_on_ground(self) -> bool:
        """Whether nothing is left to land: it has landed and disarmed, or has never flown and is not armed."""
        return not self.armed and (self.landed or not self.flew)


@dataclass(frozen=True, slots=True)
class VehicleFigures:
    """A vehicle's flight in figures; None is what nobody reported.

    Attributes:
        setpoint_rate_hz: Setpoints per second that its autopilot received while armed and offboard, Hz; those sent
            while tracking when there is no simulation to count what arrives.
        setpoint_gap_max_s: Longest pause between them, s.
        plans: Plans made.
        deadline_misses: Plans that were late.
        planning_time_p99_s: 99th percentile of the time that a plan took, s.
        planning_budget_s: Time that a plan was given, at the median, s.
        peer_bytes_per_s: Sent to its peers per second while tracking, bytes/s.
        peer_bytes_received_per_s: Received from its peers per second while tracking, bytes/s.
        tracking_error_rms_m: Root mean square of the horizontal distance from the planned trajectory, as the vehicle
            knows its place itself, m.
        true_tracking: The same with its true place and heading, where somebody tells it.
        min_separation_m: Smallest true distance in three dimensions to another vehicle, m.
        landed: Whether it flew and is on the ground again.
        disarmed: Whether its motors are off.
    """

    setpoint_rate_hz: float | None
    setpoint_gap_max_s: float | None
    plans: int | None
    deadline_misses: int | None
    planning_time_p99_s: float | None
    planning_budget_s: float | None
    peer_bytes_per_s: float | None
    peer_bytes_received_per_s: float | None
    tracking_error_rms_m: float | None
    true_tracking: TrackingFigures | None
    min_separation_m: float | None
    landed: bool
    disarmed: bool | None
