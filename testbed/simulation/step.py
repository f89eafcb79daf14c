"""Step: where a session stands; and how the vehicles are flown from one filter step to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aircraft.plant import Plant
from filters.filter import Decision
from filters.model import Array, Command, State, View
from testbed.environment.atmosphere import Atmosphere

# Gusts change within a long filter period: the air is asked at least so often [s].
WIND_PERIOD_S = 0.05


@dataclass(frozen=True, eq=False)
class Step:
    """Where the vehicles are at time t, and what was flown over the filter period that led there.

    t         s
    state     (N,) the true poses
    rates     (N,) the true ground speeds, course rates and climb rates
    view      what the vehicles know; None where the run ended before they could know it
    air       (N, 3) m/s, the wind where they are; None in still air
    nominal   (N,) what guidance, or the caller, wanted over the period that led here; None at the start
    decision  what the filter made of it; None at the start
    done      whether the run is over: at its full duration, or by a fault
    fault     why it ended early, or None
    """

    t: float
    state: State
    rates: Command
    view: View | None
    air: Array | None
    nominal: Command | None
    decision: Decision | None
    done: bool
    fault: str | None


def advance(
    plant: Plant, atmosphere: Atmosphere, command: Command, t: float, air: Array | None, n: int
) -> Array:
    """Fly `command` (N,) for n periods from time t [s], where the wind is `air` (N, 3) m/s or None.

    Returns positions (n, N, 3) m.
    """
    still = np.zeros((len(command), 3))
    if air is None:
        return plant.step(command, still, n)
    most = max(1, int(WIND_PERIOD_S / plant.dt + 1e-9))
    track = [plant.step(command, air, min(most, n))]
    for k in range(most, n, most):
        now = atmosphere.wind(t + k * plant.dt, plant.state())
        track.append(plant.step(command, still if now is None else now, min(most, n - k)))
    return track[0] if len(track) == 1 else np.concatenate(track)


def given(wanted: Command, commands: Command, of: NDArray[np.bool_]) -> Command:
    """What guidance wants, but for the vehicles `of`, whose commands are given."""
    return Command.of(np.where(of[:, None], commands.array(), wanted.array()))


def unfiltered(wanted: Command) -> Decision:
    """The decision to fly what is wanted as it is."""
    zeros = np.zeros(len(wanted))
    return Decision(wanted, zeros.astype(int), zeros, zeros.astype(bool), zeros, None, np.zeros(0))
