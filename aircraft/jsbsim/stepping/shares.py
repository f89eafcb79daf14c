"""The part of a fleet that other processes load, trim and step, beside the one that this process steps."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.stepping.group import FAULTS
from aircraft.jsbsim.stepping.shared import ROW, Shared
from aircraft.jsbsim.stepping.worker import Share
from aircraft.jsbsim.stepping.workers import Workers
from filters.model import Array

_PERIODS = 10  # FDM periods to a step that there is room for at first


class Shares:
    """The vehicles of a fleet from number `own` on (from 0), in about equal shares among `count` processes.

    airframes, starts, seeds  of the whole fleet, as in `Group`
    counts                    channels of each vehicle's telemetry
    Starting is begun here and ends with `wait`, which raises what a process has met.
    Raises  NoRoomError, WorkerError
    """

    def __init__(
        self,
        own: int,
        count: int,
        airframes: Sequence[Airframe],
        starts: Sequence[Start],
        seeds: Sequence[int | None],
        counts: Sequence[int],
        dt: float,
        origin: Origin,
        turbulence: tuple[float, int] | None,
    ) -> None:
        self._own, self._counts, n = own, counts, len(airframes)
        bounds = np.linspace(own, n, count + 1).round().astype(int).tolist()
        shares = []
        for first, last in pairwise(bounds):
            mine = airframes[first:last]
            kinds = list({id(airframe): airframe for airframe in mine}.values())
            which = {id(airframe): k for k, airframe in enumerate(kinds)}
            shares.append(
                Share(
                    first,
                    last,
                    tuple(kinds),
                    tuple(which[id(airframe)] for airframe in mine),
                    tuple(starts[first:last]),
                    tuple(seeds[first:last]),
                    dt,
                    origin,
                    turbulence,
                )
            )
        most = max(counts)
        self._shared = Shared.new(n, most, _PERIODS)
        self._workers = Workers([share for share in shares if share.starts], self._shared.file, n, most)

    @property
    def pids(self) -> list[int]:
        """Of the processes."""
        return self._workers.pids

    def step(self, asked: Sequence[Sequence[float]], winds: Array, n: int, telling: bool) -> None:
        """Have all fly n periods; they work on until `wait`.

        asked, winds  of the whole fleet, one triple a vehicle
        telling       whether their telemetry is to be read too
        Raises  NoRoomError, WorkerError
        """
        self._shared.tell(np.array(asked), winds, n, telling)
        self._workers.step()

    def wait(self) -> None:
        """Wait until all have started, or flown. Raises WorkerError or FdmError."""
        self._workers.wait()

    def beside(self, rows: Sequence[float] | Array, n: int, flying: Sequence[bool]) -> Array:
        """The rows of this process's vehicles, and after them those of the others that flew, n of each.

        flying  (N,) who flew
        """
        theirs = self._shared.rows[:n, self._own :].swapaxes(0, 1)[np.array(flying[self._own :], dtype=bool)]
        return np.concatenate([np.array(rows, dtype=float).reshape(-1, ROW), theirs.reshape(-1, ROW)])

    def moves(self) -> Array:
        """As `Group.moves`, (their vehicles, 4); a view."""
        return self._shared.moves[self._own :]

    def faults(self) -> list[str]:
        """As `Group.faults`."""
        return [FAULTS[int(k)] for k in self._shared.faults[self._own :].tolist()]

    def read(self) -> None:
        """Have the telemetry of all read now. Raises WorkerError."""
        self._workers.read()

    def readings_beside(self, readings: Sequence[float]) -> Array:
        """The readings of this process's vehicles, and after them those of the others."""
        theirs = self._shared.readings[self._own :]
        counts = self._counts[self._own :]
        given = np.arange(theirs.shape[1]) < np.array(counts)[:, None]
        return np.concatenate([np.array(readings), theirs[given]])

    def close(self) -> None:
        """End the processes; the shared memory goes with them."""
        self._workers.close()
