"""Generate ``dialect.py`` and the tables of ``docs/protocol.md`` from ``arvi.xml``, or check that they agree.

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

from onboard.protocol.document import PAGE, document

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
    """Write module and page, or with ``--check`` say whether they are up to date; the exit code."""
    check = "--check" in arguments
    wanted = {_MODULE: generate()}
    if PAGE.exists():  # not where only the packages are installed
        wanted[PAGE] = document(PAGE.read_text(encoding="utf-8"))
    outdated = [path for path, text in wanted.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    for path in outdated:
        if check:
            sys.stderr.write(f"{path} does not agree with {_XML.name}; run: make generate\n")
        else:
            path.write_text(wanted[path], encoding="utf-8")
    return 1 if check and outdated else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
