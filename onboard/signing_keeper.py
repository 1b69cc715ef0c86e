"""The signing of one process with its files: reads the key, and keeps the timestamps while the process runs."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from onboard.config.schema import SigningConfig
from onboard.protocol.signing import Signing
from onboard.protocol.signing_files import SAVE_PERIOD_S, SigningState, read_key

__all__ = ["SigningKeeper", "keeping"]

_log = logging.getLogger(__name__)


class SigningKeeper:
    """Made when a process starts; :meth:`run` is a task beside its loop, as :func:`keeping` has it.

    Args:
        config: Where key and timestamps are.
        process: Whose timestamps, e.g. ``vehicle-3``; names the file.

    Attributes:
        signing: For the cores of the process.

    Raises:
        SigningError: No key, or one that others can read; damaged timestamps.
    """

    def __init__(self, config: SigningConfig, process: str) -> None:
        self._state = SigningState(Path(config.state_folder) / f"{process}.json")
        self._failed = False
        self.signing: Signing = self._state.restore(read_key(Path(config.key_file)))

    async def run(self) -> None:
        """Keep the timestamps every second until cancelled; a disk that fails is said once and stops nothing."""
        loop = asyncio.get_running_loop()
        try:
            while True:
                await loop.run_in_executor(None, self._save)
                await asyncio.sleep(SAVE_PERIOD_S)
        finally:
            self._save()

    def _save(self) -> None:
        try:
            self._state.save(self.signing.past)
        except OSError as error:
            if not self._failed:
                _log.error("signing timestamps %s: %s; a restart will not remember them", self._state.path, error)
            self._failed = True


@asynccontextmanager
async def keeping(keeper: SigningKeeper | None) -> AsyncIterator[None]:
    """Keeps the timestamps while the block runs, and once more at its end; does nothing without signing."""
    task = None if keeper is None else asyncio.create_task(keeper.run())
    try:
        yield
    finally:
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)
