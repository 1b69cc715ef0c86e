"""A scenario as a table that a person can check (``arvi check``)."""

from __future__ import annotations

from pathlib import Path

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from onboard.config import Scenario

__all__ = ["render_scenario"]


def render_scenario(config: Path, scenario: Scenario) -> RenderableType:
    """What a scenario flies, in words and units."""
    mission, sensor, targets = scenario.mission, scenario.sensor, scenario.targets
    norths, easts = zip(*mission.fence, strict=True)
    facts = Table.grid(padding=(0, 2))
    facts.add_column(style="dim")
    facts.add_column()
    facts.add_row(
        "area", f"{max(norths) - min(norths):g} m north × {max(easts) - min(easts):g} m east, {len(norths)} corners"
    )
    facts.add_row(
        "planning",
        f"T = {mission.horizon} steps of {mission.step_s:g} s, a new plan every {mission.epoch_s:g} s, "
        f"{mission.planning_time_s:g} s for the group",
    )
    speeds = sorted({speed for speed, _ in scenario.primitives})
    rates = sorted({rate for _, rate in scenario.primitives})
    facts.add_row(
        "primitives",
        f"{len(scenario.primitives)}: ν ∈ {{{_list(speeds)}}} m/s, ω ∈ {{{_list(rates)}}} rad/s",
    )
    facts.add_row(
        "sensor",
        f"{sensor.max_range_m:g} m, {sensor.fov_deg:g}°, σ_r = {sensor.range_std_m:g} m, "
        f"σ_b = {sensor.bearing_std_deg:g}°",
    )
    unit = "m²/s³" if targets.model == "double_integrator" else "m²/s"
    noise = "" if targets.model == "static" else f", q = {targets.noise:g} {unit}"
    facts.add_row("targets", f"{targets.model}{noise}")
    facts.add_row("simulated", _simulated(scenario))
    facts.add_row("ground station", scenario.ground.url)
    external = [str(vehicle.id) for vehicle in scenario.vehicles if vehicle.external is not None]
    if external:
        facts.add_row("external", f"vehicles {', '.join(external)}: their autopilots run elsewhere")
    vehicles = Table(box=SIMPLE_HEAD, header_style="dim")
    for name in ("vehicle", "home north, east m", "layer m"):
        vehicles.add_column(name, justify="right")
    for name in ("autopilot link", "peers", "sensor", "ground"):
        vehicles.add_column(name, overflow="fold")
    for vehicle in scenario.vehicles:
        vehicles.add_row(
            str(vehicle.id),
            f"{vehicle.home[0]:g}, {vehicle.home[1]:g}",
            f"{vehicle.layer_m:g}",
            *(
                _short(url)
                for url in (vehicle.autopilot_url, vehicle.peers_url, vehicle.sensor_url, vehicle.ground_url)
            ),
        )
    return Group(
        Text.assemble((f"{config}: ", "dim"), (scenario.name, "bold"), (" is valid", "green")), facts, vehicles
    )


def _simulated(scenario: Scenario) -> str:
    simulation = scenario.simulation
    if simulation is None:
        return "nothing: real vehicles"
    radio = "everybody" if simulation.radio.range_m is None else f"{simulation.radio.range_m:g} m"
    loss = f", {100 * simulation.radio.loss:g} % lost" if simulation.radio.loss else ""
    robots = simulation.ground_robots
    mocap = f"motion capture {simulation.mocap.rate_hz:g} Hz" if scenario.mission.position_source == "mocap" else "GPS"
    robots_text = f"{robots.count} ground robots up to {robots.max_speed_m_s:g} m/s"
    return f"{robots_text}, {mocap}, radio reaches {radio}{loss}, seed {simulation.seed}"


def _list(values: list[float]) -> str:
    return ", ".join(f"{value:g}" for value in values)


def _short(url: str) -> str:
    """Loopback goes without saying; an arrow tells sending from listening."""
    return url.replace("127.0.0.1:", "").replace("udpout:", "→ ").replace("udpin:", "")
