"""Flies the cells of the answer and counts, cell by cell, what was kept and who arrived.

Every cell is flown from seeded starts; the verdict is separation at the scenario's Ds. A run that is in the
journal, or in a folder that is added to, is not flown again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from statistics import median
from typing import TYPE_CHECKING, Any

from testbed.campaigns.distinct import check_random, distinct_results
from testbed.campaigns.engine import fly_rows
from testbed.campaigns.identity import code_id
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal
from testbed.scenario.scenario import Scenario, load
from testbed.statistics import rate
from testbed.studies.answer.cells import COLUMNS, Cell
from testbed.studies.common.measure import keys, measure, override, said

if TYPE_CHECKING:
    import pandas as pd

# What names a run, or says how it was computed, and is no result of it.
NAMES = ("seed", "code", *COLUMNS)
# Of tables that were flown when there was one mission and one guidance.
ONCE = {"mission": "swap", "guidance": "straight"}


def d_safe_m() -> float:
    """Ds of every cell: the paper's."""
    return load("paper-2-turn").d_safe_m


def fly(
    made: Mapping[Cell, Scenario],
    seeds: Mapping[Cell, range],
    book: Journal,
    workers: int | None = None,
    known: pd.DataFrame | None = None,
) -> pd.DataFrame:
    """One row per run, `known` first; what it or `book` has is not flown again.

    seeds  of each cell
    known  runs of an earlier folder, as `fly` returned them
    """
    import pandas as pd

    for cell, s in made.items():
        check_random(s, "an answer", len(seeds[cell]))
    there = set() if known is None else {(*_names(r), r["seed"]) for r in known.to_dict("records")}
    jobs = [
        (cell, Job(str(cell), override(s, {}), seed))
        for cell, s in made.items()
        for seed in seeds[cell]
        if (*cell, seed) not in there
    ]
    flat = [job for _, job in jobs]
    rows = fly_rows(measure, flat, keys(flat), book, workers, said)
    code = code_id(measure.__module__)
    flown = pd.DataFrame(
        [
            cell.named() | {"seed": job.seed} | {k: row[k] for k in row if k != "rung"} | {"code": code}
            for (cell, job), row in zip(jobs, rows, strict=True)
        ]
    )
    if known is None:
        return flown
    return known if flown.empty else pd.concat([known, flown], ignore_index=True)


def _names(run: Mapping[str, Any]) -> Cell:
    return Cell(**{name: run[name] for name in COLUMNS})


def table(runs: pd.DataFrame) -> pd.DataFrame:
    """One row per cell, of the runs in their order."""
    import pandas as pd

    groups = runs.assign(**{k: v for k, v in ONCE.items() if k not in runs}).groupby(COLUMNS, sort=False)
    return pd.DataFrame([_row(Cell(*key), of.to_dict("records")) for key, of in groups])


def _row(cell: Cell, runs: list[dict[str, Any]]) -> dict[str, Any]:
    lost = rate([r.get("distance_verdict") != "holds" for r in runs])
    # Without an h the run did not keep it.
    below = rate([not r.get("h_m", math.nan) >= 0 for r in runs])
    distances = _known(runs, "distance_m")
    arrived = sum(_known(runs, "arrived_share")) / lost.runs
    return cell.named() | {
        "runs": lost.runs,
        "distinct": distinct_results(runs, without=NAMES),
        "lost": lost.count,
        "rate_low": lost.low,
        "rate_high": lost.high,
        "least_distance_m": min(distances, default=math.nan),
        "median_distance_m": median(distances) if distances else math.nan,
        "h_below_0": below.count,
        "h_low": below.low,
        "h_high": below.high,
        "least_h_m": min(_known(runs, "h_m"), default=math.nan),
        "least_flow_m": min(_known(runs, "flow_m"), default=math.nan),
        "infeasible_steps": int(sum(_known(runs, "infeasible"))),
        # Runs in which every vehicle passed its goal: a vehicle that keeps its distance but never arrives is
        # no success.
        "arrived": len(_known(runs, "goal_passed_s")),
        # Of all vehicles, those of runs that could not start included; of the runs that all arrived in, when
        # the last did, and the worst vehicle's time against alone.
        "arrived_share": arrived,
        "last_s": max(_known(runs, "goal_passed_s"), default=math.nan),
        "time_added_s": median(_known(runs, "time_added_s") or [math.nan]),
        # Vehicles that waited longer than G7b allows; nan where the runs were too short to tell.
        "waiting": sum(_known(runs, "waiting")) if _known(runs, "waiting") else math.nan,
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


HEAD = (
    "fleet", "remedy", "guidance", "lost", "95 %", "least, median [m]", "h < 0", "95 %", "vehicles arrived",
    "fleets arrived", "last at [s]", "later than alone [s]", "waiting",
)  # fmt: skip


def markdown(table: pd.DataFrame) -> str:
    """The table as Markdown, as the guide shows it."""
    lines = [f"| {' | '.join(HEAD)} |", "|" + "---|" * len(HEAD)]
    lines += [f"| {' | '.join(_cells(r))} |" for r in table.itertuples()]
    return "\n".join(lines) + "\n"


def _cells(r: Any) -> list[str]:
    def number(value: float, form: str) -> str:
        return "" if math.isnan(value) else format(value, form)

    return [
        f"{r.number} {r.vehicle}, {r.mission}, {r.weather}",
        r.remedy,
        r.guidance,
        f"{r.lost} of {r.runs}",
        f"{100 * r.rate_low:.1f} to {100 * r.rate_high:.1f} %",
        f"{r.least_distance_m:.2f}, {r.median_distance_m:.2f}",
        f"{r.h_below_0} of {r.runs}",
        f"{100 * r.h_low:.1f} to {100 * r.h_high:.1f} %",
        number(r.arrived_share * r.number * r.runs, ".0f") + f" of {r.number * r.runs}",
        f"{r.arrived} of {r.runs}",
        number(r.last_s, ".1f"),
        number(r.time_added_s, ".1f"),
        number(r.waiting, ".0f"),
    ]
