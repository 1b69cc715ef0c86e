"""``python -m sim_bridge.reliability``: fly the fault suite, print its table, write it into the documentation."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path

from onboard.config import load_scenario
from sim_bridge.reliability.cases import CASES
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.run import batches, fly
from sim_bridge.reliability.verdict import Outcome


def main() -> int:
    """Fly; the exit code is 0 if nothing failed but for known gaps."""
    arguments = _parse()
    chosen = [case for case in CASES if arguments.only in case.name]
    phases = [Phase(name) for name in arguments.phases.split(",")] if arguments.phases else list(Phase)
    todo = batches(range(1, arguments.seeds + 1), chosen, phases)
    count = sum(len(batch.cases) for batch in todo)
    print(f"{count} flights of {len(chosen)} faults in {len(phases)} phases", flush=True)
    began_s = time.monotonic()
    outcomes: list[Outcome] = []
    with Path(arguments.json or os.devnull).open("w", encoding="utf-8") as log:
        for outcome in fly(load_scenario(Path(arguments.scenario)), todo, arguments.workers):
            outcomes.append(outcome)
            _progress(outcome, len(outcomes), count, time.monotonic() - began_s)
            print(json.dumps(outcome.to_json()), file=log, flush=True)
    bad = [outcome for outcome in outcomes if outcome.failures and not outcome.gap]
    known = [outcome for outcome in outcomes if outcome.failures and outcome.gap]
    print(f"{len(outcomes)} flights: {len(bad)} against expectations, {len(known)} known gaps")
    return 1 if bad else 0


def _progress(outcome: Outcome, done: int, count: int, elapsed_s: float) -> None:
    mark = "ok" if not outcome.failures else "gap" if outcome.gap else "FAIL"
    left_s = elapsed_s / done * (count - done)
    took = "" if outcome.reaction_s is None else f" {outcome.reaction_s:.2f} s"
    print(
        f"[{done}/{count}, {left_s / 60:.0f} min left] {mark}: {outcome.case} / {outcome.phase} / seed {outcome.seed}"
        f"{took} {'; '.join(outcome.failures)}",
        flush=True,
    )


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m sim_bridge.reliability", description="Fly the fault suite.")
    parser.add_argument("scenario", nargs="?", default="configs/lab.yaml")
    parser.add_argument("--seeds", type=int, default=2, help="flights of each fault in each phase")
    parser.add_argument("--only", default="", help="faults whose name contains this")
    parser.add_argument("--phases", default="", help="comma-separated; all unless given")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", default="", help="file for the outcomes, one a line")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
