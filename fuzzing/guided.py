"""``python -m fuzzing.guided TARGET [--runs N]``: the same targets under atheris, which is guided by coverage."""

from __future__ import annotations

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path

__all__ = ["main"]


def main() -> int:
    """Fuzz one target; the exit code: atheris' own, or 2 for bad arguments."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing.guided", description=__doc__)
    parser.add_argument("target", metavar="TARGET")
    parser.add_argument("--runs", type=int, default=100_000, metavar="N", help="inputs (100000)")
    options = parser.parse_args()
    if find_spec("atheris") is None:
        sys.stderr.write("fuzzing.guided needs atheris: pip install atheris\n")
        return 2
    import atheris  # noqa: PLC0415 - large, and an extra

    import onboard.agent  # noqa: PLC0415 - with its kernels: numba cannot compile instrumented code
    import onboard.planning.warmup  # noqa: F401, PLC0415

    with atheris.instrument_imports(include=["onboard"]):
        from fuzzing.seeds import seeds_of  # noqa: PLC0415 - instrumented while it is imported
        from fuzzing.targets import TARGETS  # noqa: PLC0415
    if options.target not in TARGETS:
        parser.error(f"no target {options.target}; there are {', '.join(TARGETS)}")
    corpus = Path(f"fuzz-corpus-{options.target}")
    corpus.mkdir(exist_ok=True)
    for number, seed in enumerate(seeds_of(options.target)):
        (corpus / f"seed{number:03}").write_bytes(seed)
    atheris.Setup([sys.argv[0], f"-runs={options.runs}", "-timeout=5", str(corpus)], TARGETS[options.target]())
    atheris.Fuzz()
    return 0


if __name__ == "__main__":
    sys.exit(main())
