"""Refuses many seeds of the same run, and counts how many runs of many are distinct."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from testbed.campaigns.plan import Plan
from testbed.errors import UserError
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import Scenario, parse
from testbed.statistics import distinct, nothing_random

# Roles that are given random generators.
DRAWING = ("plant", "environment")
REMEDY = "perturb the start, for example start.heading_perturbation_deg = 5"
SET = REMEDY.replace(" = ", "=").replace("example ", "example --set ")


def check_distinct(plan: Plan) -> None:
    """UserError if a cell has several seeds and nothing in it depends on the seed."""
    for cell in plan.cells:
        if any(plan.parts.origins[label]["role"] in DRAWING for label in cell.own):
            continue  # a part of the user's own may draw from the generators it is given
        runs = plan.of(cell.number)
        several = sum(r.base == runs[0].base for r in runs)
        if several < 2 or any(r.draws != runs[0].draws for r in runs):
            continue
        if not all(random_fields(parse(plan.data(runs[k]))) for k in range(0, len(runs), several)):
            where = plan.campaign.name + (f", {cell.label}" if len(plan.cells) > 1 else "")
            said = nothing_random(several)
            if plan.campaign.stop is not None:
                said = said.replace("seeds = 1", "looks = [1]")
            raise UserError(f"{where}: {said}, or {REMEDY}; every seed gives the same run")


def check_random(s: Scenario, study: str, seeds: int, *, one_will_do: bool = True) -> None:
    """UserError if a study would fly `s` with several seeds and nothing in it depends on the seed.

    one_will_do  whether the study can be had from a single seed
    """
    if seeds < 2 or random_fields(s):
        return
    other = ", or fly one seed" if one_will_do else ""
    raise UserError(
        f"{s.name}: {study} of {seeds} seeds, nothing random: every seed gives the same run; {SET}{other}"
    )


def distinct_results(rows: Iterable[Mapping[str, Any]], without: Iterable[str] = ("seed",)) -> int:
    """How many different results there are among the rows of runs.

    without  columns that name a run and are no result of it
    """
    left_out = set(without)
    return distinct([{k: v for k, v in row.items() if k not in left_out} for row in rows])


def counted(runs: int, found: int) -> str:
    """Runs and distinct results in words, with what follows where results repeat."""
    if found == runs:
        return f"{runs} runs, all distinct"
    return f"{runs} runs, only {found} distinct: intervals and tests take them for {runs} independent ones"
