"""Compares the measures of encounters flown with a filter and without, at equal seeds: the risk ratio.

What is undecided in a run counts against the filter: as lost with it, as not lost without it.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from testbed.errors import UserError
from testbed.measures.encounter_measures import WELL_CLEAR, Settings
from testbed.statistics import Mean, Quantile, Rate, mean, quantile, rate
from testbed.statistics.risk_ratio import RiskRatio, risk_ratio

if TYPE_CHECKING:
    import pandas as pd

Row = Mapping[str, Any]
# Before the names of measures in a campaign's table.
MEASURE = "measure_"


def rows_of(table: pd.DataFrame) -> list[Row | None]:
    """The rows of measures in a campaign's runs.parquet, in its order; None where a run was not flown."""
    names = [c for c in table.columns if c.startswith(MEASURE)]
    found: list[Row | None] = []
    for values in table[names].itertuples(index=False):
        row = {n.removeprefix(MEASURE): None if v != v else v for n, v in zip(names, values, strict=True)}
        found.append(row if any(v is not None for v in row.values()) else None)
    return found


def paired(
    with_filter: Mapping[Hashable, Row | None], without: Mapping[Hashable, Row | None]
) -> tuple[list[Hashable], list[Row], list[Row], int]:
    """Keys of the encounters that both have, their rows of measures, and how many are left out.

    Keys say which encounter a row is of: its seed, and whatever else both flew alike. A row is None where a
    run was refused or failed.
    Raises  UserError if no encounter is in both
    """
    common = [k for k in with_filter if with_filter[k] is not None and without.get(k) is not None]
    if not common:
        raise UserError("no encounter was flown both with and without the filter: nothing to compare")
    left_out = len(with_filter.keys() | without.keys()) - len(common)
    first, second = ([rows[k] for k in common] for rows in (with_filter, without))
    return common, first, second, left_out  # type: ignore[return-value]


def lost(rows: Sequence[Row], name: str, if_undecided: bool) -> NDArray[np.bool_]:
    """(n,) whether each run lost the cylinder `name`."""
    return np.array(
        [if_undecided if row[f"{name}_undecided"] else bool(row[f"{name}_lost"]) for row in rows], dtype=bool
    )


def compared(
    with_filter: Sequence[Row],
    without: Sequence[Row],
    rng: np.random.Generator,
    settings: Settings | None = None,
    groups: Sequence[Hashable] | None = None,
    nuisance: str = WELL_CLEAR,
) -> dict[str, Any]:
    """What the filter changes, of rows of `measured` in the same order of encounters; see `plain` for data.

    groups    encounters that belong together, as in `risk_ratio`
    nuisance  the cylinder by which an intervention was needed: one is a nuisance where this cylinder is not
              lost without the filter
    Returns   encounters, and of each cylinder NAME: `NAME` RiskRatio, `NAME_depth` and `NAME_time_s` Mean of
              the runs with the filter that lost it; `interventions` Rate of encounters; `nuisance` Rate of
              encounters without a loss in which it intervened all the same; `nuisance_of_interventions` Rate;
              `missed` Rate of encounters with a loss without the filter in which it never intervened;
              `lead_s` Quantile of 1/2; `path_added_m`, `flown_added_s` Mean of with less without; `arrived`,
              `arrived_without` (vehicles, of those with a goal); `undecided` (with, without) runs
    """
    settings = settings or Settings()
    found: dict[str, Any] = {"encounters": len(with_filter)}
    keys = None if groups is None else _numbered(groups)
    for name in settings.cylinders:
        a, b = lost(with_filter, name, True), lost(without, name, False)
        found[name] = risk_ratio(a, b, rng, keys)
        for what in ("depth", "time_s"):
            seen = [row[f"{name}_{what}"] for row, of in zip(with_filter, a, strict=True) if of]
            found[f"{name}_{what}"] = mean(seen, rng)
    intervened = np.array([row["intervention_s"] is not None for row in with_filter], dtype=bool)
    found["interventions"] = rate(intervened)
    if nuisance in settings.cylinders:
        needed = lost(without, nuisance, False)
        found["nuisance"] = rate(intervened[~needed])
        found["nuisance_of_interventions"] = rate(~needed[intervened])
        found["missed"] = rate(~intervened[needed])
    leads = [row["lead_s"] for row in with_filter if row["lead_s"] is not None]
    found["lead_s"] = quantile(leads, 0.5)
    for name, of in (("path_added_m", "path_m"), ("flown_added_s", "flown_s")):
        found[name] = mean([a[of] - b[of] for a, b in zip(with_filter, without, strict=True)], rng)
    for name, rows in (("arrived", with_filter), ("arrived_without", without)):
        found[name] = sum(row["arrived"] for row in rows), sum(row["with_goal"] for row in rows)
    found["undecided"] = tuple(
        sum(any(row[f"{name}_undecided"] for name in settings.cylinders) for row in rows)
        for rows in (with_filter, without)
    )
    return found


def plain(found: Mapping[str, Any]) -> dict[str, Any]:
    """What `compared` found as plain data; numbers that are not finite become None."""
    return {name: _plain(value) for name, value in found.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, RiskRatio):
        more = {"value": value.value, "with_filter": value.with_filter, "without": value.without}
        return _plain(asdict(value) | more | {"unresolved": _plain(value.unresolved)})
    if isinstance(value, Rate | Mean | Quantile):
        return _plain(asdict(value) | {"value": value.value, "method": value.method})
    if isinstance(value, Mapping):
        return {name: _plain(v) for name, v in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _numbered(groups: Sequence[Hashable]) -> list[int]:
    numbers: dict[Hashable, int] = {}
    return [numbers.setdefault(group, len(numbers)) for group in groups]
