"""The numbers of a fleet, in memory that its processes share.

The memory is a file without a name: it is removed from its folder before anything else happens, and only the
processes hold it. However they end, nothing is left.
"""

from __future__ import annotations

import mmap
import os
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MEMORY = Path("/dev/shm")  # a file system in memory, on Linux
ROW = 4  # numbers of a position, as `Fdm.run` has them
_HEAD = 4  # whole numbers before the arrays
_PERIODS, _TELLING = 0, 1


class NoRoomError(RuntimeError):
    """There is no room for the memory that worker processes share."""


def folder() -> str:
    """Where shared memory is a file."""
    return str(_MEMORY if _MEMORY.is_dir() else tempfile.gettempdir())


class Shared:
    """Arrays over shared memory: what the fleet is told, and where each vehicle has got to.

    command, wind  (N, 3)  as in `Plant.step`
    moves          (N, 4)  as `Group.moves`
    faults         (N,)    as indices of `group.FAULTS`
    readings       (N, C)  C the most channels that a vehicle has
    rows           (n, N, 4)  as `Fdm.run` gives them, period by period: room for more of them moves none
    """

    def __init__(self, file: int, vehicles: int, channels: int) -> None:
        self.file, self._vehicles = file, vehicles
        widths = (3, 3, 4, 1, channels)
        starts = np.cumsum([8 * _HEAD, *(8 * vehicles * width for width in widths)]).tolist()
        self._fixed = -(-starts[-1] // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        self._periods = 0
        self._reserve(self._fixed)
        memory = mmap.mmap(file, self._fixed)
        self._head = np.frombuffer(memory, dtype=np.int64, count=_HEAD)
        parts = [
            np.frombuffer(memory, dtype=float, count=vehicles * width, offset=start).reshape(vehicles, width)
            for start, width in zip(starts, widths, strict=False)
        ]
        self.command, self.wind, self.moves, faults, self.readings = parts
        self.faults = faults[:, 0]
        self.rows: Array = np.zeros((0, vehicles, ROW))

    @classmethod
    def new(cls, vehicles: int, channels: int, periods: int) -> Shared:
        """Shared memory of this process, to be handed on by its `file`. Raises NoRoomError."""
        try:
            file, name = tempfile.mkstemp(prefix="fleet-", dir=folder())
        except OSError as error:
            raise NoRoomError(f"worker processes share memory in {folder()}: {error.strerror}") from None
        try:
            os.unlink(name)
            made = cls(file, vehicles, channels)
            made.grow(periods)
        except BaseException:
            os.close(file)
            raise
        return made

    def grow(self, periods: int) -> None:
        """Make room for `periods` rows of each vehicle. Raises NoRoomError."""
        if periods <= self._periods:
            return
        size = 8 * self._vehicles * periods * ROW
        self._reserve(self._fixed + size)
        memory = mmap.mmap(self.file, size, offset=self._fixed)
        self.rows = np.frombuffer(memory, dtype=float).reshape(periods, self._vehicles, ROW)
        self._periods = periods

    def tell(self, command: Array, wind: Array, periods: int, telling: bool) -> None:
        """Write what is to be flown. Raises NoRoomError."""
        self.grow(periods)
        self.command[:], self.wind[:] = command, wind
        self._head[_PERIODS], self._head[_TELLING] = periods, telling

    def told(self) -> tuple[int, bool]:
        """How many periods are to be flown, and whether readings are wanted."""
        self.grow(int(self._head[_PERIODS]))
        return int(self._head[_PERIODS]), bool(self._head[_TELLING])

    def _reserve(self, size: int) -> None:
        # Only truncated to this size, the file would find the file system full at the first write into it,
        # and the process would be killed (SIGBUS). The blocks are there where another process reserved them.
        if os.fstat(self.file).st_size >= size:
            return
        try:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(self.file, 0, size)
            else:
                os.ftruncate(self.file, size)
        except OSError as error:
            raise NoRoomError(
                f"worker processes need {size / 1e6:.1f} MB of shared memory in {folder()}: {error.strerror};"
                " make room there, or fly without workers"
            ) from None
