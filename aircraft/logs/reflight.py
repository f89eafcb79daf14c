"""Flies the commands of a flight log again with a simulated aircraft, in the log's wind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.logs.record import CHANNELS, GRID_S, UNITS, FlightLog, LogError
from filters.model import Array, Command, State

_PERIOD_S = 0.05
_SETTLING_S = 5.0  # the simulated aircraft starts in level trim, the real one did not
_LONGEST_S = 1800.0


@dataclass(frozen=True, eq=False)
class Reflight:
    """The simulated flight: t (n,) s as in the log, rates (n, 3) of (v, omega, zeta), why it ended early."""

    t: Array
    rates: Array
    fault: str


def longest_stretch(log: FlightLog) -> tuple[int, int]:
    """First index and end of the longest stretch in which command and response are known. Raises LogError."""
    known = np.concatenate([[False], log.known, [False]])
    begins, ends = np.flatnonzero(known[1:] & ~known[:-1]), np.flatnonzero(known[:-1] & ~known[1:])
    if not begins.size:
        raise LogError("at no instant are commands and responses both known")
    k = int(np.argmax(ends - begins))
    return int(begins[k]), int(ends[k])


def refly(log: FlightLog, airframe: Airframe) -> Reflight:
    """Fly the longest known stretch of the log, at most 30 minutes, from level trim at its first speed.

    Raises  LogError if the airframe has no steady flight there
    """
    begin, end = longest_stretch(log)
    end = min(end, begin + round(_LONGEST_S / GRID_S))
    every = round(_PERIOD_S / GRID_S)
    dt = _PERIOD_S / 10
    fleet = JsbsimFleet([airframe], dt)
    state = State.of([[0.0, 0.0, log.course[begin], 0.0]])
    air = np.zeros((1, 3))
    air[0, :2] = log.wind[begin]
    try:
        fleet.reset(state, np.random.default_rng(0), air, float(log.v[begin]))
    except RuntimeError as error:
        raise LogError(f"{airframe.name} cannot start as the log does: {error}") from None
    times, rates, fault = [], [], ""
    for k in range(begin, end, every):
        times.append(log.t[k])
        rates.append(fleet.achieved().array()[0])
        air[0, :2] = log.wind[k]
        fleet.step(Command.of(log.command[k : k + 1]), air, 10)
        fault = fleet.faults()[0]
        if fault:
            break
    fleet.close()
    return Reflight(np.array(times), np.array(rates), fault)


def errors(log: FlightLog, flown: Reflight) -> list[dict[str, object]]:
    """Per channel the simulated minus the logged value: mean, rms, and what 95 % of instants stay below.

    The first 5 s are left out: the simulated aircraft starts from level trim.
    """
    at = np.searchsorted(log.t, flown.t - 1e-9)
    late = flown.t - flown.t[0] >= _SETTLING_S
    rows: list[dict[str, object]] = []
    for k, (name, unit) in enumerate(zip(CHANNELS, UNITS, strict=True)):
        difference = (flown.rates[:, k] - log.response[at, k])[late]
        difference = difference[np.isfinite(difference)]
        known = difference.size > 0
        rows.append(
            {
                "channel": name,
                "unit": unit,
                "mean": float(difference.mean()) if known else None,
                "rms": float(np.sqrt(np.mean(difference**2))) if known else None,
                "p95": float(np.quantile(np.abs(difference), 0.95)) if known else None,
                "instants": int(difference.size),
            }
        )
    return rows
