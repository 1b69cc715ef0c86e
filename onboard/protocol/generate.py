"""Generate ``dialect.py`` from ``arvi.xml`` with pymavlink's generator, or check that the two agree.

Run ``python -m onboard.protocol.generate [--check]`` (``make generate``, ``make check``).
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import io
import shutil
import sys
import tempfile
from pathlib import Path

import pymavlink
from pymavlink.generator import mavgen

__all__ = ["GENERATOR_VERSION", "generate", "main"]

GENERATOR_VERSION = "2.4.50"
"""The pymavlink release that generated the module in the repository; another one may write other text."""

_HERE = Path(__file__).parent
_XML = _HERE / "arvi.xml"
_MODULE = _HERE / "dialect.py"


def generate() -> str:
    """The text of the dialect's Python module.

    Raises:
        RuntimeError: The generator is not the pinned release, or refuses the XML; the text says why.
    """
    installed = importlib.metadata.version("pymavlink")
    if installed != GENERATOR_VERSION:
        raise RuntimeError(f"the dialect is generated with pymavlink {GENERATOR_VERSION}, {installed} is installed")
    packaged = Path(pymavlink.__file__).parent / "dialects" / "v20"
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        for name in ("common.xml", "standard.xml", "minimal.xml"):
            shutil.copy(packaged / name, work / name)
        shutil.copy(_XML, work / "arvi.xml")
        log = io.StringIO()
        options = mavgen.Opts(str(work / "dialect"), wire_protocol="2.0", language="Python3", validate=True)
        with contextlib.redirect_stdout(log), contextlib.redirect_stderr(log):
            done = mavgen.mavgen(options, [str(work / "arvi.xml")])
        if not done:
            raise RuntimeError(f"pymavlink's generator refuses {_XML.name}:\n{log.getvalue()}")
        return (work / "dialect.py").read_text(encoding="utf-8")


def main(arguments: list[str]) -> int:
    """Write the module, or with ``--check`` say whether it is up to date; the exit code."""
    text = generate()
    if "--check" not in arguments:
        _MODULE.write_text(text, encoding="utf-8")
        return 0
    if not _MODULE.exists() or _MODULE.read_text(encoding="utf-8") != text:
        sys.stderr.write(f"{_MODULE} does not agree with {_XML.name}; run: make generate\n")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
