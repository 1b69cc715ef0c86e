"""``python -m sim_bridge.reliability``: fly the fault suite, print its table, write it into the documentation."""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path

from onboard.config import Scenario, load_scenario
from sim_bridge.reliability.bars import measure
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.report import judged_anew, markdown, write_into
from sim_bridge.reliability.run import Batch, batches, fly, moments, representative
from sim_bridge.reliability.suite import CASES
from sim_bridge.reliability.verdict import Outcome


def main() -> int:
    """Fly; the exit code is 0 if nothing failed but for known gaps."""
    arguments = _parse()
    lab = load_scenario(Path(arguments.scenario))
    outcomes = _read(arguments.read) if arguments.read else _fly(lab, _todo(arguments, lab), arguments)
    text = markdown(outcomes)
    if arguments.bars:
        text += "\n\n" + measure(lab, arguments.bars)
    print(f"\n{text}")
    if arguments.write:
        write_into(Path(arguments.write), text)
    return 1 if any(outcome.failures and not outcome.gap for outcome in outcomes) else 0


def _todo(arguments: argparse.Namespace, lab: Scenario) -> list[Batch]:
    if arguments.representative:
        return representative()
    chosen = [case for case in CASES if arguments.only in case.name]
    phases = [Phase(name) for name in arguments.phases.split(",")] if arguments.phases else list(Phase)
    seeds = range(arguments.first_seed, arguments.first_seed + arguments.seeds)
    return [*batches(seeds, chosen, phases), *moments(arguments.moments, [vehicle.id for vehicle in lab.vehicles])]


def _fly(lab: Scenario, todo: list[Batch], arguments: argparse.Namespace) -> list[Outcome]:
    count = sum(len(batch.cases) for batch in todo)
    print(f"{count} flights", flush=True)
    began_s = time.monotonic()
    outcomes: list[Outcome] = []
    with Path(arguments.json or os.devnull).open("w", encoding="utf-8") as log:
        for outcome in fly(lab, todo, arguments.workers):
            outcomes.append(outcome)
            _progress(outcome, len(outcomes), count, time.monotonic() - began_s)
            print(json.dumps(outcome.to_json()), file=log, flush=True)
    return outcomes


def _read(paths: Iterable[str]) -> list[Outcome]:
    lines = [line for path in paths for line in Path(path).read_text(encoding="utf-8").splitlines()]
    return [judged_anew(Outcome.from_json(json.loads(line))) for line in lines]


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
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--only", default="", help="faults whose name contains this")
    parser.add_argument("--phases", default="", help="comma-separated; all unless given")
    parser.add_argument("--moments", type=int, default=0, help="flights with a fault at a random moment, on top")
    parser.add_argument("--representative", action="store_true", help="only what the test suite flies")
    parser.add_argument("--bars", type=int, default=0, help="seeds with which a bad radio's cost is measured")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--json", default="", help="file for the outcomes, one a line")
    parser.add_argument("--read", nargs="+", help="outcomes that were flown before, instead of flying")
    parser.add_argument("--write", default="", help="document whose generated table is replaced")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
