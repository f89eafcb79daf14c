"""Flies the central table: aircraft, numbers of vehicles, weather and remedies.

Every row is one setting flown from common seeded starts; the verdict is separation at the scenario's Ds. A
run that is in the journal is not flown again, so an interrupted table goes on from there and ends the same.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from statistics import mean, median
from typing import TYPE_CHECKING, Any

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.errors import UserError, nearest
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
Case = tuple[str, int, str, str]  # vehicle, number, weather, remedy
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
    "0.8 s ahead, +0.5 m": {"remedy.prediction_s": 0.8, "remedy.ds_buffer_m": 0.5},
}
USUAL = tuple(REMEDIES)[:5]


def d_safe_m() -> float:
    """Ds of every case: the paper's."""
    return load("paper-2-turn").d_safe_m


def cases(
    airframes: Iterable[str],
    vehicles: Iterable[int],
    only: Sequence[str] = (),
    changes: Sequence[str] = (),
) -> dict[Case, Scenario]:
    """(vehicle, number, weather, remedy) -> scenario; the unicycle first, in calm air and without remedy.

    only     names of the remedies to fly; empty flies the USUAL
    changes  of every scenario, as --set takes them
    Raises   UserError for a remedy that there is not
    """
    if unknown := [name for name in only if name not in REMEDIES]:
        raise UserError(f"--only {unknown[0]!r}: unknown remedy; {nearest(unknown[0], REMEDIES)}")
    chosen = {name: fields for name, fields in REMEDIES.items() if name in (only or USUAL)}
    made: dict[Case, Scenario] = {}
    for n in vehicles:
        name, *more = FLEETS[n]
        base = default_starts(load(name, [*COMMON, *more, *changes]))
        for remedy in ("none", "smoothed"):
            if remedy in chosen:
                made["unicycle", n, "calm", remedy] = changed(base, {"plant": "unicycle"} | chosen[remedy])
        for airframe in airframes:
            aircraft: Fields = {"plant": "jsbsim", "airframes": [airframe]}
            for weather, air in WEATHER.items():
                for remedy, fields in chosen.items():
                    made[airframe, n, weather, remedy] = changed(base, aircraft | air | fields)
    return made


def answer(
    made: dict[Case, Scenario], seeds: dict[int, range], book: Journal, workers: int | None = None
) -> pd.DataFrame:
    """One row per run; what `book` has is not flown again.

    seeds  number of vehicles -> seeds to fly
    """
    import pandas as pd

    for key, s in made.items():
        check_random(s, "an answer", len(seeds[key[1]]))
    jobs = [
        (key, Job(" ".join(map(str, key)), override(s, {}), seed))
        for key, s in made.items()
        for seed in seeds[key[1]]
    ]
    flat = [job for _, job in jobs]
    rows = fly_rows(measure, flat, keys(flat), book, workers, said)
    named = ("vehicle", "number", "weather", "remedy")
    return pd.DataFrame(
        [
            dict(zip(named, key, strict=True)) | {"seed": job.seed} | {k: row[k] for k in row if k != "rung"}
            for (key, job), row in zip(jobs, rows, strict=True)
        ]
    )


def table(runs: pd.DataFrame) -> pd.DataFrame:
    """One row per case, of the runs in their order."""
    import pandas as pd

    named = ["vehicle", "number", "weather", "remedy"]
    groups = runs.groupby(named, sort=False)
    return pd.DataFrame([_row(key, of.to_dict("records")) for key, of in groups])


def _row(key: Case, runs: list[dict[str, Any]]) -> dict[str, Any]:
    vehicle, n, weather, remedy = key
    lost = rate([r.get("distance_verdict") != "holds" for r in runs])
    distances = _known(runs, "distance_m")
    without = ("seed", "vehicle", "number", "weather", "remedy")
    return {
        "vehicle": vehicle,
        "number": n,
        "weather": weather,
        "remedy": remedy,
        "runs": lost.runs,
        "distinct": distinct_results(runs, without=without),
        "lost": lost.count,
        "rate_low": lost.low,
        "rate_high": lost.high,
        "least_distance_m": min(distances, default=math.nan),
        "median_distance_m": median(distances) if distances else math.nan,
        "least_h_m": min(_known(runs, "h_m"), default=math.nan),
        "infeasible_steps": int(sum(_known(runs, "infeasible"))),
        # Runs in which every vehicle passed its goal: a vehicle that keeps its distance but never arrives is
        # no success.
        "arrived": len(_known(runs, "goal_passed_s")),
        # Of single vehicles; and of the runs that all arrived in, the worst vehicle's time against alone.
        "arrived_share": mean(_known(runs, "arrived_share") or [math.nan]),
        "time_added_s": median(_known(runs, "time_added_s") or [math.nan]),
        "ended_early": sum(bool(_text(r, "ended_early") or _text(r, "refused")) for r in runs),
    }


def _known(runs: list[dict[str, Any]], name: str) -> list[float]:
    """The values of a column that are numbers; a run that could not start has none."""
    values = [r.get(name) for r in runs]
    return [v for v in values if v is not None and not math.isnan(v)]


def _text(run: dict[str, Any], name: str) -> str:
    """A column of words; read from a file, nan where there are none."""
    value = run.get(name)
    return value if isinstance(value, str) else ""


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
