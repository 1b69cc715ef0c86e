"""``arvi monitor``: the team in a terminal, for a shell on a field laptop; it commands nothing."""

from __future__ import annotations

import asyncio
import sys
import time

from gcs.exit_codes import EXIT_BAD_INPUT
from gcs.joining import joined_station, open_or_join
from gcs.output import is_read, open_console
from gcs.session import StopRequests, run_session
from gcs.team import TeamState
from gcs.terminal import open_display
from onboard.config import Scenario
from onboard.errors import OnboardError
from onboard.protocol import dialect as mavlink

__all__ = ["run_monitor"]


def run_monitor(scenario: Scenario, via: str | None, *, headless: bool) -> int:
    """Show the team until Ctrl-C, or until nobody reads it any more; the exit code.

    Args:
        scenario: Whose team.
        via: Shared port of a ground station, ``udpout:HOST:PORT``; None finds the way by itself.
        headless: Print lines, draw nothing.
    """
    try:
        asyncio.run(_watch(scenario, via, headless=headless))
    except OnboardError as error:
        sys.stderr.write(f"{error}\n")
        return EXIT_BAD_INPUT
    return 0


async def _watch(scenario: Scenario, via: str | None, *, headless: bool) -> None:
    station = joined_station(scenario)
    where = await open_or_join(station, via, mavsdk=False)
    station.team.note(time.time(), mavlink.MAV_SEVERITY_INFO, "monitor", where)
    stop = StopRequests()
    title, console = f"arvi monitor · {scenario.name}", open_console()

    def unread(_: TeamState) -> str | None:
        return None if is_read(console) else "nobody reads the output"

    try:
        with stop.listening(), open_display(console, scenario, title, headless=headless) as display:
            await run_session(station, display, stop, time.time, unread)
    finally:
        await station.close()
