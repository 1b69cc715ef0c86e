"""Pages that need nothing but themselves: images inside, no request to anybody."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from gcs.errors import GroundError
from sim_bridge.figure_files import save

__all__ = ["EventRow", "Page", "Row", "Table", "write_page"]


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table.

    Attributes:
        cells: Texts.
        colour: Of the swatch before the first cell; empty for none.
    """

    cells: Sequence[str]
    colour: str = ""


@dataclass(frozen=True, slots=True)
class Table:
    """A table of a page."""

    title: str
    header: Sequence[str]
    rows: Sequence[Row]


@dataclass(frozen=True, slots=True)
class EventRow:
    """An event as it is printed; severity is ``error``, ``warning`` or ``info``."""

    time: str
    severity: str
    source: str
    text: str


@dataclass(frozen=True, slots=True)
class Page:
    """What a page says.

    Attributes:
        title: Of the browser's window.
        heading: On top.
        subtitle: Below it.
        problems: What went wrong, one sentence each.
        facts: Label and value of the most important figures.
        tables: In their order.
        figures: By name, in their order.
        beside: What lies in the figures' folder beside the page.
        captions: By the figures' names.
        events: In their order.
        texts: Longer ones to be unfolded, by name.
    """

    title: str
    heading: str
    subtitle: str
    problems: Sequence[str]
    facts: Sequence[tuple[str, str]]
    tables: Sequence[Table]
    figures: Mapping[str, Figure]
    beside: str
    captions: Mapping[str, str]
    events: Sequence[EventRow]
    texts: Sequence[tuple[str, str]]


def write_page(page: Page, path: Path) -> Path:
    """Write a page, and beside it a folder with its figures as PNG and SVG.

    Returns:
        The figures' folder.

    Raises:
        GroundError: Something cannot be written.
    """
    folder = path.with_name(f"{path.stem}-figures")
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    template = environment.from_string(files("gcs.reports").joinpath("report.html").read_text(encoding="utf-8"))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(exist_ok=True)
        figures = []
        for name, figure in page.figures.items():
            png, _ = save(figure, folder / name)
            source = "data:image/png;base64," + base64.b64encode(png.read_bytes()).decode("ascii")
            figures.append({"name": name, "source": source, "caption": page.captions[name]})
        html = template.render(
            title=page.title,
            heading=page.heading,
            subtitle=page.subtitle,
            problems=page.problems,
            facts=page.facts,
            tables=page.tables,
            figures=figures,
            beside=f"{folder.name}: {page.beside}",
            events=page.events,
            texts=page.texts,
        )
        path.write_text(html, encoding="utf-8")
    except OSError as error:
        raise GroundError(f"{error.filename or path}: cannot be written: {error.strerror or error}") from None
    return folder
