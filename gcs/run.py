"""What ``arvi fly`` and ``arvi gcs`` do once their arguments are understood; the exit codes."""

from __future__ import annotations

import asyncio
import math
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from gcs import summary
from gcs.dashboard.start import DashboardOptions, OpenDashboard, open_dashboard
from gcs.errors import GroundError
from gcs.exit_codes import EXIT_BAD_INPUT, EXIT_FAILED
from gcs.folder import run_folder
from gcs.launcher import FlightOptions, fly
from gcs.mission import MissionDirector
from gcs.operator_desk import OperatorDesk
from gcs.output import open_console
from gcs.recording.display import RecordedDisplay
from gcs.recording.recorder import record_flight
from gcs.session import Display, StopRequests, run_session
from gcs.station import GroundStation
from gcs.terminal import open_display
from onboard.config import Scenario
from onboard.errors import OnboardError

__all__ = ["RecordingOptions", "run_flight", "run_station"]


@dataclass(frozen=True, slots=True)
class RecordingOptions:
    """Whether and where a flight is recorded.

    Attributes:
        parent: Each flight gets a new folder in it; None records nothing.
        limit_mb: A recording stops at about this size, MB.
    """

    parent: Path | None
    limit_mb: int


def run_flight(
    config: Path,
    scenario: Scenario,
    duration_s: float,
    seed: int | None,
    recording: RecordingOptions,
    json_path: Path | None,
    version: str,
    *,
    headless: bool,
    dashboard: DashboardOptions,
) -> int:
    """Fly a simulated team and print the summary; the exit code.

    Args:
        config: The scenario's file.
        scenario: What it says.
        duration_s: From step 0 to landing, s.
        seed: Of the simulation; None takes the scenario's.
        recording: Whether and where it is recorded.
        json_path: File for the summary.
        version: Of this program.
        headless: Print lines, draw nothing.
        dashboard: Whether and where it is served.
    """
    console = open_console()
    desk = OperatorDesk()
    simulated = scenario.simulation
    options = FlightOptions(
        config=config,
        scenario=scenario,
        duration_s=duration_s,
        seed=seed if seed is not None else simulated.seed if simulated is not None else 0,
        record=recording.parent,
        version=version,
        record_limit_mb=recording.limit_mb,
    )
    title = f"arvi · {scenario.name} · seed {options.seed}"
    try:
        with (
            open_dashboard(dashboard, scenario, desk, console, headless=headless) as browser,
            open_display(console, scenario, _titled(title, browser), headless=headless) as terminal,
        ):
            display = browser.beside(terminal) if browser is not None else terminal
            result = asyncio.run(fly(options, display, desk=desk))
        if result.summary is not None:
            console.print(summary.render(result.summary))
            if json_path is not None:
                summary.write_json(result.summary, json_path)
    except (GroundError, OnboardError) as error:
        sys.stderr.write(f"{error}\n")
        return EXIT_BAD_INPUT
    if result.folder is not None:
        console.print(f"recording and logs: {result.folder}", soft_wrap=True)
    return EXIT_FAILED if result.problems else 0


def run_station(
    config: Path,
    scenario: Scenario,
    duration_s: float | None,
    recording: RecordingOptions,
    version: str,
    *,
    start: bool,
    headless: bool,
    dashboard: DashboardOptions,
) -> int:
    """Run the ground station alone; the exit code.

    Args:
        config: The scenario's file.
        scenario: What it says.
        duration_s: From step 0 to landing, s; None flies until stopped.
        recording: Whether and where it is recorded.
        version: Of this program.
        start: Start and land the team; otherwise only watch.
        headless: Print lines, draw nothing.
        dashboard: Whether and where it is served.
    """
    console = open_console()
    desk = OperatorDesk()
    mission = scenario.mission
    director = None
    if start:
        limit_s = math.inf if duration_s is None else duration_s
        director = MissionDirector(mission.step_s, mission.takeoff_time_s, limit_s)
    try:
        with run_folder(recording.parent, scenario.name) as folder:
            folder.keep = False
            recorder = None
            if recording.parent is not None:
                about = {"scenario": scenario.name, "version": version}
                try:
                    recorder = record_flight(folder.path, config, scenario, about, recording.limit_mb)
                    console.print(f"recording to {folder.path}", soft_wrap=True)
                except GroundError as error:
                    console.print(f"nothing is recorded: {error}", style="yellow", soft_wrap=True)
            station = GroundStation(scenario, director=director, recorder=recorder, desk=desk)

            def opened() -> None:
                folder.keep = recorder is not None

            title = f"arvi · {scenario.name}"
            with (
                open_dashboard(dashboard, scenario, desk, console, headless=headless) as browser,
                open_display(console, scenario, _titled(title, browser), headless=headless) as terminal,
            ):
                display = browser.beside(terminal) if browser is not None else terminal
                if recorder is not None:
                    display = RecordedDisplay(display, recorder)
                reason = asyncio.run(_watch(station, display, opened))
            if recorder is not None:
                recorder.close()
                problems = () if reason is None else (reason,)
                for warning in (*recorder.take_warnings(), *_keep_summary(folder.path, station, version, problems)):
                    console.print(warning, style="yellow", soft_wrap=True)
                console.print(f"recording: {folder.path}", soft_wrap=True)
    except (GroundError, OnboardError) as error:
        sys.stderr.write(f"{error}\n")
        return EXIT_BAD_INPUT
    if reason is not None:
        sys.stderr.write(f"{reason}\n")
    return 0 if reason is None else EXIT_FAILED


def _titled(title: str, dashboard: OpenDashboard | None) -> str:
    return title if dashboard is None else f"{title} · {dashboard.url}"


def _keep_summary(folder: Path, station: GroundStation, version: str, problems: tuple[str, ...]) -> list[str]:
    """Write what was flown beside the recording; why that cannot be done."""
    now_s = time.time()
    facts = summary.FlightFacts(
        scenario=station.scenario.name,
        version=version,
        seed=None,
        mission_start_s=station.team.state(now_s).mission_start_s,
        mission_end_s=station.director.landing_since_s if station.director is not None else None,
        cpu_cores=None,
        cpu_s={},
        problems=problems,
    )
    try:
        summary.write_json(summary.summarize(station.team, facts, now_s), folder / "summary.json")
    except GroundError as error:
        return [str(error)]
    return []


async def _watch(station: GroundStation, display: Display, opened: Callable[[], None]) -> str | None:
    stop = StopRequests()
    await station.open()
    opened()
    try:
        with stop.listening():
            return await run_session(station, display, stop, time.time)
    finally:
        await station.close()
