"""Starts a program that dies with its parent: ``python leash.py PARENT_PID PROGRAM ARGUMENT…`` (Linux).

The launcher may be killed in a way that leaves it no time to stop anybody (SIGKILL, out of memory). The kernel then
kills whoever asked for it with ``prctl(PR_SET_PDEATHSIG)``; the request survives ``exec``. It is made here, in a
program of its own between fork and exec, for two reasons: running Python in a forked copy of a process with threads
(``preexec_fn``) can deadlock, and a watchdog pipe would only help against children that still read it.

Where there is no ``prctl`` the program starts all the same, and the launcher's own clean-up is what ends it.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys

__all__ = ["leashed", "main"]

PR_SET_PDEATHSIG = 1


def leashed(program: list[str]) -> list[str]:
    """The program, given with its full path, on a leash held by this process."""
    return [sys.executable, "-I", "-S", __file__, str(os.getpid()), *program]


def main(arguments: list[str]) -> None:
    """Ask for the signal, check that the parent still lives, and become the program."""
    parent, program = int(arguments[0]), arguments[1:]
    if sys.platform == "linux":
        ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
        if os.getppid() != parent:  # it died before we asked: nobody would tell us
            sys.exit(1)
    os.execv(program[0], program)


if __name__ == "__main__":
    main(sys.argv[1:])
