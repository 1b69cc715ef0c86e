"""What a conformance session found, as lines while it goes on and as a table at its end."""

from __future__ import annotations

from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from gcs.output import printable
from sim_bridge.conformance import Catalogue, Outcome, Plan, Result, Session, select

__all__ = ["Progress", "print_entries", "print_summary"]

_STYLES = {Outcome.HOLDS: "green", Outcome.DIFFERS: "bold red", Outcome.SKIPPED: "dim"}


class Progress:
    """A line for each entry as it is done, and on a terminal the one that is being performed.

    Args:
        console: Where to.
    """

    def __init__(self, console: Console) -> None:
        self._console = console
        self._printed = 0
        self._live = Live(console=console, refresh_per_second=4, transient=True) if console.is_terminal else None
        self._shown = ""

    def __enter__(self) -> Progress:
        if self._live is not None:
            self._live.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def update(self, session: Session) -> None:
        """Show what is new."""
        for result in session.results[self._printed :]:
            self._console.print(_line(result), soft_wrap=True)
        self._printed = len(session.results)
        now = "" if session.current is None else session.current.id
        if self._live is not None and now != self._shown:
            self._shown = now
            self._live.update(Text(f"… {now}" if now else "", style="cyan"))


def _line(result: Result) -> Text:
    line = Text(f"{result.outcome:8}", style=_STYLES[result.outcome])
    line.append(f"{result.entry.id:44}", style="default")
    if result.reason:
        line.append(printable(result.reason))
    elif result.slowest_s is not None:
        line.append(
            f"{1e3 * result.slowest_s:.0f} ms" if result.slowest_s < 1.0 else f"{result.slowest_s:.1f} s", "dim"
        )
    return line


def print_summary(console: Console, session: Session) -> None:
    """How many hold, by group."""
    groups: dict[str, dict[Outcome, int]] = {}
    for result in session.results:
        counts = groups.setdefault(result.entry.id.partition("/")[0], dict.fromkeys(Outcome, 0))
        counts[result.outcome] += 1
    table = Table(title=f"{session.catalogue.family}, compared with {session.catalogue.recorded}")
    table.add_column("group")
    for outcome in Outcome:
        table.add_column(outcome.value, justify="right", style=_STYLES[outcome])
    for group, counts in groups.items():
        table.add_row(group, *[str(counts[outcome] or "") for outcome in Outcome])
    totals = [sum(counts[outcome] for counts in groups.values()) for outcome in Outcome]
    table.add_section()
    table.add_row("all", *[str(total) for total in totals])
    console.print(table)
    if session.problem:
        console.print(printable(session.problem), style="bold red")


def print_entries(console: Console, catalogue: Catalogue, plan: Plan) -> None:
    """What would be performed, with its source."""
    table = Table(title=f"{catalogue.family}: {catalogue.recorded}")
    for column in ("entry", "state", "source", "performed"):
        table.add_column(column, overflow="fold")
    for entry, hindrance in select(catalogue, plan):
        table.add_row(entry.id, entry.state.value, entry.source, hindrance or "yes")
    console.print(table)
