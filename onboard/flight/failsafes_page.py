"""Write the failsafe ladder's table into ``docs/failsafes.md``, or check that it is up to date.

Run ``python -m onboard.flight.failsafes_page [--check]`` (``make generate``, ``make check``).
"""

from __future__ import annotations

import sys
from pathlib import Path

from onboard.flight.failsafes import RULES, Action, Condition, Rule, Stage

__all__ = ["PAGE", "main", "page", "table"]

PAGE = Path(__file__).parents[2] / "docs" / "failsafes.md"
BEGIN = "<!-- generated from onboard/flight/failsafes.py: begin -->"
END = "<!-- generated from onboard/flight/failsafes.py: end -->"

_DOES = {
    Action.TELL: "flies on",
    Action.KEEP_OFF: "bends the setpoint",
    Action.WAIT: "hovers until the next plan",
    Action.HOLD: "hovers, plans nothing",
    Action.RETURN: "goes home and lands",
    Action.STOP: "brakes and hovers blind",
    Action.LAND: "lands here",
    Action.GIVE_UP: "stays on the ground",
    Action.LET_GO: "sends nothing more",
}


def table() -> str:
    """The ladder as Markdown, most drastic first."""
    lines = [
        "| condition | severity | what is watched | reaction | within, s | over after, s | told |",
        "| --- | --- | --- | --- | --- | ---: | --- |",
    ]
    lines += [_row(condition, rule) for condition, rule in RULES.items()]
    return "\n".join(lines)


def page(text: str) -> str:
    """The page with its table as it should be.

    Raises:
        ValueError: It has no marks.
    """
    head, begin, rest = text.partition(BEGIN)
    _, end, tail = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{PAGE}: the marks {BEGIN} and {END} are missing")
    return f"{head}{BEGIN}\n{table()}\n{END}{tail}"


def main(arguments: list[str]) -> int:
    """Write the page, or with ``--check`` say whether it is up to date; the exit code."""
    found = PAGE.read_text(encoding="utf-8")
    wanted = page(found)
    if "--check" in arguments and found != wanted:
        sys.stderr.write(f"{PAGE} does not agree with the code; run: make generate\n")
        return 1
    if found != wanted:
        PAGE.write_text(wanted, encoding="utf-8")
    return 0


def _row(condition: Condition, rule: Rule) -> str:
    reaction = ", then ".join(_DOES[stage.action] for stage in rule.stages)
    within = ", ".join(f"{within_s:.1f}" for within_s in rule.within_s)
    told = "; ".join(_told(stage) for stage in rule.stages) + (f"; at its end `{rule.over}`" if rule.over else "")
    return (
        f"| {condition.value} | {rule.severity.name.lower()} | {rule.watched} | {reaction} | {within} "
        f"| {rule.clears_s:.1f} | {told} |"
    )


def _told(stage: Stage) -> str:
    return f"`{stage.told.format('…')}`"


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
