"""Runs in a worker process: steps its share of a fleet over shared memory, ends when its parent has ended.

Never threads: JSBSim instances of one process may not be stepped at the same time.
"""

from __future__ import annotations

import os
import pickle
import select
from dataclasses import dataclass
from typing import Any

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.stepping.group import FAULTS, Group
from aircraft.jsbsim.stepping.shared import ROW, Shared
from aircraft.jsbsim.stepping.waiting import Inbox

STEP, READ = b"s", b"r"  # what a worker may be asked for
DONE, FAILED = b".", b"!"  # how it answers; what failed follows, pickled


@dataclass(frozen=True)
class Share:
    """The vehicles `first` to `last` (from 0, without `last`) of a fleet: what a worker needs to know.

    kinds      the airframes that fly
    airframes  per vehicle of the share, which of them it is
    """

    first: int
    last: int
    kinds: tuple[Airframe, ...]
    airframes: tuple[int, ...]
    starts: tuple[Start, ...]
    seeds: tuple[int | None, ...]
    dt: float
    origin: Origin
    turbulence: tuple[float, int] | None

    def group(self) -> Group:
        """Its aircraft, to be started."""
        return Group([self.kinds[k] for k in self.airframes], self.dt, self.origin, self.turbulence)


def main(memory: int) -> None:
    """The worker's loop; `memory` is the file of the shared memory. Asked on stdin, answers on stdout."""
    inbox, outbox = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What JSBSim prints must not disturb the pipes.
    os.dup2(2, 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    try:
        share, vehicles, channels = pickle.load(inbox)
    except EOFError:  # the parent has ended
        return

    def wanted() -> bool:
        """Whether the parent is still there: until it is answered it says nothing more."""
        return not select.select([inbox], [], [], 0)[0]

    try:
        group, shared = share.group(), Shared(memory, vehicles, channels)
        group.start(share.starts, share.seeds, wanted)
        mine = slice(share.first, share.last)
        if not wanted():
            return
        shared.grow(1)
        shared.rows[0, mine] = np.array(group.position()).reshape(-1, ROW)
        shared.moves[mine] = group.moves
    except Exception as error:
        _say(outbox, error)
        return
    _say(outbox, None)
    asking = Inbox(inbox)
    while asked := asking.read():
        try:
            if asked == READ:
                _tell(shared, mine, group, group.readings())
            else:
                _step(shared, mine, group)
        except Exception as error:
            _say(outbox, error)
            return
        _say(outbox, None)


def _step(shared: Shared, mine: slice, group: Group) -> None:
    n, telling = shared.told()
    flying = np.array([not fault for fault in group.faults])
    readings: list[float] | None = [] if telling else None
    rows = group.step(shared.command[mine].tolist(), shared.wind[mine].tolist(), n, readings)
    shared.rows[:n, mine][:, flying] = np.array(rows).reshape(-1, n, ROW).swapaxes(0, 1)
    shared.moves[mine] = group.moves
    shared.faults[mine] = [FAULTS.index(fault) for fault in group.faults]
    if readings is not None:
        _tell(shared, mine, group, readings)


def _tell(shared: Shared, mine: slice, group: Group, readings: list[float]) -> None:
    """Write every vehicle's readings: each has its own channels."""
    start = 0
    for row, vehicle in zip(shared.readings[mine], group.vehicles, strict=True):
        end = start + len(vehicle.channels.names)
        row[: end - start], start = readings[start:end], end


def _say(outbox: Any, error: Exception | None) -> None:
    if error is None:
        outbox.write(DONE)
    else:
        # As words: an exception's own arguments need not be what makes it again.
        outbox.write(FAILED + pickle.dumps((isinstance(error, FdmError), type(error).__name__, str(error))))
    outbox.flush()
