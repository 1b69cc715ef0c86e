"""The bridge process: gives the bridge sockets and real time (``arvi bridge CONFIG``)."""

from __future__ import annotations

import asyncio
import functools
import gc
import logging
import math
import resource
import signal
import struct
import time
from collections.abc import Callable
from typing import Any

from onboard.config import Scenario
from onboard.config.faults import Place
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import Link, TransportError, open_datagram_link
from onboard.realtime import make_this_thread_urgent
from sim_bridge.autopilot.links import GCS, ONBOARD, LinkName
from sim_bridge.bridge import Bridge, Port, build_bridge
from sim_bridge.errors import BridgeError, require_simulation
from sim_bridge.mocap.library import LibraryReader
from sim_bridge.ports import Address, BridgePorts, find_ports

__all__ = ["BridgeProcess", "run_bridge"]

AUTOPILOT_COMPONENT = 1
"""MAV_COMP_ID_AUTOPILOT1, also the bridge's own component."""

MAX_DATAGRAM_BYTES = 1400
"""Messages of one instant share datagrams of at most this size, which fits an Ethernet frame."""

_log = logging.getLogger(__name__)


class BridgeProcess:
    """One bridge in real time, between its sockets.

    Used as: ``await open()``, ``start()``, later ``close()``. Callbacks run in the event loop; what they raise goes to
    the loop's exception handler.
    """

    def __init__(
        self, bridge: Bridge, ports: BridgePorts, system_id: int, clock: Callable[[], float], *, ground_id: int
    ) -> None:
        """Prepare; nothing is opened yet.

        Args:
            bridge: What is simulated.
            ports: Where everybody is.
            system_id: The bridge's own system id.
            clock: UNIX time, s.
            ground_id: System id of the ground station, which alone commands the bridge.
        """
        self._bridge = bridge
        self._ground_id = ground_id
        self._ports = ports
        self._clock = clock
        self._links: list[Link] = []
        self._out: dict[tuple[Port, int], tuple[Codec, Link]] = {}
        self._radio_links: dict[int, Link] = {}
        self._system_id = system_id
        self._timer: asyncio.TimerHandle | None = None
        self._radio_timer: asyncio.TimerHandle | None = None
        self._refused: set[tuple[int, str]] = set()

    async def open(self) -> None:
        """Open all sockets.

        Raises:
            TransportError: One of them is not to be had; those already open are closed again.
        """
        try:
            for vehicle_id, ports in self._ports.vehicles.items():
                if ports.autopilot is not None:
                    own = ports.autopilot
                    await self._open_autopilot(vehicle_id, ONBOARD, own.onboard, own.onboard_local)
                    await self._open_autopilot(vehicle_id, GCS, self._ports.ground, own.gcs_local)
                if ports.external is not None:
                    await self._open_external(vehicle_id, ports.external)
                await self._open_own(Port.SENSOR, vehicle_id, ports.sensor)
                if ports.radio_local is not None:
                    receive = functools.partial(self._receive_broadcast, vehicle_id)
                    link = await self._open(_url("udpin", ports.radio_local), receive)
                    self._radio_links[vehicle_id] = link
            await self._open_own(Port.TRUTH, 0, self._ports.ground, self._receive_own)
        except TransportError:
            self.close()
            raise

    def start(self) -> None:
        """Start the clockwork."""
        self._timer = asyncio.get_running_loop().call_later(0.0, self._tick)

    def close(self) -> None:
        """Stop the clockwork and close all sockets."""
        for timer in (self._timer, self._radio_timer):
            if timer is not None:
                timer.cancel()
        for link in self._links:
            link.close()

    async def _open(
        self, url: str, receive: Callable[[bytes], None] | None = None, local: Address | None = None
    ) -> Link:
        link = await open_datagram_link(url, receive, local=local)
        self._links.append(link)
        return link

    async def _open_autopilot(self, vehicle_id: int, link: LinkName, remote: Address, local: Address) -> None:
        # Each link numbers its own frames, as PX4's do.
        codec = Codec(vehicle_id, AUTOPILOT_COMPONENT)
        receive = functools.partial(self._receive_command, vehicle_id, link, codec)
        self._out[Port(link), vehicle_id] = (codec, await self._open(_url("udpout", remote), receive, local))

    async def _open_external(self, vehicle_id: int, url: str) -> None:
        """Open the bridge's own link to an autopilot that runs elsewhere."""
        codec = Codec(self._system_id, AUTOPILOT_COMPONENT)
        receive = functools.partial(self._receive_external, vehicle_id, codec)
        self._out[Port.EXTERNAL, vehicle_id] = (codec, await self._open(url, receive))

    async def _open_own(
        self, port: Port, vehicle_id: int, remote: Address, receive: Callable[[Codec, bytes], None] | None = None
    ) -> None:
        """Open a link on which the bridge speaks as itself."""
        codec = Codec(self._system_id, AUTOPILOT_COMPONENT)
        hear = functools.partial(receive, codec) if receive is not None else None
        self._out[port, vehicle_id] = (codec, await self._open(_url("udpout", remote), hear))

    def _tick(self) -> None:
        self._bridge.advance(self._clock())
        self.send()
        for notice in self._bridge.notices():
            level = logging.WARNING if notice.severity <= mavlink.MAV_SEVERITY_WARNING else logging.INFO
            _log.log(level, "%s", notice.text)
        # The grid of the steps sets the next time, so lateness does not add up.
        delay_s = self._bridge.pacer.next_s - self._clock()
        self._timer = asyncio.get_running_loop().call_later(max(0.0, delay_s), self._tick)

    def _receive_command(self, vehicle_id: int, link: LinkName, codec: Codec, datagram: bytes) -> None:
        now_s = self._clock()
        for message in codec.decode(datagram):
            self._bridge.receive(vehicle_id, link, message, now_s)

    def _receive_external(self, vehicle_id: int, codec: Codec, datagram: bytes) -> None:
        now_s = self._clock()
        for message in codec.decode(datagram):
            self._bridge.receive_external(vehicle_id, message, now_s)

    def _receive_own(self, codec: Codec, datagram: bytes) -> None:
        """Obey the ground station's commands to the bridge itself."""
        for message in codec.decode(datagram):
            if (
                isinstance(message, mavlink.MAVLink_command_long_message)
                and message.target_system == self._system_id
                and message.get_srcSystem() == self._ground_id
            ):
                self._bridge.obey(message, self._clock())

    def _receive_broadcast(self, vehicle_id: int, datagram: bytes) -> None:
        self._bridge.broadcast(vehicle_id, datagram, self._clock())
        self._schedule_radio()

    def _schedule_radio(self) -> None:
        """Wake up when the next datagram arrives: a radio's milliseconds are shorter than a physics step."""
        if self._radio_timer is not None:
            self._radio_timer.cancel()
            self._radio_timer = None
        due_s = self._bridge.radio.next_due_s
        if due_s is not None:
            delay_s = max(0.0, due_s - self._clock())
            self._radio_timer = asyncio.get_running_loop().call_later(delay_s, self._deliver_broadcasts)

    def _deliver_broadcasts(self) -> None:
        for delivery in self._bridge.radio.deliveries(self._clock()):
            link = self._radio_links.get(delivery.receiver)
            if link is not None:
                link.send(delivery.datagram)
        self._schedule_radio()

    def send(self) -> None:
        """Send what the bridge has to say; messages of one link share datagrams."""
        batches: dict[tuple[Port, int], bytearray] = {}
        for port, vehicle_id, message in self._bridge.outbox():
            key = (port, vehicle_id)
            codec, link = self._out[key]
            try:
                frame = codec.encode(message)
            except struct.error as error:
                # One vehicle's estimate that has run away must not take the others' world with it.
                self._refuse(vehicle_id, message.get_type(), error)
                continue
            batch = batches.setdefault(key, bytearray())
            if len(batch) + len(frame) > MAX_DATAGRAM_BYTES:
                link.send(bytes(batch))
                batch.clear()
            batch += frame
        for key, batch in batches.items():
            self._out[key][1].send(bytes(batch))

    def _refuse(self, vehicle_id: int, name: str, error: struct.error) -> None:
        if (vehicle_id, name) not in self._refused:
            _log.warning("vehicle %d: %s holds a value that its field cannot: %s (said once)", vehicle_id, name, error)
        self._refused.add((vehicle_id, name))


