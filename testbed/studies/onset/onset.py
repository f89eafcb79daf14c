"""Measures when overriding begins: cubic and linear alpha, and the navigation function.

Squires et al. 2022, Section VI, remark that the navigation function evades earlier than the barrier with the
cubic alpha, and that a linear alpha with a small coefficient may override as early.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.engine import fly_all
from testbed.claims.nearest import nearest_approach
from testbed.scenario.scenario import Scenario, load

if TYPE_CHECKING:
    import pandas as pd

    from testbed.records.run import Run

# name -> overrides; alpha(h) in m/s. Only the first and the last are the paper's.
LAWS = {
    "cubic 0.1": ("alpha.kind=cubic", "alpha.coefficient=0.1"),
    "linear 1": ("alpha.kind=linear", "alpha.coefficient=1.0"),
    "linear 0.3": ("alpha.kind=linear", "alpha.coefficient=0.3"),
    "linear 0.1": ("alpha.kind=linear", "alpha.coefficient=0.1"),
    "navigation": ("filter.kind=navigation",),
}
VEHICLES = (2, 20)
# Smallest change of an input that counts [m/s, rad/s]; QPs are solved to 1e-9.
OVERRIDE = 1e-6
CHANNELS = (("v", "mps"), ("omega", "radps"), ("zeta", "mps"))
# Signs of an evasion in the motion, for any filter: a turn, and leaving the straight line.
TURN_DEGPS, LATERAL_M = 1.0, 1.0


@dataclass(frozen=True)
class Case:
    """One law on the paper's circle, evading by a turn; flown until all have crossed the middle."""

    law: str
    vehicles: int
    overrides: tuple[str, ...] = ()

    def scenario(self, *more: str) -> Scenario:
        first = (f"vehicles={self.vehicles}", "record_dt_s=0.005", "duration_s=12")
        return load("paper-20-turn", [*first, *LAWS[self.law], *self.overrides, *more])


def cases(overrides: tuple[str, ...] = ()) -> list[Case]:
    return [Case(law, n, overrides) for n in VEHICLES for law in LAWS]


@dataclass(frozen=True)
class Onset:
    """First times [s] of each vehicle, nan where it never did, and vehicle 1's turn rate for the figure."""

    case: Case
    override: np.ndarray
    turn: np.ndarray
    lateral: np.ndarray
    t_s: np.ndarray
    omega_degps: np.ndarray
    least_distance_m: float


def measure(case: Case) -> Onset:
    """Fly `case` and find when each vehicle is first overridden, first turns, first leaves its line."""
    from testbed.simulation.simulate import run

    s = case.scenario()
    done = run(s)
    v = done.vehicles
    shape = (-1, s.vehicles)
    t = v.t_s.to_numpy().reshape(shape)[:, 0]
    x, y, omega = (v[c].to_numpy().reshape(shape) for c in ("x_m", "y_m", "omega_command_radps"))
    change = np.abs(omega - _alone(case, done)) if s.filter.kind == "navigation" else _beyond_the_box(s, v)
    # Start and goal are antipodes, so the straight line runs through the origin.
    along = np.hypot(x[0], y[0])
    lateral = np.abs(x * y[0] - y * x[0]) / along
    return Onset(
        case,
        first_time(t, change > OVERRIDE),
        first_time(t, np.abs(np.degrees(omega)) > TURN_DEGPS),
        first_time(t, lateral > LATERAL_M),
        t,
        np.degrees(omega[:, 0]),
        float(nearest_approach(done)["value"]),
    )


def first_time(t: np.ndarray, happened: np.ndarray) -> np.ndarray:
    """The first time [s] each column is True; nan where none is."""
    return np.where(happened.any(axis=0), t[np.argmax(happened, axis=0)], np.nan)


def _beyond_the_box(s: Scenario, v: pd.DataFrame) -> np.ndarray:
    """Largest change (times, vehicles) of a command from the nominal one clipped to its limits.

    The near-identity controller is not clamped and asks for 40 m/s at first; the limits' change does not
    count.
    """
    from filters.model import Command
    from testbed.components import catalogue

    wanted, given = (
        np.stack([v[f"{c}_{kind}_{unit}"] for c, unit in CHANNELS], axis=-1).reshape(-1, s.vehicles, 3)
        for kind in ("nominal", "command")
    )
    clipped = catalogue.limits(s).clip(Command.of(wanted)).array()
    return np.asarray(np.abs(given - clipped).max(axis=-1))


def _alone(case: Case, done: Run) -> np.ndarray:
    """Turn rates [rad/s] (times, vehicles) of the navigation function at the same states, seeing nobody.

    Its commands differ from the near-identity controller's even for a vehicle alone, which flies 20 m/s for
    example.
    So its reaction to others is the difference from these turn rates.
    """
    from filters.model import Command, State, View
    from testbed.components import catalogue
    from testbed.components.initial_conditions import generators, places

    s = case.scenario("sensing_range_m=1e-9")
    _, goal = places(s, generators(s.seed)["start"])
    steer, limits = catalogue.filter_(s, catalogue.barrier(s), goal), catalogue.limits(s)
    still = Command.of(np.zeros((s.vehicles, 3)))
    v = done.vehicles
    fields = np.stack([v.x_m, v.y_m, v.theta_rad, v.z_m], axis=-1).reshape(-1, s.vehicles, 4)
    return np.array([steer(View(State.of(f), still), still, limits).command.omega for f in fields])


def study(overrides: tuple[str, ...] = (), workers: int | None = None) -> list[Onset]:
    """Every law for 2 and for 20 vehicles."""
    return fly_all(
        measure,
        cases(overrides),
        workers,
        lambda c, o: f"{c.law}, {c.vehicles} vehicles: first overridden at {least(o.override):.3f} s",
    )


def least(times: np.ndarray) -> float:
    return float(np.nanmin(times)) if not np.isnan(times).all() else float("nan")


def table(onsets: list[Onset]) -> pd.DataFrame:
    """One row per law and number of vehicles; times in s, empty where it never happened."""
    import pandas as pd

    rows: list[dict[str, Any]] = []
    for o in onsets:
        entry: dict[str, Any] = {"vehicles": o.case.vehicles, "law": o.case.law}
        for name, times in (("override", o.override), ("turn_1degps", o.turn), ("lateral_1m", o.lateral)):
            seen = times[~np.isnan(times)]
            entry[f"first_{name}_s"] = least(times)
            entry[f"median_{name}_s"] = float(np.median(seen)) if seen.size else float("nan")
        rows.append(entry | {"min_distance_m": o.least_distance_m})
    return pd.DataFrame(rows)
