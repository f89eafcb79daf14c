"""Finds steps of a command in a flight log: what lags can be identified on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.logs.record import GRID_S, FlightLog

# The least change that counts as a step: m/s, rad/s, m/s.
SMALLEST = (0.5, np.radians(2.0), 0.3)
_RISE_S = 0.3  # a step is complete within this
_BEFORE_S = 0.5  # and the command steady before for this
_SHORTEST_S, _LONGEST_S = 1.5, 8.0
_STEADY = 0.2  # of the step


@dataclass(frozen=True)
class Event:
    """A step of one channel's command.

    channel      0 v, 1 omega, 2 zeta
    begin, end   indices into the log's grid: the step begins at `begin`, and nothing else changes until `end`
    size         of the step, in the channel's unit
    """

    channel: int
    begin: int
    end: int
    size: float


def events(log: FlightLog) -> list[Event]:
    """The steps of all channels in order of time.

    A step holds for at least 1.5 s, and no other command steps meanwhile; those that do not are left out.
    """
    changes = sorted((at, k, size) for k in range(3) for at, size in _changes(log.command[:, k], SMALLEST[k]))
    before, longest = round(_BEFORE_S / GRID_S), round(_LONGEST_S / GRID_S)
    found = []
    for n, (at, channel, size) in enumerate(changes):
        later = changes[n + 1][0] if n + 1 < len(changes) else len(log.t)
        earlier = changes[n - 1][0] if n else -before
        end = min(later, at + longest, len(log.t))
        if at - earlier < before or at < before or end - at < round(_SHORTEST_S / GRID_S):
            continue
        if not log.known[at - before : end].all():
            continue
        held = log.command[at + round(_RISE_S / GRID_S) : end, channel]
        if held.size and np.ptp(held) <= _STEADY * abs(size):
            found.append(Event(channel, at, end, size))
    return found


def _changes(command: np.ndarray, smallest: float) -> list[tuple[int, float]]:
    """Where a command changes by `smallest` or more within `_RISE_S`: first index after it, and its size."""
    width = round(_RISE_S / GRID_S)
    if command.size <= width:
        return []
    change = command[width:] - command[:-width]
    large = np.abs(change) >= smallest
    found = []
    k = 0
    while k < large.size:
        if not large[k]:
            k += 1
            continue
        # The window slides over one step for as long as the change stays large; its last row sees the step
        # first, its first row last.
        end = k
        while end + 1 < large.size and large[end + 1]:
            end += 1
        found.append((k + width, float(command[min(end + width, command.size - 1)] - command[k])))
        k = end + 1
    return [(at, size) for at, size in found if abs(size) >= smallest]
