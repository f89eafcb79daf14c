"""Flies the kink study: +-5 degrees of heading on the paper's turn barrier and on the smoothed one.

h = sqrt(A1 - |Z|) - Ds has a concave kink at Z = 0, met at equal headings; delta rounds it over about 3e-6
rad only. A sampled controller steps across it and loses h each time. The study flies the paper's 20-vehicle
circle from perturbed headings, where the paper expects no change, and a 50-vehicle circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.campaigns.engine import fly_rows
from testbed.campaigns.journal import Journal
from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import QP_FEASIBILITY, SAFE_SET
from testbed.scenario.scenario import Scenario, load

if TYPE_CHECKING:
    import pandas as pd

# As printed, and the repair we recommend: |Z| -> sqrt(|Z|^2 + eps^2), eps = 30 m^2, without delta.
BARRIERS = {
    "paper": ("barrier.delta_m2=0.01", "barrier.smoothing_m2=0"),
    "smoothed": ("barrier.delta_m2=0", "barrier.smoothing_m2=30"),
}
PERIODS_S = (0.005, 0.01, 0.02)
HEADING_DEG = 5.0
NEARLY_EXACT_DEG, CROWDED_SEEDS = 1e-6, 3


@dataclass(frozen=True)
class Case:
    """One run of the study: `vehicles` on the circle of 200 m, headings off by up to `heading_deg`."""

    barrier: str
    dt_s: float
    seed: int
    vehicles: int = 20
    filter: str = "limited"
    heading_deg: float = HEADING_DEG
    overrides: tuple[str, ...] = ()

    def scenario(self, *more: str) -> Scenario:
        settings = (
            f"vehicles={self.vehicles}",
            f"filter.kind={self.filter}",
            f"seed={self.seed}",
            f"heading_perturbation_deg={self.heading_deg}",
            f"fdm_dt_s={self.dt_s}",
            f"filter_dt_s={self.dt_s}",
            # Extremes are kept at every step; the tables are not what this study reads.
            "record_dt_s=1",
            "manoeuvre_instants=0",
        )
        return load("paper-20-turn", [*settings, *BARRIERS[self.barrier], *self.overrides, *more])


def perturbed(seeds: int, overrides: tuple[str, ...] = ()) -> list[Case]:
    """Twenty vehicles, limited communication: every barrier, period and seed from 1."""
    return [
        Case(barrier, dt, seed, overrides=overrides)
        for dt in reversed(PERIODS_S)
        for barrier in BARRIERS
        for seed in range(1, seeds + 1)
    ]


def crowded(seeds: int, overrides: tuple[str, ...] = ()) -> list[Case]:
    """Fifty vehicles, centralised: exactly on the circle, and off it by less than a compass resolves.

    From the exact circle, rounding alone decides which way the vehicles chatter.
    """
    exact = [Case(b, 0.005, 1, 50, "centralised", 0.0, overrides) for b in BARRIERS]
    return exact + [
        Case(b, 0.005, seed, 50, "centralised", NEARLY_EXACT_DEG, overrides)
        for b in BARRIERS
        for seed in range(1, min(seeds, CROWDED_SEEDS) + 1)
    ]


def row(case: Case) -> dict[str, Any]:
    """Fly `case`; its settings, and the smallest distance and h with their time and pair."""
    from testbed.simulation.simulate import run

    done = run(case.scenario())
    distance, h = nearest_approach(done), done.guarantee(SAFE_SET.id)
    i, j = distance["vehicles"]
    return {
        "barrier": case.barrier,
        "vehicles": case.vehicles,
        "heading_deg": case.heading_deg,
        "dt_s": case.dt_s,
        "seed": case.seed,
        "min_distance_m": distance["value"],
        "min_distance_at_s": distance["t_s"],
        "i": i,
        "j": j,
        "min_h_m": h["value"],
        "min_h_at_s": h["t_s"],
        "infeasible": done.guarantee(QP_FEASIBILITY.id)["value"],
        "worst_qp_residual": done.manifest["worst_qp_residual"],
    }


def study(cases: list[Case], book: Journal, workers: int | None = None) -> pd.DataFrame:
    """One row per case, in their order; what `book` has is not flown again."""
    import pandas as pd

    from testbed.campaigns.identity import RunIds

    ids = RunIds(__name__)

    def key(case: Case) -> str:
        """The case, whose settings are in the row, and all that flies it."""
        return f"{case} {ids.of(case.scenario().model_dump_json(), case.seed)}"

    def said(case: Case, result: dict[str, Any]) -> str:
        return (
            f"{case.vehicles} vehicles, {case.barrier} barrier, dt {case.dt_s:g} s, seed {case.seed}:"
            f" least distance {result['min_distance_m']:.2f} m, h {result['min_h_m']:.2f} m"
        )

    return pd.DataFrame(fly_rows(row, cases, [key(c) for c in cases], book, workers, said))


def summary(table: pd.DataFrame, d_safe: float) -> pd.DataFrame:
    """One row per vehicles, perturbation, barrier and dt: runs that lost Ds or h, extremes over seeds."""
    groups = table.groupby(["vehicles", "heading_deg", "barrier", "dt_s"], sort=True)
    return groups.agg(
        runs=("seed", "size"),
        distinct=("min_distance_m", "nunique"),
        below_ds=("min_distance_m", lambda d: int((d < d_safe).sum())),
        below_h0=("min_h_m", lambda h: int((h < 0).sum())),
        least_m=("min_distance_m", "min"),
        median_m=("min_distance_m", "median"),
        least_h_m=("min_h_m", "min"),
        no_solution=("infeasible", "sum"),
        worst_qp_residual=("worst_qp_residual", "max"),
    ).reset_index()


def worst(table: pd.DataFrame, cases: list[Case], d_safe: float) -> Case:
    """The case to show step by step: under the paper's barrier, the closest at the finest dt that loses Ds.

    Where no run loses Ds, the closest of all.
    """
    rows = table[table.barrier == "paper"]
    lost = rows[rows.min_distance_m < d_safe]
    if len(lost):
        rows = lost[lost.dt_s == lost.dt_s.min()]
    return cases[int(rows.min_distance_m.idxmin())]


@dataclass(frozen=True)
class Look:
    """The pair that came closest in one run, step by step.

    i, j                    vehicles, counted from 1
    omega_degps             (2, n) turn rates commanded
    relative_deg            (n,) heading of i minus that of j
    h_m, promised_mps       (n,) the barrier, and its rate of change as the filter's rows have it, L_g h u
    distance_m              (n,)
    """

    case: Case
    i: int
    j: int
    t_s: np.ndarray
    omega_degps: np.ndarray
    relative_deg: np.ndarray
    h_m: np.ndarray
    promised_mps: np.ndarray
    distance_m: np.ndarray

    def lost_m(self) -> np.ndarray:
        """By how much h is below its predicted value since the start: sum of hdot dt - change of h."""
        promised = np.concatenate([[0.0], np.cumsum(self.promised_mps[:-1] * np.diff(self.t_s))])
        return np.asarray(promised - (self.h_m - self.h_m[0]))


def look(case: Case) -> Look:
    """Fly `case` again, every step recorded, and keep the pair that comes closest."""
    from testbed.simulation.simulate import run

    done = run(case.scenario(f"record_dt_s={case.dt_s}"))
    i, j = nearest_approach(done)["vehicles"]
    pairs = done.pairs[(done.pairs.i == i) & (done.pairs.j == j)]
    both = [done.vehicles[done.vehicles.vehicle == v] for v in (i, j)]
    heading = np.stack([v.theta_rad for v in both])
    return Look(
        case,
        i,
        j,
        pairs.t_s.to_numpy(),
        np.degrees(np.stack([v.omega_command_radps for v in both])),
        np.degrees(np.angle(np.exp(1j * (heading[0] - heading[1])))),
        pairs.h_m.to_numpy(),
        pairs.hdot_predicted_mps.to_numpy(),
        pairs.distance_m.to_numpy(),
    )


def over_heading(apart_m: float, relative_deg: np.ndarray) -> dict[str, np.ndarray]:
    """h [m] under each barrier of two vehicles abreast, over the right one's heading minus the left's."""
    from filters.model import State
    from testbed.components import catalogue

    values = {}
    for name in BARRIERS:
        barrier = catalogue.barrier(Case(name, 0.005, 1, vehicles=2).scenario())
        half, zero = 0.5 * np.radians(relative_deg), np.zeros(2)
        states = (State(zero, np.array([-apart_m / 2, apart_m / 2]), np.array([a, -a]), zero) for a in half)
        values[name] = np.array([barrier.values(s).h[0] for s in states])
    return values
