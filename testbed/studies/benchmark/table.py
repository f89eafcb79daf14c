"""Tabulates a benchmark: per cell rates with intervals, and which filters lose fewer runs than which."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from testbed.statistics import PairedVerdicts, mean, paired_verdicts, rate

Rows = Sequence[Mapping[str, Any]]
# Of what all comparisons of a page together claim.
ERROR = 0.05


def cells(rows: Rows) -> list[dict[str, Any]]:
    """A row per set, plant and filter, in the order of `rows`.

    lost, low, high  runs lost and the Clopper-Pearson interval of their rate
    overridden...    mean share of steps altered, with its interval
    arrived...       share of runs in which everybody arrived, with its interval
    """
    found: dict[tuple[str, str, str], list[Mapping[str, Any]]] = {}
    for r in rows:
        found.setdefault((r["set"], r["plant"], r["filter"]), []).append(r)
    return [
        {"set": set_, "plant": plant, "filter": name} | _cell(of) for (set_, plant, name), of in found.items()
    ]


def _cell(of: Rows) -> dict[str, Any]:
    flown = [r for r in of if not r["refused"]]
    seen = rate([r["lost"] for r in flown])
    home = rate([r["arrived"] == r["due"] for r in flown])
    altered = mean([r["overridden"] for r in flown], np.random.default_rng(0))
    distances = [r["distance_m"] for r in flown if r["distance_m"] is not None]
    added = [r["added_s"] for r in flown if r["added_s"] is not None]
    return {
        "runs": len(flown),
        "refused": len(of) - len(flown),
        "why": next((r["refused"] for r in of if r["refused"]), ""),
        "lost": seen.count,
        "low": seen.low,
        "high": seen.high,
        "least_m": min(distances) if distances else None,
        "median_m": float(np.median(distances)) if distances else None,
        "overridden": altered.value,
        "overridden_low": max(0.0, altered.low),
        "overridden_high": min(1.0, altered.high),
        "arrived": home.count,
        "arrived_low": home.low,
        "arrived_high": home.high,
        "added_s": float(np.median(added)) if added else None,
        "ended_early": sum(bool(r["ended_early"]) for r in flown),
    }


def pooled(rows: Rows, vehicles: Mapping[str, int]) -> list[dict[str, Any]]:
    """As `cells`, over all sets of equal size of fleet together; `set` then names the size.

    vehicles  set -> how many fly in it
    """
    return cells([r | {"set": f"{vehicles[r['set']]} vehicles"} for r in map(dict, rows)])


@dataclass(frozen=True)
class Comparison:
    """Two filters on one plant, in all sets of one size, encounter by encounter.

    sure  whether they differ once all comparisons of the page are counted
    """

    fleet: str
    plant: str
    first: str
    second: str
    pair: PairedVerdicts
    sure: bool = False

    @property
    def better(self) -> str:
        """The filter that loses fewer runs."""
        return self.first if self.pair.only_second > self.pair.only_first else self.second

    @property
    def worse(self) -> str:
        return self.second if self.better == self.first else self.first


def comparisons(rows: Rows, vehicles: Mapping[str, int], without: str = "") -> list[Comparison]:
    """Every two filters on every plant: exact paired tests, which together err in at most 5 % (Holm).

    without  a filter that nothing is claimed of
    """
    groups: dict[tuple[str, str], dict[str, dict[tuple[str, str], bool]]] = {}
    for r in rows:
        if not r["refused"] and r["filter"] != without:
            fleet = f"{vehicles[r['set']]} vehicles"
            of = groups.setdefault((fleet, r["plant"]), {}).setdefault(r["filter"], {})
            of[r["set"], r["encounter"]] = bool(r["lost"])
    found = []
    for (fleet, plant), filters in groups.items():
        for first, second in itertools.combinations(filters, 2):
            both = [k for k in filters[first] if k in filters[second]]
            if both:
                a, b = ([filters[name][k] for k in both] for name in (first, second))
                found.append(Comparison(fleet, plant, first, second, paired_verdicts(a, b)))
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
    return [Comparison(c.fleet, c.plant, c.first, c.second, c.pair, k in sure) for k, c in enumerate(found)]


def fewer(found: Sequence[Comparison], fleet: str, plant: str, name: str) -> list[str]:
    """The filters that surely lose more runs than `name` there."""
    here = [c for c in found if (c.fleet, c.plant) == (fleet, plant)]
    return [c.worse for c in here if c.sure and c.better == name]
