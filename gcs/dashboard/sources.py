"""Data sources that are sent to the browser only when something has changed."""

from __future__ import annotations

from bokeh.models import ColumnDataSource

from gcs.dashboard.view import Columns

__all__ = ["update"]


def update(source: ColumnDataSource, columns: Columns) -> None:
    """Replace a source's columns unless they are the same; NaN counts as changed."""
    if columns and any(source.data.get(name) != values for name, values in columns.items()):
        source.data = dict(columns)
