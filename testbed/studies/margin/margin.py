"""Finds the smallest setting of a remedy that meets a violation rate, certified on fresh seeds.

Not every knob is monotone: a prediction of 0.3 to 0.6 s helps and 0.8 s hurts. So the knob is swept on common
seeds, the first range that meets the rate is bracketed, its lower edge bisected, and the edge certified on
seeds not used before. After a certificate that fails the next setting of the sweep that lost no run is tried,
up to the last one; the error is split over as many tries as there may be.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from math import ceil, log
from typing import TYPE_CHECKING, Any

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.components.components import Parts
from testbed.errors import UserError, nearest
from testbed.scenario.scenario import Scenario
from testbed.statistics import rate, zero_event_bound
from testbed.studies.common.measure import Fields, job_of, keys, measure, override, said

if TYPE_CHECKING:
    import pandas as pd

CONFIDENCE = 0.95
BISECTIONS = 4


@dataclass(frozen=True)
class Knob:
    """A remedy by one number, 0 or the first of `grid` being off.

    fields  setting -> fields of the scenario
    """

    unit: str
    grid: tuple[float, ...]
    fields: Callable[[float], Fields]


KNOBS = {
    "ds_buffer": Knob(
        "m", (0.0, 0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0), lambda x: {"remedy.ds_buffer_m": x}
    ),
    "prediction": Knob("s", tuple(k / 10 for k in range(10)), lambda x: {"remedy.prediction_s": x}),
    "robust": Knob(
        "x (1 m/s, 3 deg/s, 0.5 m/s)",
        (0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0, 1.5, 2.0),
        lambda x: {
            "remedy.robust_v_mps": x,
            "remedy.robust_omega_degps": 3 * x,
            "remedy.robust_zeta_mps": 0.5 * x,
        },
    ),
    "issf": Knob(
        "s/m (1/epsilon)",
        (0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 3.0),
        lambda x: {"remedy.issf_epsilon": 1 / x} if x else {},
    ),
    "derate": Knob(
        "share taken off gamma's turn rate",
        (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8),
        lambda x: {"remedy.derate": 1 - x},
    ),
}


@dataclass(frozen=True)
class Point:
    """One setting on some seeds; path, time and arrival are the worst vehicle's, the median over the runs.

    infeasible  vehicle-steps without a solution, over all runs
    distinct    different results among the runs
    rate_low    and rate_high: Clopper-Pearson, 95 %
    """

    setting: float
    violations: int
    runs: int
    rate_low: float
    rate_high: float
    least_distance_m: float
    infeasible: int
    path_added_m: float | None
    time_added_s: float | None
    goal_passed_s: float | None
    stage: str
    distinct: int


@dataclass
class Margin:
    """What was found.

    setting    the one certified, or else the last one tried; None if none on the grid met the rate
    bound      upper bound of the rate at `setting`, at `CONFIDENCE` over all tries; 1 if not certified
    """

    knob: str
    unit: str
    target_rate: float
    setting: float | None = None
    certified: bool = False
    bound: float = 1.0
    points: list[Point] = field(default_factory=list)

    def as_dict(self) -> dict[str, Any]:
        return asdict(self)


def find(
    s: Scenario,
    knob: str,
    target_rate: float,
    seeds: int = 20,
    workers: int | None = None,
    measured: Callable[[Job], dict[str, Any]] = measure,
    book: Journal | None = None,
    parts: Parts | None = None,
) -> Margin:
    """Sweep, bracket, bisect, certify.

    seeds     common seeds 1..seeds of the sweep; certificates use later ones
    measured  what flies a job (for tests)
    book      runs flown before an interruption
    parts     of the user's own, in every run
    Raises    UserError for a knob unknown or beyond the scenario's filter, a rate outside (0, 1), or a
              scenario with nothing random: a certificate needs runs that differ.
    """
    if knob not in KNOBS:
        raise UserError(f"--knob {knob}: unknown; {nearest(knob, KNOBS)}")
    if not 0.0 < target_rate < 1.0:
        raise UserError(f"--target-rate {target_rate:g}: give a rate between 0 and 1, such as 0.01")
    k = KNOBS[knob]
    fewest = ceil(log(1 - CONFIDENCE) / log(1 - target_rate))
    check_random(s, "a certificate", fewest, one_will_do=False)
    for setting in k.grid:  # refuse before anything is flown
        override(s, k.fields(setting))
    found, flown = Margin(knob, k.unit, target_rate), book or Journal()

    def fly(setting: float, chosen: range, stage: str) -> Point:
        data = override(s, k.fields(setting))
        jobs = [job_of(f"{knob} {setting:g}", data, seed, parts) for seed in chosen]
        rows = fly_rows(
            measured, jobs, keys(jobs), flown, workers, lambda job, row: f"{stage}: {said(job, row)}"
        )
        found.points.append(_point(setting, rows, stage))
        return found.points[-1]

    def feasible(point: Point) -> bool:
        return point.violations <= target_rate * point.runs

    common = range(1, seeds + 1)
    grid = {x: fly(x, common, "sweep") for x in k.grid}
    good = [x for x in k.grid if feasible(grid[x])]
    if not good:
        return found
    high = good[0]
    first = k.grid.index(high)
    if first:
        low = k.grid[first - 1]
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            if feasible(fly(middle, common, "bisect")):
                high = middle
            else:
                low = middle
    # The edge, then every setting above it that lost no run in the sweep. The list is fixed before a fresh
    # seed is flown, so splitting the error over it keeps the confidence.
    candidates = [high, *(x for x in k.grid if x > high and grid[x].violations == 0)]
    each = 1 - (1 - CONFIDENCE) / len(candidates)
    runs = ceil(log(1 - each) / log(1 - target_rate))
    for attempt, setting in enumerate(candidates):
        fresh = seeds + 1 + attempt * runs
        point = fly(setting, range(fresh, fresh + runs), f"certify {attempt + 1}")
        found.setting = setting
        if point.violations == 0:
            found.certified, found.bound = True, zero_event_bound(runs, each)
            break
    return found


def sentence(found: Margin) -> str:
    """What was found, in words: the setting certified, or how near the others came."""
    rate_, last = f"a rate of {found.target_rate:g}", f"{KNOBS[found.knob].grid[-1]:g}"
    if found.certified:
        return (
            f"{found.knob} {found.setting:g} {found.unit} meets {rate_}: none lost on"
            f" {found.points[-1].runs} fresh seeds, a rate below {found.bound:.4f} with 95 % confidence"
        )
    tried = [p for p in found.points if p.stage.startswith("certify")]
    if tried:
        lost = "; ".join(f"{p.violations} of {p.runs} lost at {p.setting:.4g}" for p in tried)
        return (
            f"no setting of {found.knob} up to {last} certified for {rate_}: {len(tried)} met it on"
            f" the sweep's seeds, but on fresh ones {lost}"
        )
    best = min(found.points, key=lambda p: (p.violations, -p.least_distance_m))
    return (
        f"no setting of {found.knob} up to {last} meets {rate_}: the best, {best.setting:g} {found.unit},"
        f" loses {best.violations} of {best.runs}{_unused(found)}"
    )


def _unused(found: Margin) -> str:
    """That the knob changed nothing, if it did not."""
    seen = {(p.violations, p.least_distance_m, p.distinct) for p in found.points}
    if len(seen) > 1:
        return ""
    return f"; every setting gave the same runs: the filter does not use {found.knob}, or nobody meets"


def _point(setting: float, rows: list[dict[str, Any]], stage: str) -> Point:
    lost = rate([row.get("distance_verdict") != "holds" for row in rows])
    distances = [row["distance_m"] for row in rows if row.get("distance_m") is not None]
    return Point(
        setting,
        lost.count,
        lost.runs,
        lost.low,
        lost.high,
        min(distances, default=float("nan")),
        sum(int(row.get("infeasible") or 0) for row in rows),
        _median([row.get("path_added_m") for row in rows]),
        _median([row.get("time_added_s") for row in rows]),
        _median([row.get("goal_passed_s") for row in rows]),
        stage,
        distinct_results(rows, without=("seed", "rung")),
    )


def _median(values: list[float | None]) -> float | None:
    import numpy as np

    known = [v for v in values if v is not None]
    return float(np.median(known)) if known else None


def markdown(curve: pd.DataFrame) -> str:
    """A curve as Markdown, as the guide shows it: the sweep and what was certified."""
    lines = [
        "| setting | stage | lost | 95 % Clopper-Pearson | least d [m] | no solution | path [m] | time [s] |",
        "|" + 8 * "---|",
    ]
    lines += [
        f"| {p.setting:g} | {p.stage} | {p.violations} of {p.runs}"
        f" | {100 * p.rate_low:.1f} to {100 * p.rate_high:.1f} % | {p.least_distance_m:.2f} | {p.infeasible}"
        f" | {p.path_added_m:.2f} | {p.time_added_s:.2f} |"
        for p in curve.sort_values("setting", kind="stable").itertuples()
        if p.stage != "bisect"
    ]
    return "\n".join(lines) + "\n"
