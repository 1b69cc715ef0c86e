"""The folder of one run: logs and recordings, and beside them what was run."""

from __future__ import annotations

import json
import platform
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from gcs.errors import GroundError

__all__ = ["RunFolder", "describe_run", "run_folder", "software"]

_LIBRARIES = ("bokeh", "mcap", "numba", "numpy", "pymavlink", "pydantic")
_GIT_PATIENCE_S = 2.0


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


def describe_run(folder: Path, config: Path, about: dict[str, Any]) -> dict[str, str]:
    """Write ``scenario.yaml``, a copy of the configuration, and ``flight.json``, what a reader needs to run it again.

    Returns:
        The texts of both, by file name.

    Raises:
        GroundError: They cannot be written.
    """
    about = {**about, "started": time.strftime("%Y-%m-%dT%H:%M:%S%z"), "software": software()}
    try:
        files = {"scenario.yaml": config.read_bytes(), "flight.json": (json.dumps(about, indent=2) + "\n").encode()}
        for name, content in files.items():
            (folder / name).write_bytes(content)
    except OSError as error:
        raise GroundError(f"{folder}: cannot be recorded to: {error.strerror or error}") from None
    return {name: content.decode("utf-8", "replace") for name, content in files.items()}


def software() -> dict[str, str]:
    """Versions of what flies: Python, this project, its libraries; the git commit when it is run from a checkout."""
    versions = {"python": platform.python_version(), "system": platform.platform()}
    for name in ("arvi-flight-stack", *_LIBRARIES):
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    commit = _git_commit()
    return versions if commit is None else {**versions, "commit": commit}


def _git_commit() -> str | None:
    """The commit of the checkout that this file is part of, ``-dirty`` when something has been changed; else None."""
    git = shutil.which("git")
    if git is None:
        return None
    try:
        for arguments in (
            ("ls-files", "--error-unmatch", __file__),
            ("describe", "--always", "--dirty", "--abbrev=40"),
        ):
            answer = subprocess.run(
                [git, "-C", Path(__file__).parent, *arguments],
                capture_output=True, text=True, timeout=_GIT_PATIENCE_S, check=True,
            )  # fmt: skip
    except (OSError, subprocess.SubprocessError):
        return None
    return answer.stdout.strip()


def _new_folder(parent: Path, name: str) -> Path:
    parent.mkdir(parents=True, exist_ok=True)
    stem = f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"
    path, count = parent / stem, 1
    while path.exists():
        count += 1
        path = parent / f"{stem}-{count}"
    path.mkdir()
    return path
