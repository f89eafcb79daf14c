"""Locks a path for one process: a lock file beside it, removed afterwards.

The lock dies with the process that holds it, on every system that filelock knows.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

from filelock import FileLock, Timeout


class PathLock:
    """Held by one process at a time; `release` may be called more than once."""

    def __init__(self, path: Path) -> None:
        self._file = path.with_name(f".{path.name}.lock")
        self._lock = FileLock(self._file, timeout=0)

    def acquire(self) -> bool:
        """Take the lock; False if another process has it. Raises OSError if no file can be made there."""
        try:
            self._lock.acquire()
        except Timeout:
            return False
        return True

    def release(self) -> None:
        if self._lock.is_locked:
            # While held, so that nobody locks a file that is then removed. Windows removes no open file;
            # the next holder uses it.
            with suppress(OSError):
                self._file.unlink()
            self._lock.release()
