"""How all figures look, and how they are written: PNG for screens, SVG for papers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

__all__ = ["STYLE", "save"]

STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.titlesize": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "none",
    "svg.hashsalt": "arvi",
    "figure.constrained_layout.use": True,
}


def save(figure: Figure, path: Path) -> list[Path]:
    """Write a figure as PNG and SVG; the files."""
    files = [path.with_suffix(".png"), path.with_suffix(".svg")]
    with mpl.rc_context(STYLE):  # what makes an SVG the same every time counts when it is written
        figure.savefig(files[0], dpi=160, metadata={"Software": None})
        figure.savefig(files[1], metadata={"Date": None, "Creator": None})
    return files
