"""All that makes a bridge's components fail, in one place."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

from onboard.config.faults import FaultConfig
from sim_bridge.faults.autopilot import FaultyAutopilot
from sim_bridge.faults.detections import FaultyDetections
from sim_bridge.faults.live import LiveFaults
from sim_bridge.faults.poses import FaultyPoses
from sim_bridge.faults.radio import FaultyRadio
from sim_bridge.faults.schedule import FaultSchedule
from sim_bridge.models import AutopilotModel
from sim_bridge.radio import Radio
from sim_bridge.seeding import Stream, generator

__all__ = ["FaultInjection"]


class FaultInjection:
    """The faults of one bridge.

    Args:
        script: What is to happen.
        seed: Decides what happens by chance.
        vehicles: System ids.
        targets: Ids of the targets.
        time_s: UNIX time from which faults since boot count, s.
        live: Whether faults may be injected by command.

    Attributes:
        schedule: What is wrong when.
        live: Injects faults by command.
        detections: The way from the detectors to the onboard processes.
        poses: The way from motion capture to the autopilots.
    """

    def __init__(
        self,
        script: Iterable[FaultConfig],
        seed: int,
        vehicles: Collection[int],
        targets: Sequence[int],
        time_s: float,
        *,
        live: bool = False,
    ) -> None:
        self.schedule = FaultSchedule(script, time_s)
        self.live = LiveFaults(self.schedule, vehicles, allowed=live)
        self.detections = FaultyDetections(self.schedule, generator(seed, Stream.DETECTOR_FAULTS), targets)
        self.poses = FaultyPoses(self.schedule, generator(seed, Stream.MOCAP_FAULTS))
        self._seed = seed
        self._radio_rng = generator(seed, Stream.RADIO_FAULTS)

    def radio(self, radio: Radio) -> FaultyRadio:
        """A radio with its faults."""
        return FaultyRadio(radio, self.schedule, self._radio_rng)

    def autopilot(self, vehicle_id: int, boot: Callable[[float], AutopilotModel], time_s: float) -> FaultyAutopilot:
        """An autopilot with its faults.

        Args:
            vehicle_id: Whose.
            boot: Switches it on at a UNIX time, s.
            time_s: UNIX time at which that happens first, s.
        """
        rng = generator(self._seed, Stream.LINK_FAULTS, vehicle_id)
        return FaultyAutopilot(vehicle_id, boot, self.schedule, rng, time_s)
