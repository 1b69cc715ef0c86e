"""What the ground knows of one vehicle, from its autopilot, its onboard process and, when simulated, the truth."""

from __future__ import annotations

import math

from gcs.attention import Listening
from gcs.counter_rates import CounterRates
from gcs.tracking import TrackingMonitor
from gcs.vehicle_state import HEARTBEAT_TIMEOUT_S, VehicleFigures, VehicleState
from onboard.clock import unix_s
from onboard.geometry import Pose
from onboard.messages import FlightState, PeerPlan
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.link_quality import LinkQuality, SequenceMonitor
from onboard.protocol.px4_modes import Px4Mode

__all__ = ["VehicleMonitor"]

_AIRBORNE_HEIGHT_M = 0.3
_FRESH_S = 1.0
_AIRBORNE_LANDED_STATES = (
    mavlink.MAV_LANDED_STATE_IN_AIR,
    mavlink.MAV_LANDED_STATE_TAKEOFF,
    mavlink.MAV_LANDED_STATE_LANDING,
)


class VehicleMonitor:
    """Takes a vehicle's messages and keeps what the ground needs of them.

    Times that are passed in are the moments of arrival, in s of one clock.

    Args:
        vehicle_id: System id.
        tracking: Compares its true place with its plans; None does not.
        listening: When it could be heard: other times make no heartbeat older; None is always.
    """

    def __init__(
        self, vehicle_id: int, tracking: TrackingMonitor | None = None, listening: Listening | None = None
    ) -> None:
        self.id = vehicle_id
        self._listening = listening if listening is not None else Listening()
        self._true_tracking = tracking
        self._heartbeat: mavlink.MAVLink_heartbeat_message | None = None
        self._autopilot_s: float | None = None
        self._onboard_s: float | None = None
        self._status: mavlink.MAVLink_planner_status_message | None = None
        self._status_s: float | None = None
        self._first_status_s: float | None = None
        self._plan: PeerPlan | None = None
        self._local: mavlink.MAVLink_local_position_ned_message | None = None
        self._local_s: float | None = None
        self._attitude_yaw_rad: float | None = None
        self._attitude_s: float | None = None
        self._truth: mavlink.MAVLink_vehicle_truth_message | None = None
        self._battery: float | None = None
        self._landed_state = int(mavlink.MAV_LANDED_STATE_UNDEFINED)
        self._flew = False
        self._status_text: str | None = None
        self._rates = CounterRates()
        self._tracking_error_sum = 0.0
        self._tracking_error_count = 0
        self._planning_times_s: list[float] = []
        self._budgets_s: list[float] = []
        self._sequences: dict[int, SequenceMonitor] = {}
        self._delay_s: float | None = None
        self._landmarks: tuple[tuple[float, float], ...] = ()

    def sequence(self, component: int, number: int, now_s: float) -> None:
        """The sequence number of any frame of one of its components."""
        monitor = self._sequences.get(component)
        if monitor is None:
            monitor = self._sequences[component] = SequenceMonitor()
        monitor.receive(number, now_s)

    def autopilot_heartbeat(self, message: mavlink.MAVLink_heartbeat_message, now_s: float) -> None:
        """HEARTBEAT of component 1."""
        self._heartbeat = message
        self._autopilot_s = now_s
        self._note_flight()

    def onboard_heartbeat(self, now_s: float) -> None:
        """HEARTBEAT of component 191."""
        self._onboard_s = now_s

    def onboard_ended(self) -> None:
        """Its onboard process is gone; a heartbeat would say otherwise."""
        self._onboard_s = None

    def forget_links(self) -> None:
        """Frames have been missed that were not lost on the way: counting begins anew."""
        self._sequences.clear()

    def planner_status(self, message: mavlink.MAVLink_planner_status_message, now_s: float) -> None:
        """PLANNER_STATUS, once a step; one that a newer one has overtaken says nothing any more."""
        self._delay_s = now_s - message.time_usec * 1e-6
        if self._rates.overtaken(message):
            return
        self._rates.add(message)
        self._status = message
        self._status_s = now_s
        if self._first_status_s is None:
            self._first_status_s = now_s
        if message.state == FlightState.TRACK and math.isfinite(message.tracking_error):
            self._tracking_error_sum += message.tracking_error**2
            self._tracking_error_count += 1
        self._note_flight()

    def reports_for_s(self, now_s: float) -> float:
        """How long its onboard process has been heard to report, s; 0 before it has."""
        return 0.0 if self._first_status_s is None else now_s - self._first_status_s

    def plan(self, plan: PeerPlan) -> None:
        """ARVI_PLAN, once an epoch."""
        self._plan = plan
        if self._true_tracking is not None:
            self._true_tracking.plan(plan)
        if math.isfinite(plan.planning_time_s) and math.isfinite(plan.budget_s):
            self._planning_times_s.append(plan.planning_time_s)
            self._budgets_s.append(plan.budget_s)

    def landmarks(self, places: tuple[tuple[float, float], ...]) -> None:
        """ARVI_LANDMARKS: north m, east m of each."""
        self._landmarks = places

    def truth(self, message: mavlink.MAVLink_vehicle_truth_message) -> None:
        """VEHICLE_TRUTH, of a simulated vehicle."""
        self._truth = message
        if self._true_tracking is not None and self.flight_state is FlightState.TRACK:
            self._true_tracking.truth(message.time_usec * 1e-6, Pose(message.north, message.east, message.yaw))

    def battery(self, remaining_percent: int) -> None:
        """SYS_STATUS.battery_remaining, %; −1 is unknown."""
        self._battery = remaining_percent / 100 if remaining_percent >= 0 else None

    def local_position(self, message: mavlink.MAVLink_local_position_ned_message, now_s: float) -> None:
        """LOCAL_POSITION_NED, in the mission frame: the autopilot's estimate."""
        self._local = message
        self._local_s = now_s

    def attitude(self, yaw_rad: float, now_s: float) -> None:
        """ATTITUDE.yaw, rad."""
        self._attitude_yaw_rad = yaw_rad
        self._attitude_s = now_s

    def landed_state(self, landed_state: int) -> None:
        """EXTENDED_SYS_STATE.landed_state."""
        self._landed_state = landed_state
        self._note_flight()

    def status_text(self, text: str) -> None:
        """STATUSTEXT of either component."""
        self._status_text = text

    @property
    def armed(self) -> bool | None:
        """Whether its motors are armed; None if it was never heard."""
        if self._heartbeat is None:
            return None
        return bool(self._heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def mode(self) -> str | None:
        """The autopilot's mode; None if it was never heard."""
        if self._heartbeat is None:
            return None
        custom_mode = self._heartbeat.custom_mode
        if self._heartbeat.autopilot == mavlink.MAV_AUTOPILOT_PX4:
            return Px4Mode.name_of(custom_mode)
        if self._heartbeat.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
            return CopterMode.name_of(custom_mode)
        return str(custom_mode)

    @property
    def flight_state(self) -> FlightState | None:
        """What its onboard process says that it does; None if it was never heard or says what we do not know."""
        if self._status is None or self._status.state not in FlightState.__members__.values():
            return None
        return FlightState(self._status.state)

    @property
    def neighbours(self) -> frozenset[int]:
        """System ids that it hears."""
        return frozenset(i for i in self._status.neighbours if i) if self._status is not None else frozenset()

    @property
    def deadline_misses(self) -> int:
        """Plans that were late."""
        return self._status.deadline_misses if self._status is not None else 0

    def heartbeat_ages_s(self, now_s: float) -> tuple[float | None, float | None]:
        """Since the heartbeats of autopilot and onboard process, as far as one could be heard, s; None for never."""
        return self._silence_s(self._autopilot_s, now_s), self._silence_s(self._onboard_s, now_s)

    def place(self, now_s: float) -> tuple[float | None, float | None, float | None]:
        """North m, east m, age s: the autopilot says it more often than the status; first choice while it is heard."""
        local_age, status_age = _age(self._local_s, now_s), _age(self._status_s, now_s)
        if self._local is not None and (local_age or 0.0) <= max(_FRESH_S, status_age or 0.0):
            return _finite(self._local.x), _finite(self._local.y), local_age
        if self._status is not None:
            return _finite(self._status.north), _finite(self._status.east), status_age
        return None, None, None

    def state(self, now_s: float) -> VehicleState:
        """The vehicle at this moment."""
        status, plan, local = self._status, self._plan, self._local
        north_m, east_m, position_age_s = self.place(now_s)
        autopilot_age_s, onboard_age_s = self.heartbeat_ages_s(now_s)
        return VehicleState(
            id=self.id,
            flight_state=self.flight_state,
            mode=self.mode,
            armed=self.armed,
            battery=self._battery,
            north_m=north_m,
            east_m=east_m,
            height_m=self._height_m(now_s),
            autopilot_age_s=autopilot_age_s,
            onboard_age_s=onboard_age_s,
            mission_start_s=unix_s(status.mission_start_usec) if status and status.mission_start_usec else None,
            plan_age_s=_finite(status.plan_age) if status is not None else None,
            planning_time_s=plan.planning_time_s if plan is not None else None,
            planning_budget_s=plan.budget_s if plan is not None else None,
            plans=status.plans if status is not None else 0,
            deadline_misses=self.deadline_misses,
            setpoint_rate_hz=self._rates.lately("setpoints"),
            tracking_error_m=_finite(status.tracking_error) if status is not None else None,
            neighbours=tuple(i for i in status.neighbours if i) if status is not None else (),
            targets=status.targets if status is not None else 0,
            flew=self._flew,
            landed=self._landed(),
            status_text=self._status_text,
            yaw_rad=self._yaw_rad(now_s),
            speed_m_s=_finite(math.hypot(local.vx, local.vy)) if local is not None else None,
            position_age_s=position_age_s,
            plan=plan,
            autopilot=self._heartbeat.autopilot if self._heartbeat is not None else None,
            link=self._link(now_s),
            delay_s=self._delay_s,
            peer_loss=_peer_loss(status),
            landmarks=self._landmarks,
        )

    def figures(self) -> VehicleFigures:
        """The flight in figures."""
        status, truth = self._status, self._truth
        rate, gap, separation = self._rates.tracking("setpoints"), None, None
        if status is not None and status.setpoints > 0:
            gap = _finite(status.setpoint_gap_max)
        if truth is not None:
            separation = _finite(truth.min_separation)
            if math.isfinite(truth.setpoint_gap_max):  # counted where setpoints arrive: a simulated autopilot
                rate = (truth.setpoints - 1) / truth.setpoint_time if truth.setpoint_time > 0.0 else None
                gap = truth.setpoint_gap_max if truth.setpoints > 1 else None
        errors = self._tracking_error_count
        return VehicleFigures(
            setpoint_rate_hz=rate,
            setpoint_gap_max_s=gap,
            plans=status.plans if status is not None else None,
            deadline_misses=status.deadline_misses if status is not None else None,
            planning_time_p99_s=_percentile(self._planning_times_s, 0.99),
            planning_budget_s=_percentile(self._budgets_s, 0.5),
            peer_bytes_per_s=self._rates.tracking("peer_bytes_sent"),
            peer_bytes_received_per_s=self._rates.tracking("peer_bytes_received"),
            tracking_error_rms_m=math.sqrt(self._tracking_error_sum / errors) if errors else None,
            true_tracking=self._true_tracking.figures() if self._true_tracking is not None else None,
            min_separation_m=separation,
            landed=self._landed(),
            disarmed=None if self.armed is None else not self.armed,
        )

    def _silence_s(self, then_s: float | None, now_s: float) -> float | None:
        return None if then_s is None else self._listening.duration_s(then_s, now_s)

    def _link(self, now_s: float) -> LinkQuality | None:
        parts = [monitor.quality(now_s) for monitor in self._sequences.values()]
        if not any(part.received for part in parts):
            return None
        return LinkQuality(
            received=sum(part.received for part in parts),
            lost=sum(part.lost for part in parts),
            duplicated=sum(part.duplicated for part in parts),
        )

    def _height_m(self, now_s: float) -> float | None:
        """From the onboard process while it is alive (mission frame), else from the autopilot itself."""
        age = self._silence_s(self._onboard_s, now_s)
        if self._status is not None and age is not None and age < HEARTBEAT_TIMEOUT_S:
            return _finite(-self._status.down)
        return _finite(-self._local.z) if self._local is not None else None

    def _yaw_rad(self, now_s: float) -> float | None:
        age = _age(self._attitude_s, now_s)
        if self._attitude_yaw_rad is not None and (age or 0.0) <= max(_FRESH_S, _age(self._status_s, now_s) or 0.0):
            return _finite(self._attitude_yaw_rad)
        return _finite(self._status.yaw) if self._status is not None else None

    def _note_flight(self) -> None:
        """Armed and off the ground: it flies."""
        if not self.armed or self._flew:
            return
        self._flew = self._landed_state in _AIRBORNE_LANDED_STATES or (
            self._status is not None and -self._status.down > _AIRBORNE_HEIGHT_M
        )

    def _landed(self) -> bool:
        if not self._flew:
            return False
        if self._landed_state != mavlink.MAV_LANDED_STATE_UNDEFINED:
            return self._landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
        return self.flight_state is FlightState.LANDED or not self.armed


def _peer_loss(status: mavlink.MAVLink_planner_status_message | None) -> dict[int, float]:
    if status is None:
        return {}
    pairs = zip(status.neighbours, status.neighbour_loss, strict=True)
    return {neighbour: percent / 100.0 for neighbour, percent in pairs if neighbour and percent <= 100}


def _age(then_s: float | None, now_s: float) -> float | None:
    return None if then_s is None else max(0.0, now_s - then_s)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _percentile(values: list[float], fraction: float) -> float | None:
    """The smallest value that at least this fraction of the values does not exceed (nearest rank)."""
    if not values:
        return None
    return sorted(values)[max(0, math.ceil(fraction * len(values)) - 1)]
