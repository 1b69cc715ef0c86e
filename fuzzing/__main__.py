"""``python -m fuzzing [TARGET …] --runs N``: feed the targets; what one does not survive is kept in a file."""

from __future__ import annotations

import argparse
import hashlib
import sys
import time
from pathlib import Path

from fuzzing.engine import run
from fuzzing.seeds import seeds_of
from fuzzing.targets import TARGETS

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> int:
    """Fuzz; the exit code: 0 when all targets survived, 1 when one did not, 2 for bad arguments."""
    parser = argparse.ArgumentParser(
        prog="python -m fuzzing",
        description="Fuzz what reads strangers' bytes.",
        epilog="Targets: " + ", ".join(TARGETS),
    )
    parser.add_argument("targets", nargs="*", metavar="TARGET", help="all unless given")
    parser.add_argument("--runs", type=int, default=10_000, metavar="N", help="inputs of each target (10000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the mutations (1)")
    parser.add_argument("--replay", type=Path, metavar="FILE", help="only feed this one input")
    options = parser.parse_args(arguments)
    unknown = [name for name in options.targets if name not in TARGETS]
    if unknown:
        parser.error(f"no target {unknown[0]}; there are {', '.join(TARGETS)}")
    names = options.targets or list(TARGETS)
    if options.replay is not None:
        if len(names) != 1:
            parser.error("--replay needs the one TARGET that the input is of")
        TARGETS[names[0]]()(options.replay.read_bytes())
        return 0
    return max(_feed(name, options.runs, options.seed) for name in names)


def _feed(name: str, runs: int, seed: int) -> int:
    begun_s = time.perf_counter()
    tell = sys.stderr.isatty()

    def progress(done: int) -> None:
        if tell:
            sys.stderr.write(f"\r{name}: {done} of {runs}")

    finding = run(TARGETS[name](), seeds_of(name), runs, seed, progress=progress)
    took_s = time.perf_counter() - begun_s
    if finding is None:
        sys.stdout.write(f"{name}: survived {runs} inputs in {took_s:.1f} s\n")
        return 0
    path = Path(f"fuzz-{name}-{hashlib.sha256(finding.data).hexdigest()[:12]}")
    path.write_bytes(finding.data)
    sys.stdout.write(
        f"{finding.text}\n{name}: did not survive; the input is in {path}, again with: "
        f"python -m fuzzing {name} --replay {path}\n"
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
