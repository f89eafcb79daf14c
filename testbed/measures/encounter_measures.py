"""Measures a run as safety cases measure an encounter: lost volumes, interventions, cost, arrivals.

Everything is computed from the run's record, so that any run can be measured that was recorded at every
filter step. Pairs are those with at least one vehicle under the filter; interventions, paths and arrivals are
of vehicles under the filter.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import radians
from types import MappingProxyType
from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.measures.cylinders import SMALL_NMAC, SMALL_WELL_CLEAR, Cylinder
from testbed.measures.lost_volumes import Paths, lost
from testbed.measures.progress import seeking
from testbed.records.run import Run
from testbed.scenario import fleet
from testbed.scenario.scenario import Scenario, parse

NMAC, WELL_CLEAR = "nmac", "well_clear"
DEFAULT_CYLINDERS: Mapping[str, Cylinder] = MappingProxyType({NMAC: SMALL_NMAC, WELL_CLEAR: SMALL_WELL_CLEAR})
# Of the range of a channel's limits: less is no intervention.
DEFAULT_THRESHOLD = 0.05


@dataclass(frozen=True)
class Settings:
    """What to measure.

    cylinders  name -> volume; names are those of the columns
    threshold  a filter intervenes where it alters a command by more than this share of a channel's range
    """

    cylinders: Mapping[str, Cylinder] = field(default_factory=lambda: DEFAULT_CYLINDERS)
    threshold: float = DEFAULT_THRESHOLD

    def data(self) -> dict[str, Any]:
        """As plain data, for files and hashes."""
        volumes = {name: [c.radius_m, c.half_height_m] for name, c in self.cylinders.items()}
        return {"cylinders": volumes, "threshold": self.threshold}

    @classmethod
    def of(cls, data: Mapping[str, Any]) -> Settings:
        """From what `data` gave."""
        return cls({n: Cylinder(*map(float, c)) for n, c in data["cylinders"].items()}, data["threshold"])


# Of one cylinder; each is preceded by its name and "_": name -> (unit, meaning).
CYLINDER_COLUMNS: dict[str, tuple[str, str]] = {
    "lost": ("", "whether any pair was inside"),
    "undecided": ("", "whether the bend of paths between samples, or an early end, may turn that round"),
    "pairs": ("", "how many pairs were inside"),
    "first_s": ("s", "when the first pair came in; none if none did"),
    "time_s": ("s", "how long a pair was inside in all, longest of all pairs"),
    "depth": ("", "deepest penetration of any pair: 0 at the edge, 1 at the same place"),
}
COLUMNS: dict[str, tuple[str, str]] = {
    "closest_m": ("m", "least distance of any pair, straight between samples"),
    "closest_horizontal_m": ("m", "horizontal part of it"),
    "closest_vertical_m": ("m", "vertical part of it"),
    "closest_s": ("s", "when that was"),
    "alert_s": ("s", "when the filter first altered a command at all; none if never"),
    "intervention_s": ("s", "when it first altered one beyond the threshold; none if never"),
    "lead_s": (
        "s",
        "closest_s less the first intervention on the closest pair; none if none before",
    ),
    "intervention_share": (
        "",
        "share of vehicles' time in which commands are altered beyond the threshold",
    ),
    "path_m": ("m", "flown until arrival or the end, mean of vehicles"),
    "flown_s": ("s", "time until arrival or the end, mean of vehicles"),
    "path_added_m": ("m", "of vehicles that arrived: path beyond the straight way, mean"),
    "time_added_s": ("s", "of vehicles that arrived: time beyond the way alone, mean"),
    "arrived": ("", "vehicles that came within the goal radius"),
    "with_goal": ("", "vehicles that have a goal"),
}


def columns(settings: Settings) -> dict[str, tuple[str, str]]:
    """Column -> (unit, meaning) of what `measured` returns."""
    volumes = {
        f"{name}_{column}": (unit, f"{name}, {c}: {said}")
        for name, c in settings.cylinders.items()
        for column, (unit, said) in CYLINDER_COLUMNS.items()
    }
    return volumes | COLUMNS


def measured(run: Run, settings: Settings | None = None) -> dict[str, Any]:
    """The measures of a run as plain data, keys as `columns` gives them; None where there is no value.

    Raises UserError if the run has no pair with a vehicle under the filter, or is recorded too coarsely
    """
    settings = settings or Settings()
    s = parse(run.manifest["scenario"], keep_idle=True)
    own = np.setdiff1d(np.arange(s.vehicles), fleet.intruders(s))
    i, j = np.triu_indices(s.vehicles, 1)
    pairs = np.isin(i, own) | np.isin(j, own)
    if not pairs.any():
        raise UserError(f"{run.path or s.name}: no pair has a vehicle under the filter; nothing to measure")
    paths = _paths(run, s, i[pairs], j[pairs])
    ended = run.manifest["ended_early"] is not None
    row: dict[str, Any] = {}
    for name, cylinder in settings.cylinders.items():
        found = lost(paths, cylinder)
        undecided = found.undecided or (ended and not found.lost)
        values = (found.lost, undecided, found.pairs, found.first_s, found.time_s, found.depth)
        row |= {f"{name}_{c}": v for c, v in zip(CYLINDER_COLUMNS, values, strict=True)}
    closest, pair = paths.closest()
    row |= closest
    first, share, alert = _interventions(run, s, own, settings.threshold)
    near = [first[k] for k in pair if np.isfinite(first[k])]
    lead = closest["closest_s"] - float(min(near)) if near else None
    row |= {
        "alert_s": alert,
        "intervention_s": _known(first.min(initial=np.inf)),
        "lead_s": lead if lead is not None and lead >= 0 else None,
        "intervention_share": share,
    }
    return row | _cost(run, s, own, paths)


def _paths(run: Run, s: Scenario, i: np.ndarray, j: np.ndarray) -> Paths:
    t = _table(run, "t_s", s.vehicles)[:, 0]
    place = np.stack([_table(run, c, s.vehicles) for c in ("x_m", "y_m", "z_m")])
    if len(t) < 3 and run.manifest["ended_early"] is None:
        raise UserError(
            f"{run.path or s.name} has {len(t)} recorded instants; record every filter step, with"
            f" --set record_dt_s={s.rates.filter_dt_s:g}"
        )
    left = _table(run, "left", s.vehicles).astype(bool) if "left" in run.vehicles.columns else None
    turning = None
    if s.plant == "unicycle" and "plant" not in run.manifest.get("parts", {}) and s.rates.record_steps == 1:
        # Unicycles fly arcs between filter steps, and straight up and down.
        speed, turn = (_table(run, c, s.vehicles) for c in ("v_command_mps", "omega_command_radps"))
        turning = np.abs(speed * turn)
    return Paths(t, place, i, j, left, turning)


def _table(run: Run, name: str, vehicles: int) -> Array:
    """(T, N) of a column of `vehicles`."""
    return np.asarray(run.vehicles[name].to_numpy(dtype=float).reshape(-1, vehicles))


def _interventions(
    run: Run, s: Scenario, own: np.ndarray, threshold: float
) -> tuple[Array, float, float | None]:
    """When the filter first intervened on each vehicle (N,) s, inf if never; share of time; first alert."""
    t = _table(run, "t_s", s.vehicles)[:, 0]
    boxes = fleet.limits(s)
    low = np.array([[b.v_min_mps, -radians(b.omega_max_degps), -b.zeta_max_mps] for b in boxes])
    high = np.array([[b.v_max_mps, radians(b.omega_max_degps), b.zeta_max_mps] for b in boxes])
    names = ("v{}_mps", "omega{}_radps", "zeta{}_mps")
    command, wanted = (
        np.stack([_table(run, name.format(kind), s.vehicles) for name in names], axis=-1)
        for kind in ("_command", "_nominal")
    )
    span = np.where(high > low, high - low, 1.0)
    altered = (np.abs(command - np.clip(wanted, low, high)) / span).max(axis=-1) > threshold
    flying = np.ones_like(altered)
    if "left" in run.vehicles.columns:
        flying = ~_table(run, "left", s.vehicles).astype(bool)
    altered = altered & flying
    first = np.full(s.vehicles, np.inf)
    some = altered.any(axis=0)
    first[some] = t[altered.argmax(axis=0)[some]]
    strangers = np.setdiff1d(np.arange(s.vehicles), own)
    first[strangers] = np.inf
    overridden = (_table(run, "override", s.vehicles).astype(bool) & flying)[:, own].any(axis=1)
    share = float(altered[:, own].sum() / max(1, flying[:, own].sum()))
    return first, share, float(t[overridden.argmax()]) if overridden.any() else None


def _cost(run: Run, s: Scenario, own: np.ndarray, paths: Paths) -> dict[str, Any]:
    """Paths, times and arrivals, of the vehicles `own`."""
    known = next((v.detail for v in run.guarantees if "path_added_m" in v.detail), {})
    added, late = (known.get(name, [None] * s.vehicles) for name in ("path_added_m", "time_added_s"))
    due = seeking(s)
    there = [k for k in range(s.vehicles) if due[k] and added[k] is not None]
    _, goal = places(s, generators(s.seed)["start"])
    until = paths.until(np.where(due[:, None], goal, np.nan), s.goal_radius_m)
    return {
        "path_m": float(paths.lengths(until)[own].mean()),
        "flown_s": float(until[own].mean() - paths.t[0]) if len(paths.t) else 0.0,
        "path_added_m": _mean([added[k] for k in there]),
        "time_added_s": _mean([late[k] for k in there]),
        "arrived": len(there),
        "with_goal": int(due.sum()),
    }


def _mean(values: list[float | None]) -> float | None:
    known = [v for v in values if v is not None]
    return sum(known) / len(known) if known else None


def _known(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
