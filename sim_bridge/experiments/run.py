"""All trials of an experiment on dask.distributed; a local cluster unless a scheduler is given."""

from __future__ import annotations

import contextlib
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import dask
from distributed import Client, LocalCluster, as_completed, get_worker

from onboard.planning.warmup import warm_kernels
from sim_bridge.errors import BridgeError
from sim_bridge.experiments.records import Failure, TrialKey, TrialResult, TrialTask
from sim_bridge.experiments.trial import run_trial

__all__ = ["Outcome", "connect", "run_trials"]

_TOPIC = "arvi-trial-progress"
_REPORT_PERIOD_S = 0.5
_CONNECT_TIMEOUT_S = 10


@dataclass(frozen=True)
class Outcome:
    """How a trial ended.

    Attributes:
        key: Arm and trial.
        result: What came out; None if it crashed.
        failure: Why it crashed, if it did.
    """

    key: TrialKey
    result: TrialResult | None
    failure: Failure | None = None


@contextlib.contextmanager
def connect(workers: int, scheduler: str | None = None) -> Iterator[Client]:
    """A client of a scheduler, or of a cluster of processes on this machine that ends with the context.

    Args:
        workers: Processes of the local cluster, one thread each.
        scheduler: Address such as ``tcp://host:8786``; its workers need this project installed.

    Raises:
        BridgeError: The scheduler cannot be reached.
    """
    # a trial that kills its worker does not get another one to kill
    with dask.config.set({"distributed.scheduler.allowed-failures": 0}):
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=_CONNECT_TIMEOUT_S)
            except (OSError, ValueError) as error:
                raise BridgeError(f"--scheduler {scheduler}: cannot be reached: {error}") from None
            with client:
                yield client
            return
        warm_kernels()  # once, before the workers would all compile
        cluster = LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            processes=True,
            dashboard_address="127.0.0.1:0",
            memory_limit=0,
            silence_logs=logging.CRITICAL,
        )
        with cluster, Client(cluster) as client:
            yield client


def run_trials(
    client: Client, tasks: Sequence[TrialTask], on_progress: Callable[[TrialKey, int], None]
) -> Iterator[Outcome]:
    """Run trials and yield each as it ends; one that crashes, or kills its worker, does not touch the others.

    Leaving the iteration early cancels what has not ended.

    Args:
        client: Where they run.
        tasks: Which.
        on_progress: Called with a trial and its number of steps done, now and then; from the client's own thread.
    """

    def report(event: Any) -> None:
        message = event[1] if isinstance(event, tuple) else event
        on_progress((int(message["arm"]), int(message["trial"])), int(message["steps"]))

    client.subscribe_topic(_TOPIC, report)
    waiting = list(reversed(tasks))
    futures: dict[Any, TrialTask] = {}
    ended = as_completed()

    def submit() -> None:
        """As many as there are threads: none waits on a worker, to die with it."""
        while waiting and len(futures) < max(1, sum(client.nthreads().values())):
            task = waiting.pop()
            future = client.submit(_run_on_worker, task, key=f"trial-{task.arm}-{task.trial}", pure=False)
            futures[future] = task
            ended.add(future)

    try:
        submit()
        for future in ended:
            task = futures.pop(future)
            submit()
            error = future.exception()
            if error is None:
                yield Outcome(task.key, future.result())
            else:
                yield Outcome(task.key, None, Failure.of(error))
            future.release()
    finally:
        client.cancel(list(futures), force=True)
        client.unsubscribe_topic(_TOPIC)


def _run_on_worker(task: TrialTask) -> TrialResult:
    worker = get_worker()
    said_s = 0.0

    def on_step(steps: int) -> None:
        nonlocal said_s
        now_s = time.monotonic()
        if now_s - said_s > _REPORT_PERIOD_S:
            said_s = now_s
            worker.log_event(_TOPIC, {"arm": task.arm, "trial": task.trial, "steps": steps})

    return run_trial(task, on_step)
