"""Flies the central table: aircraft, numbers of vehicles, weather and remedies.

Every row is one setting flown from common seeded starts; the verdict is separation at the scenario's Ds.
"""

from __future__ import annotations

from collections.abc import Iterable
from statistics import median
from typing import TYPE_CHECKING, Any

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.scenario.scenario import Scenario, load
from testbed.scenario.variants import changed
from testbed.statistics import rate
from testbed.studies.common.measure import Fields, default_starts, keys, measure, override, said

if TYPE_CHECKING:
    import pandas as pd

# With the printed 1 m the nominal controller asks an aircraft for more heading bandwidth than it has.
COMMON = ("guidance.lookahead_m=10", "rates.filter_dt_s=0.05", "rates.record_dt_s=1")
FLEETS = {2: ("paper-2-turn", "duration_s=20"), 20: ("paper-20-turn", "duration_s=40")}
WEATHER: dict[str, Fields] = {
    "calm": {},
    "windy": {"wind.speed_mps": 5.0, "wind.towards_deg": 60.0, "gusts.intensity": "light"},
}
REMEDIES: dict[str, Fields] = {
    "none": {},
    "smoothed": {"remedy.smoothing_m2": 30.0},
    "lags, +0.5 m": {"remedy.predict_lags": True, "remedy.ds_buffer_m": 0.5},
    "lags, +4 m, smoothed": {
        "remedy.predict_lags": True,
        "remedy.ds_buffer_m": 4.0,
        "remedy.smoothing_m2": 30.0,
    },
    "lags, +1 m, smoothed, alpha 0.3 h": {
        "remedy.predict_lags": True,
        "remedy.ds_buffer_m": 1.0,
        "remedy.smoothing_m2": 30.0,
        "alpha.kind": "linear",
        "alpha.coefficient": 0.3,
    },
}


def d_safe_m() -> float:
    """Ds of every case: the paper's."""
    return load("paper-2-turn").d_safe_m


def cases(airframes: Iterable[str], vehicles: Iterable[int]) -> dict[tuple[str, int, str, str], Scenario]:
    """(vehicle, number, weather, remedy) -> scenario; the unicycle first, in calm air and without remedy."""
    made = {}
    for n in vehicles:
        name, *more = FLEETS[n]
        base = default_starts(load(name, [*COMMON, *more]))
        for remedy in ("none", "smoothed"):
            made["unicycle", n, "calm", remedy] = changed(base, {"plant": "unicycle"} | REMEDIES[remedy])
        for airframe in airframes:
            aircraft: Fields = {"plant": "jsbsim", "airframes": [airframe]}
            for weather, air in WEATHER.items():
                for remedy, fields in REMEDIES.items():
                    made[airframe, n, weather, remedy] = changed(base, aircraft | air | fields)
    return made


def answer(
    made: dict[tuple[str, int, str, str], Scenario],
    seeds: dict[int, int],
    book: Journal,
    workers: int | None = None,
) -> pd.DataFrame:
    """One row per case; what `book` has is not flown again.

    seeds  number of vehicles -> how many seeds to fly
    """
    import pandas as pd

    for key, s in made.items():
        check_random(s, "an answer", seeds[key[1]])
    jobs = {
        key: [Job(" ".join(map(str, key)), override(s, {}), seed) for seed in range(1, seeds[key[1]] + 1)]
        for key, s in made.items()
    }
    flat = [job for of in jobs.values() for job in of]
    rows = dict(zip(flat, fly_rows(measure, flat, keys(flat), book, workers, said), strict=True))
    return pd.DataFrame([_row(key, [rows[j] for j in of]) for key, of in jobs.items()])


def _row(key: tuple[str, int, str, str], runs: list[dict[str, Any]]) -> dict[str, Any]:
    vehicle, n, weather, remedy = key
    lost = rate([r.get("distance_verdict") != "holds" for r in runs])
    distances = [r["distance_m"] for r in runs if r.get("distance_m") is not None]
    return {
        "vehicle": vehicle,
        "number": n,
        "weather": weather,
        "remedy": remedy,
        "runs": lost.runs,
        "distinct": distinct_results(runs, without=("seed", "rung")),
        "lost": lost.count,
        "rate_low": lost.low,
        "rate_high": lost.high,
        "least_distance_m": min(distances) if distances else float("nan"),
        "median_distance_m": median(distances) if distances else float("nan"),
        "least_h_m": min((r["h_m"] for r in runs if r.get("h_m") is not None), default=float("nan")),
        "infeasible_steps": sum(r.get("infeasible") or 0 for r in runs),
        # Runs in which every vehicle passed its goal: a vehicle that keeps its distance but never arrives is
        # no success.
        "arrived": sum(r.get("goal_passed_s") is not None for r in runs),
        "ended_early": sum(bool(r.get("ended_early")) or bool(r["refused"]) for r in runs),
    }


def markdown(table: pd.DataFrame) -> str:
    """The table as Markdown, as the guide shows it."""
    lines = [
        "| vehicle | number | weather | remedy | lost | 95 % Clopper-Pearson | least [m] | median [m]"
        " | arrived |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {r.vehicle} | {r.number} | {r.weather} | {r.remedy} | {r.lost} of {r.runs}"
        f" | {100 * r.rate_low:.1f} to {100 * r.rate_high:.1f} %"
        f" | {r.least_distance_m:.2f} | {r.median_distance_m:.2f} | {r.arrived} of {r.runs} |"
        for r in table.itertuples()
    ]
    return "\n".join(lines) + "\n"