async def _serve(scenario: Scenario, seed: int | None) -> int:
    simulation = require_simulation(scenario)
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    failures: list[BaseException | str] = []

    def fail(_: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        # A world that goes on after half a step is no world: say what happened and stop.
        failures.append(context.get("exception") or str(context["message"]))
        stop.set()

    loop.set_exception_handler(fail)
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    bridge = build_bridge(scenario, seed, time.time(), {Place.BRIDGE, Place.ONBOARD})
    process = BridgeProcess(
        bridge, find_ports(scenario), simulation.system_id, time.time, ground_id=scenario.ground.system_id
    )
    await process.open()
    # Autopilots are real-time computers; a busy host should not make them look as if they had stalled.
    make_this_thread_urgent()
    # What lives as long as the process need not be looked through at every collection.
    gc.collect()
    gc.freeze()
    started_s, cpu_s = time.monotonic(), _cpu_s()
    reader = None
    if scenario.mocap is not None:
        mocap = LibraryReader(scenario.mocap, lambda frame: bridge.receive_frame(frame, time.time()), bridge.tell)
        reader = asyncio.ensure_future(mocap.run())
    try:
        process.start()
        vehicles = ", ".join(str(vehicle.id) for vehicle in scenario.vehicles)
        _log.info(
            "scenario %s runs: vehicles %s, %d ground robots", scenario.name, vehicles, simulation.ground_robots.count
        )
        await stop.wait()
    finally:
        if reader is not None:
            reader.cancel()
            await asyncio.wait([reader])
        process.close()
    for failure in failures:
        if isinstance(failure, BaseException):
            _log.error("the simulation failed", exc_info=failure)
        else:
            _log.error("the simulation failed: %s", failure)
    _report(bridge, time.monotonic() - started_s, _cpu_s() - cpu_s)
    return 1 if failures else 0


def run_bridge(scenario: Scenario, *, seed: int | None = None) -> int:
    """Run the bridge of a scenario until SIGINT or SIGTERM.

    Args:
        scenario: What to simulate.
        seed: Decides everything random; None takes the scenario's.

    Returns:
        The exit code: 0 after a signal, 1 if the simulation failed, 2 if it could not start (the reason is logged).
    """
    try:
        return asyncio.run(_serve(scenario, seed))
    except KeyboardInterrupt:  # before the loop took over the signals
        return 0
    except TransportError as error:
        _log.error(
            "%s Stop the other program, or give this scenario other ports (vehicles[].links, ground.url).", error
        )
        return 2
    except BridgeError as error:
        _log.error("%s", error)
        return 2


def _url(kind: str, address: Address) -> str:
    return f"{kind}:{address[0]}:{address[1]}"


def _cpu_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _report(bridge: Bridge, elapsed_s: float, cpu_s: float) -> None:
    """Log how the run went."""
    pacer = bridge.pacer
    _log.info(
        "ran %.1f s on %.0f %% of a core; %.3f s skipped in %d stalls; %d looks missed",
        elapsed_s,
        100.0 * cpu_s / max(elapsed_s, 1e-9),
        pacer.skipped_s,
        pacer.stalls,
        bridge.detector.looks_missed,
    )
    for vehicle_id, separation_m in bridge.world.min_separation_m.items():
        if math.isfinite(separation_m):
            _log.info("vehicle %d: min separation %.2f m", vehicle_id, separation_m)
    for (sender, receiver), link in sorted(bridge.radio.links.items()):
        _log.info(
            "radio %d to %d: %d delivered (%d bytes), %d lost, %d out of range",
            sender,
            receiver,
            link.delivered,
            link.delivered_bytes,
            link.lost,
            link.out_of_range,
        )
