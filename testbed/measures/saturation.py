"""Counts how long surfaces and throttle were at their stops, and how long the autopilot limited a command."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.datasheets.actuator_limits import actuator_limits
from filters.model import Array

# A servo approaches its stop as a lag does and may never touch it: within this share of the travel counts.
AT_STOP = 0.01
LIMITED = ("limited_v", "limited_omega", "limited_zeta")


class Saturation:
    """Counts over the recorded instants of a run.

    airframes  one per vehicle; none where no aircraft flies, and then nothing is counted
    """

    def __init__(self, airframes: Sequence[Airframe] = ()) -> None:
        # Aircraft of one airframe share the object: its files are read once.
        known = {id(a): actuator_limits(a) for a in {id(a): a for a in airframes}.values()}
        stops = [known[id(a)] for a in airframes]
        names = dict.fromkeys(name for of in stops for name in of)
        unknown = (np.nan, np.nan)
        self._stops = {name: np.array([of.get(name, unknown) for of in stops]).T for name in names}
        self._count = {name: np.zeros(len(airframes)) for name in (*names, *(LIMITED if names else ()))}
        self._instants = 0

    def update(self, telemetry: dict[str, Array]) -> None:
        """Take in one instant's channels, (N,) each, or those of several, (instants, N)."""
        if not self._count or not telemetry:
            return
        self._instants += len(np.atleast_2d(next(iter(telemetry.values()))))
        for name, (low, high) in self._stops.items():
            if name in telemetry:
                slack = AT_STOP * (high - low)
                x = telemetry[name]
                self._count[name] += np.atleast_2d((x <= low + slack) | (x >= high - slack)).sum(axis=0)
        for name in LIMITED:
            if name in telemetry:
                self._count[name] += np.atleast_2d(telemetry[name] > 0.5).sum(axis=0)

    def shares(self) -> dict[str, float]:
        """Channel -> share of the recorded instants at a stop (or limited), of the worst vehicle."""
        return {name: float(count.max() / max(1, self._instants)) for name, count in self._count.items()}
