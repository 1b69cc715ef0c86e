"""The folder of one run: logs and recordings, and beside them what was run."""

from __future__ import annotations

import json
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.errors import GroundError

__all__ = ["RunFolder", "describe_run", "run_folder"]


@dataclass(slots=True)
class RunFolder:
    """A folder that may turn out not to be wanted.

    Attributes:
        path: Where it is.
        keep: Whether it stays after the run.
    """

    path: Path
    keep: bool = True


@contextmanager
def run_folder(parent: Path | None, name: str) -> Iterator[RunFolder]:
    """A new folder ``PARENT/NAME-TIME`` for logs and recordings; a temporary one without parent.

    Raises:
        GroundError: It cannot be made.
    """
    try:
        path = Path(tempfile.mkdtemp(prefix=f"arvi-{name}-")) if parent is None else _new_folder(parent, name)
    except OSError as error:
        raise GroundError(f"{parent or 'temporary folder'}: cannot be made: {error.strerror or error}") from None
    folder = RunFolder(path)
    try:
        yield folder
    finally:
        if not folder.keep:
            shutil.rmtree(path, ignore_errors=True)


def describe_run(folder: Path, config: Path, about: dict[str, Any]) -> None:
    """Write ``scenario.yaml``, a copy of the configuration, and ``flight.json``, what a reader needs to run it again.

    Raises:
        GroundError: They cannot be written.
    """
    about = {**about, "started": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
    try:
        shutil.copyfile(config, folder / "scenario.yaml")
        (folder / "flight.json").write_text(json.dumps(about, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise GroundError(f"{folder}: cannot be recorded to: {error.strerror or error}") from None


def _new_folder(parent: Path, name: str) -> Path:
    parent.mkdir(parents=True, exist_ok=True)
    stem = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    path, count = parent / stem, 1
    while path.exists():
        count += 1
        path = parent / f"{stem}-{count}"
    path.mkdir()
    return path
