"""What a requirement may speak of: columns of a run with their units, of its vehicles, pairs and fences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd

from filters.model import Array
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.records.run import (
    AIRCRAFT_COLUMNS,
    FENCE_COLUMNS,
    PAIR_COLUMNS,
    VEHICLE_COLUMNS,
    WIND_COLUMNS,
    Run,
)
from testbed.scenario import fleet, guidance_rules
from testbed.scenario.scenario import Scenario, parse

VEHICLE, PAIR, FENCE = "vehicle", "pair", "fence"
_KEYS = ("t_s", "vehicle", "i", "j", "fence")
_WORDS = ("qp_status",)
# Not of every row: nan where the filter, or the last instant, has none.
_FENCE = {
    "fence_h_m": ("h_m", FENCE_COLUMNS["h_m"]),
    "clearance_m": ("clearance_m", FENCE_COLUMNS["clearance_m"]),
}


@dataclass(frozen=True)
class Quantity:
    """A column.

    of       vehicle, pair or fence
    unit     "" for a number without one
    meaning  in words
    """

    of: str
    unit: str
    meaning: str


def _recorded() -> dict[str, Quantity]:
    vehicles = VEHICLE_COLUMNS | AIRCRAFT_COLUMNS | WIND_COLUMNS
    found = {n: Quantity(VEHICLE, *said) for n, said in vehicles.items() if n not in (*_KEYS, *_WORDS)}
    found |= {n: Quantity(PAIR, *said) for n, said in PAIR_COLUMNS.items() if n not in _KEYS}
    return found | {n: Quantity(FENCE, *said) for n, (_, said) in _FENCE.items()}


# Every column of vehicles and pairs, and what follows from them.
QUANTITIES: Mapping[str, Quantity] = _recorded() | {
    "t_s": Quantity(VEHICLE, "s", "time since the start"),
    "goal_distance_m": Quantity(VEHICLE, "m", "distance to the vehicle's goal"),
    "horizontal_m": Quantity(PAIR, "m", "horizontal distance"),
    "vertical_m": Quantity(PAIR, "m", "difference of heights, without sign"),
}


@dataclass(frozen=True)
class Subject:
    """Whom a signal is about: vehicles from 1, and a fence from 1 or 0."""

    vehicles: tuple[int, ...]
    fence: int = 0


class Measured:
    """The signals of a run. Vehicles are those under the filter; pairs those of which one is."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.scenario: Scenario = parse(run.manifest["scenario"], keep_idle=True)
        self.number = self.scenario.vehicles
        own = set(range(1, self.number + 1)) - {k + 1 for k in fleet.intruders(self.scenario)}
        self.vehicles = sorted(own)
        self.pairs = [
            (i, j) for i in range(1, self.number + 1) for j in range(i + 1, self.number + 1) if own & {i, j}
        ]

    @cached_property
    def t(self) -> Array:
        """(T,) s"""
        return np.asarray(self._of_vehicles("t_s")[:, 0], dtype=float)

    def subjects(self, kinds: set[str]) -> list[Subject]:
        """Whom a formula about these kinds of columns is about."""
        if FENCE in kinds:
            return [Subject((v,), f) for f, v in self._fenced if v in self.vehicles]
        if kinds == {PAIR, VEHICLE}:
            # The vehicle comes first.
            return [Subject((v, *(set(p) - {v}))) for p in self.pairs for v in p if v in self.vehicles]
        if kinds == {PAIR}:
            return [Subject(p) for p in self.pairs]
        return [Subject((v,)) for v in self.vehicles]

    def values(self, name: str, subjects: Sequence[Subject]) -> Array:
        """(T, E) of a column, one signal per subject."""
        of = QUANTITIES[name].of
        if of == VEHICLE:
            columns = self._vehicle(name)
            return columns[:, [s.vehicles[0] - 1 for s in subjects]]
        if of == FENCE:
            table = self._of_fences(_FENCE[name][0])
            return table[:, [self._fenced.index((s.fence, s.vehicles[0])) for s in subjects]]
        columns = self._pair(name)
        where = {p: k for k, p in enumerate(self._all_pairs)}
        return columns[:, [where[min(s.vehicles), max(s.vehicles)] for s in subjects]]

    @cached_property
    def _all_pairs(self) -> list[tuple[int, int]]:
        return [(i, j) for i in range(1, self.number + 1) for j in range(i + 1, self.number + 1)]

    @cached_property
    def _fenced(self) -> list[tuple[int, int]]:
        rows = self.run.fences
        first = rows[rows.t_s == rows.t_s.min()]
        return [(int(f), int(v)) for f, v in zip(first.fence, first.vehicle, strict=True)]

    @cached_property
    def goals(self) -> Array:
        """(N, 3) m, nan for a vehicle without a goal."""
        _, goal = places(self.scenario, generators(self.scenario.seed)["start"])
        return np.where(guidance_rules.seeking(self.scenario)[:, None], goal, np.nan)

    def _vehicle(self, name: str) -> Array:
        if name == "goal_distance_m":
            place = np.stack([self._of_vehicles(c) for c in ("x_m", "y_m", "z_m")], axis=-1)
            return np.asarray(np.linalg.norm(place - self.goals, axis=-1))
        return self._of_vehicles(name)

    def _pair(self, name: str) -> Array:
        if name not in ("horizontal_m", "vertical_m"):
            return self._table(self.run.pairs, name, len(self._all_pairs))
        i, j = np.array(self._all_pairs).T - 1
        x, y, z = (self._of_vehicles(c) for c in ("x_m", "y_m", "z_m"))
        if name == "vertical_m":
            return np.abs(z[:, i] - z[:, j])
        return np.hypot(x[:, i] - x[:, j], y[:, i] - y[:, j])

    def _of_vehicles(self, name: str) -> Array:
        return self._table(self.run.vehicles, name, self.number)

    def _of_fences(self, name: str) -> Array:
        return self._table(self.run.fences, name, len(self._fenced))

    def _table(self, frame: pd.DataFrame, name: str, count: int) -> Array:
        if name not in frame.columns:
            raise UserError(f"this run has no column {name}: {missing(name)}")
        return frame[name].to_numpy(dtype=float).reshape(-1, count)


def missing(name: str) -> str:
    """Why a run may lack a column."""
    if name in AIRCRAFT_COLUMNS:
        return "aircraft alone have it, so give --plant jsbsim"
    if name in WIND_COLUMNS:
        return "there is no wind in it"
    return "it was not recorded"
