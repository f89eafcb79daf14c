"""Describes what the search may change: starts, headings, heights, wind and delay, within bounds.

A departure is a vector in units of the bounds; 0 is the scenario as it stands, whatever wind, delay or
offsets of its own it has.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from math import atan2, cos, degrees, hypot, radians, sin
from typing import Any

import numpy as np

from filters.model import Array
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, settled


@dataclass(frozen=True)
class Start:
    """A kind of departure of starts: its names in `Bounds` and the scenario, its default bound."""

    kind: str
    offsets: str
    perturbation: str
    default: float


STARTS = (
    Start("lateral_m", "lateral_offsets_m", "lateral_perturbation_m", 10.0),
    Start("heading_deg", "heading_offsets_deg", "heading_perturbation_deg", 5.0),
    Start("height_m", "height_offsets_m", "height_perturbation_m", 1.0),
)
# The widest bounds, those of the scenario's fields.
WIDEST = {"lateral_m": 1e4, "heading_deg": 180.0, "height_m": 1e4, "wind_mps": 100.0, "latency_s": 60.0}


@dataclass(frozen=True)
class Bounds:
    """The largest departure of each kind; 0 leaves the kind out. Those of starts hold for every vehicle."""

    lateral_m: float
    heading_deg: float
    height_m: float
    wind_mps: float
    latency_s: float


def bounds(
    s: Scenario,
    lateral_m: float | None,
    heading_deg: float | None,
    height_m: float | None,
    wind_mps: float,
    latency_s: float,
) -> Bounds:
    """Bounds as given; of starts, None is the scenario's own perturbation, or else the default.

    Raises UserError for one that is negative or beyond what a scenario can say, or if all are 0.
    """
    given = {"lateral_m": lateral_m, "heading_deg": heading_deg, "height_m": height_m}
    drawn = any(getattr(s.start, k.perturbation) for k in STARTS)
    chosen = {"wind_mps": wind_mps, "latency_s": latency_s}
    for k in STARTS:
        usual = getattr(s.start, k.perturbation) if drawn else k.default
        value = given[k.kind]
        chosen[k.kind] = usual if value is None else value
    for kind, value in chosen.items():
        if not 0.0 <= value <= WIDEST[kind]:
            raise UserError(
                f"--{kind.rpartition('_')[0]} {value:g}: give 0 to {WIDEST[kind]:g} {_unit(kind)}"
            )
    if not any(chosen.values()):
        raise UserError(
            "every bound is 0: there is nothing to search; leave one out for its default, such as --heading,"
            f" or fly the scenario as it stands: testbed run {s.name}"
        )
    return Bounds(**chosen)


@dataclass(frozen=True)
class Atom:
    """One thing that departs: a vehicle's offset of one kind, the wind, or the delay.

    kind         "lateral_m", "heading_deg", "height_m", "wind_mps" or "latency_s"
    vehicle      from 1; 0 for wind and delay
    coordinates  of the vector that are its own
    """

    kind: str
    vehicle: int
    coordinates: tuple[int, ...]


@dataclass(frozen=True)
class Space:
    """The departures of a scenario within bounds; `scenario` is what they depart from."""

    scenario: Scenario
    bounds: Bounds

    @classmethod
    def of(cls, s: Scenario, bounds: Bounds) -> Space:
        """Around `s` without its random perturbations: those are what is searched, not drawn."""
        still = s.start.model_copy(update=dict.fromkeys((k.perturbation for k in STARTS), 0.0))
        return cls(s.model_copy(update={"start": still}), bounds)

    @cached_property
    def atoms(self) -> list[Atom]:
        """All that may depart, the vehicles' offsets first."""
        atoms: list[Atom] = []
        size = 0
        for k in STARTS:
            if getattr(self.bounds, k.kind):
                for vehicle in range(1, self.scenario.vehicles + 1):
                    atoms.append(Atom(k.kind, vehicle, (size,)))
                    size += 1
        if self.bounds.wind_mps:
            atoms.append(Atom("wind_mps", 0, (size, size + 1)))
            size += 2
        if self.bounds.latency_s:
            atoms.append(Atom("latency_s", 0, (size,)))
        return atoms

    @cached_property
    def lower(self) -> Array:
        """Lowest values (n,) of a vector; a delay has one sign."""
        low = np.full(self.size, -1.0)
        for atom in self.atoms:
            if atom.kind == "latency_s":
                low[list(atom.coordinates)] = 0.0
        return low

    @property
    def size(self) -> int:
        return sum(len(a.coordinates) for a in self.atoms)

    def coordinates(self, kinds: Sequence[str], vehicles: Sequence[int] | None = None) -> np.ndarray:
        """Places in the vector of these kinds, of these vehicles (from 1) or of all."""
        chosen = [
            a
            for a in self.atoms
            if a.kind in kinds and (vehicles is None or not a.vehicle or a.vehicle in vehicles)
        ]
        return np.array([c for a in chosen for c in a.coordinates], dtype=int)

    def values(self, x: Array) -> list[dict[str, Any]]:
        """The departures of `x` that are not zero, in their units, one row each."""
        rows = []
        for atom in self.atoms:
            own = x[list(atom.coordinates)]
            if not own.any():
                continue
            row: dict[str, Any] = {"kind": atom.kind.rpartition("_")[0], "unit": _unit(atom.kind)}
            if atom.kind == "wind_mps":
                east, north = self._wind(own)
                row |= {"value": _tidy(hypot(east, north)), "towards_deg": _tidy(degrees(atan2(north, east)))}
            else:
                row |= {"value": _tidy(own[0] * getattr(self.bounds, atom.kind))}
            rows.append(row | ({"vehicle": atom.vehicle} if atom.vehicle else {}))
        return rows

    def at(self, x: Array) -> Scenario:
        """The scenario with departure `x` (size,), which is clipped to the bounds. Zeros change nothing."""
        x = np.clip(x, self.lower, 1.0)
        s = self.scenario
        data = s.model_dump(mode="json")
        for k in STARTS:
            own = x[self.coordinates([k.kind])]
            if own.any():
                base = getattr(s.start, k.offsets) or [0.0] * s.vehicles
                bound = getattr(self.bounds, k.kind)
                data["start"][k.offsets] = [_tidy(b + c * bound) for b, c in zip(base, own, strict=True)]
        wind = x[self.coordinates(["wind_mps"])]
        if wind.any():
            east, north = self._wind(wind)
            east += s.wind.speed_mps * cos(radians(s.wind.towards_deg))
            north += s.wind.speed_mps * sin(radians(s.wind.towards_deg))
            data["wind"] |= {
                "speed_mps": _tidy(hypot(east, north)),
                "towards_deg": _tidy(degrees(atan2(north, east))),
            }
        latency = x[self.coordinates(["latency_s"])]
        if latency.any():
            whole = s.network.latency_s + latency[0] * self.bounds.latency_s
            data["network"]["latency_s"] = _tidy(whole)
        return settled(data)[0]

    def rounded(self, x: Array, digits: int) -> Array:
        """`x` with its departures, in their units, rounded to so many significant digits."""
        units = np.concatenate(
            [np.full(len(a.coordinates), getattr(self.bounds, a.kind)) for a in self.atoms]
        )
        return np.array([_tidy(v, digits) for v in x * units]) / units

    def _wind(self, own: Array) -> tuple[float, float]:
        """East and north [m/s]: the square of the coordinates mapped into the disc of the bound."""
        east, north = (float(c) * self.bounds.wind_mps / max(1.0, float(np.hypot(*own))) for c in own)
        return east, north


def _tidy(value: float, digits: int = 12) -> float:
    """Rounded, without the round-off of a product."""
    return float(f"{value:.{digits}g}")


def _unit(kind: str) -> str:
    return {"mps": "m/s"}.get(unit := kind.rpartition("_")[2], unit)
