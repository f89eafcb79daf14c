"""Compares remedies at equal seeds."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.journal import Journal
from testbed.components.components import Parts
from testbed.scenario.scenario import Scenario
from testbed.statistics import rate
from testbed.studies.common.measure import Fields, job_of, keys, measure, override, said

if TYPE_CHECKING:
    import pandas as pd


def compare(
    s: Scenario,
    remedies: dict[str, Fields],
    seeds: range,
    book: Journal,
    workers: int | None = None,
    parts: Parts | None = None,
) -> pd.DataFrame:
    """One row per remedy and seed; what `book` has is not flown again. UserError if nothing is random.

    parts  of the user's own, in every run
    """
    import pandas as pd

    check_random(s, "a comparison", len(seeds))
    data = {name: override(s, fields) for name, fields in remedies.items()}
    jobs = [job_of(name, of, seed, parts) for name, of in data.items() for seed in seeds]
    rows = fly_rows(measure, jobs, keys(jobs), book, workers, said)
    return pd.DataFrame(
        [row | {"remedy": job.label, "seed": job.seed} for row, job in zip(rows, jobs, strict=True)]
    )


def table(rows: pd.DataFrame, straight_m: float) -> pd.DataFrame:
    """One row per remedy: violation rate and interval, distances, infeasible steps, cost in path and time.

    straight_m  length of the undisturbed way, of which `path_cost` is the share added by the worst vehicle
    `time_added_s` is that of the worst vehicle against alone; the goal's delay is against the first remedy,
    seed by seed. All are medians of the runs in which every vehicle passed its goal, `arrived` of n;
    `arrived_share` is that of single vehicles.
    """
    import pandas as pd

    names = list(dict.fromkeys(rows.remedy))
    base = rows[rows.remedy == names[0]].set_index("seed")
    made = []
    for name in names:
        of = rows[rows.remedy == name].set_index("seed")
        lost = rate((of.distance_verdict != "holds").to_numpy())
        made.append(
            {
                "remedy": name,
                "n": len(of),
                "distinct": distinct_results(
                    of.drop(columns=["remedy", "rung"], errors="ignore").to_dict("records")
                ),
                "violations": lost.count,
                "rate": lost.value,
                "rate_low": lost.low,
                "rate_high": lost.high,
                "least_distance_m": of.distance_m.min(),
                "median_distance_m": of.distance_m.median(),
                "least_h_m": of.h_m.min(),
                "infeasible_steps": of.infeasible.sum(),
                "overridden_share": of.overridden_share.mean(),
                "arrived": int(of.goal_passed_s.notna().sum()),
                "arrived_share": of.arrived_share.mean(),
                "path_cost": of.path_added_m.astype(float).median() / straight_m,
                "time_added_s": of.time_added_s.astype(float).median(),
                "goal_delay_s": np.nanmedian((of.goal_passed_s - base.goal_passed_s).astype(float))
                if of.goal_passed_s.notna().any()
                else float("nan"),
            }
        )
    return pd.DataFrame(made)


def markdown(made: pd.DataFrame) -> str:
    """A table of remedies as Markdown, as the guide shows it; distances in metres."""

    def known(value: float, form: str) -> str:
        return "" if np.isnan(value) else format(value, form)

    lines = [
        "| remedy | lost | 95 % Clopper-Pearson | least d | median d | least h | no solution | overridden"
        " | fleets arrived | vehicles arrived | path | delay [s] |",
        "|" + 12 * "---|",
    ]
    lines += [
        f"| {r.remedy} | {r.violations} of {r.n} | {100 * r.rate_low:.1f} to {100 * r.rate_high:.1f} %"
        f" | {r.least_distance_m:.2f} | {r.median_distance_m:.2f} | {r.least_h_m:.2f}"
        f" | {r.infeasible_steps:.0f} | {r.overridden_share:.0%} | {r.arrived} of {r.n}"
        f" | {known(r.arrived_share, '.0%')}"
        f" | {known(r.path_cost, '+.1%')} | {known(r.goal_delay_s, '+.2f')} |"
        for r in made.itertuples()
    ]
    return "\n".join(lines) + "\n"
