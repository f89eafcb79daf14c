"""Tabulates a benchmark: per cell rates with intervals, and which filters lose fewer runs than which."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from testbed.measures.encounter_comparison import compared, lost
from testbed.measures.encounter_measures import NMAC
from testbed.statistics import PairedVerdicts, mean, paired_verdicts, rate
from testbed.statistics.risk_ratio import risk_ratio

Row = Mapping[str, Any]
Rows = Sequence[Row]
# Of what all comparisons of a page together claim.
ERROR = 0.05


def cells(rows: Rows, without: str = "") -> list[dict[str, Any]]:
    """A row per set, plant and filter, in the order of `rows`.

    without     the filter that does nothing, for the risk ratios
    lost...     runs lost, and the Clopper-Pearson interval of their rate
    ratio...    risk ratio of losing Ds, its exact interval; `nmac_ratio` of the near mid-air collision
    altered...  mean share of vehicles' time in which commands are altered, with its interval
    arrived...  share of runs in which everybody arrived, with its interval
    nuisance... runs in which the filter intervened, of those that stay well clear without it
    """
    found: dict[tuple[str, str, str], list[Row]] = {}
    for r in rows:
        found.setdefault((r["set"], r["plant"], r["filter"]), []).append(r)
    return [
        {"set": set_, "plant": plant, "filter": name}
        | _cell(of, found.get((set_, plant, without), []) if name != without else [])
        for (set_, plant, name), of in found.items()
    ]


def _cell(of: Rows, base: Rows) -> dict[str, Any]:
    flown = [r for r in of if not r["refused"]]
    altered = mean([r["intervention_share"] for r in flown], np.random.default_rng(0))
    distances = [r["distance_m"] for r in flown if r["distance_m"] is not None]
    added = [r["time_added_s"] for r in flown if r["time_added_s"] is not None]
    return {
        "runs": len(flown),
        "refused": len(of) - len(flown),
        "why": next((r["refused"] for r in of if r["refused"]), ""),
        **_rate("lost", [r["lost"] for r in flown]),
        **_rate("nmac", lost(flown, NMAC, True).tolist()),
        **_rate("arrived", [r["arrived"] == r["with_goal"] for r in flown]),
        **_against(flown, base),
        "least_m": min(distances) if distances else None,
        "median_m": float(np.median(distances)) if distances else None,
        "altered": altered.value,
        "altered_low": max(0.0, altered.low),
        "altered_high": min(1.0, altered.high),
        "added_s": float(np.median(added)) if added else None,
    }


def _rate(name: str, outcomes: Sequence[bool]) -> dict[str, Any]:
    seen = rate(outcomes)
    return {name: seen.count, f"{name}_low": seen.low, f"{name}_high": seen.high}


def _against(flown: Rows, base: Rows) -> dict[str, Any]:
    """Risk ratios and nuisances against the flights without a filter, encounter by encounter."""
    alone = {_met(r): r for r in base if not r["refused"]}
    both = [(r, alone[_met(r)]) for r in flown if _met(r) in alone]
    if not both:
        return {}
    rng = np.random.default_rng(0)
    first, second = ([pair[k] for pair in both] for k in (0, 1))
    ratio = risk_ratio([r["lost"] for r in first], [r["lost"] for r in second], rng)
    against = compared(first, second, rng)
    nmac, nuisance = against[NMAC], against["nuisance"]
    return {
        "ratio": ratio.value,
        "ratio_low": ratio.exact.low,
        "ratio_high": ratio.exact.high,
        "nmac_ratio": nmac.value,
        "nmac_ratio_low": nmac.exact.low,
        "nmac_ratio_high": nmac.exact.high,
        "nuisance": nuisance.count,
        "nuisance_of": nuisance.runs,
        "nuisance_low": nuisance.low,
        "nuisance_high": nuisance.high,
    }


def _met(r: Row) -> tuple[str, str]:
    """Which encounter a row is of; the set as the file names it."""
    return r.get("of", r["set"]), r["encounter"]


def pooled(rows: Rows, vehicles: Mapping[str, int], without: str = "") -> list[dict[str, Any]]:
    """As `cells`, over all sets of equal size of fleet together; `set` then names the size.

    vehicles  set -> how many fly in it
    """
    merged = [{**r, "of": r["set"], "set": f"{vehicles[r['set']]} vehicles"} for r in rows]
    return cells(merged, without)


@dataclass(frozen=True)
class Comparison:
    """Two filters on one plant, in all sets of one size, encounter by encounter.

    first, second  the one that loses more runs is the second
    sure           whether they differ once all comparisons of the page are counted
    """

    fleet: str
    plant: str
    first: str
    second: str
    pair: PairedVerdicts
    sure: bool = False


def comparisons(rows: Rows, vehicles: Mapping[str, int], without: str = "") -> list[Comparison]:
    """Every two filters on every plant: exact paired tests, which together err in at most 5 % (Holm).

    without  a filter that nothing is claimed of
    """
    groups: dict[tuple[str, str], dict[str, dict[tuple[str, str], bool]]] = {}
    for r in rows:
        if not r["refused"] and r["filter"] != without:
            fleet = f"{vehicles[r['set']]} vehicles"
            here = groups.setdefault((fleet, r["plant"]), {}).setdefault(r["filter"], {})
            here[r["set"], r["encounter"]] = bool(r["lost"])
    found = []
    for (fleet, plant), filters in groups.items():
        for first, second in itertools.combinations(filters, 2):
            both = [k for k in filters[first] if k in filters[second]]
            of = {name: [filters[name][k] for k in both] for name in (first, second)}
            one, other = sorted(of, key=lambda name: sum(of[name]))
            if both:
                found.append(Comparison(fleet, plant, one, other, paired_verdicts(of[one], of[other])))
    return holm(found)


def holm(found: Sequence[Comparison], error: float = ERROR) -> list[Comparison]:
    """The comparisons, marked where they are sure: Holm's step-down rule over all of them.

    Source  Holm 1979, A simple sequentially rejective multiple test procedure.
    """
    order = sorted(range(len(found)), key=lambda k: found[k].pair.p_value)
    sure: set[int] = set()
    for place, k in enumerate(order):
        if found[k].pair.p_value > error / (len(found) - place):
            break
        sure.add(k)
    return [replace(c, sure=k in sure) for k, c in enumerate(found)]
