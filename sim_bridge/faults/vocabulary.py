"""``python -m sim_bridge.faults.vocabulary`` prints the table of ``docs/faults.md``, from what checks scenarios."""

from __future__ import annotations

from onboard.config.faults import VOCABULARY, Component, Place
from sim_bridge.faults.live import UNITS

__all__ = ["table"]

_WHERE = {
    Place.BRIDGE: "everywhere",
    Place.LAUNCHER: "`arvi fly`, virtual",
    Place.ONBOARD: "processes, virtual",
    Place.VIRTUAL: "virtual",
}


def table() -> str:
    """Markdown: one row for each fault."""
    rows = ["| component | type | what happens | parameters (default) | where |", "| --- | --- | --- | --- | --- |"]
    for (component, kind), effect in VOCABULARY.items():
        parameters = "; ".join(
            f"`{name}` ({parameter.default:g}): {parameter.meaning}" for name, parameter in effect.parameters.items()
        )
        rows.append(f"| {component} | {kind} | {effect.meaning} | {parameters} | {_where(component, effect.place)} |")
    return "\n".join(rows)


def _where(component: Component, place: Place) -> str:
    unit = next((number for number, live in UNITS.items() if live is component), None)
    return _WHERE[place] if unit is None else f"{_WHERE[place]}, live (unit {unit})"


if __name__ == "__main__":
    print(table())
