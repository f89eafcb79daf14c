"""Judges a run by a requirement: its robustness, the vehicles it was least for, and whether it is met."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from math import inf, isnan, nan
from typing import Any

import numpy as np

from testbed.claims.registry import CLAIMS
from testbed.errors import UserError, short
from testbed.records.run import AIRCRAFT_COLUMNS, Run
from testbed.records.verdict import Status
from testbed.requirements.formula import Formula, columns, conjuncts, horizon
from testbed.requirements.parser import parse
from testbed.requirements.quantities import FENCE, PAIR, QUANTITIES, Measured, Subject, missing
from testbed.requirements.robustness import Signals, robustness
from testbed.requirements.units import check
from testbed.scenario import fleet, guidance_rules
from testbed.scenario.scenario import Scenario


@dataclass(frozen=True)
class Robustness:
    """What a run says of a requirement.

    value     robustness: 0 or more where it is met; None where the run cannot tell
    unit      of it; "" where comparisons of several units have part in it
    status    holds, violated, or open
    vehicles  that it is least for
    why       it is open, or ""
    """

    value: float | None
    unit: str
    status: Status
    vehicles: tuple[int, ...] = ()
    why: str = ""

    def entry(self) -> dict[str, Any]:
        """With the keys of a verdict."""
        return {
            "value": self.value,
            "margin": self.value,
            "unit": self.unit,
            "verdict": self.status.value,
            "vehicles": list(self.vehicles),
            "t_s": None,
            "why": self.why,
        }


@dataclass(frozen=True)
class Requirement:
    """A formula that every vehicle under the filter has to meet, and every pair with one of them."""

    text: str

    @cached_property
    def formula(self) -> Formula:
        return _parsed(self.text)[0]

    @cached_property
    def unit(self) -> str:
        return _parsed(self.text)[1]

    def check(self, s: Scenario) -> None:
        """UserError if runs of a scenario cannot tell: too short, without a column, or vehicles leave."""
        where = f"requirement {short(self.text)!r}"
        if (ahead := horizon(self.formula)) > s.duration_s + 1e-9:
            raise UserError(
                f"{where} looks {ahead:g} s ahead, and {s.name} lasts {s.duration_s:g} s;"
                f" set duration_s={ahead:g}, or shorten its intervals"
            )
        if s.goal.on_arrival == "leave":
            remedy = "set goal.on_arrival to fly-on or loiter"
            raise UserError(
                f"{where}: vehicles of {s.name} leave on arrival, and then have no columns; {remedy}"
            )
        own = s.vehicles - len(fleet.intruders(s))
        for column in columns(self.formula):
            of = QUANTITIES[column.name]
            lacks = ""
            if of.of == PAIR and s.vehicles < 2:
                lacks = "it has one vehicle, and no pair"
            elif of.of == FENCE and not s.fence:
                lacks = "it has no [[fence]] table"
            elif own == 0:
                lacks = "no vehicle is under the filter"
            elif column.name in AIRCRAFT_COLUMNS and s.plant in ("unicycle", "lagged"):
                lacks = missing(column.name)
            elif column.name == "goal_distance_m" and not guidance_rules.seeking(s).all():
                without = ", ".join(
                    str(k + 1) for k in guidance_rules.goalless(s) if k not in fleet.intruders(s)
                )
                lacks = f"vehicle {without} has no goal" if without else ""
            if lacks:
                raise UserError(f"{where}: {s.name} has no column {column.name}: {lacks}")

    def judge(self, run: Run) -> Robustness:
        """The least robustness over its parts joined by `and`, and over all that each is about.

        Raises  UserError as `check` does
        """
        measured = Measured(run)
        self.check(measured.scenario)
        ended = run.manifest["ended_early"]
        end = measured.scenario.duration_s if ended else float(measured.t[-1])
        high = self._least(measured, end, inf)
        low = self._least(measured, end, -inf) if ended else high
        if isnan(high[0]):
            return Robustness(None, self.unit, Status.OPEN, high[1], "a column has no value at some time")
        if high[0] < 0:
            return Robustness(high[0], self.unit, Status.VIOLATED, high[1])
        if high[0] == low[0]:
            return Robustness(high[0], self.unit, Status.HOLDS, high[1])
        why = f"the run ended early: {ended}"
        if low[0] >= 0:
            return Robustness(low[0], self.unit, Status.HOLDS, low[1])
        return Robustness(None, self.unit, Status.OPEN, high[1], why)

    def _least(self, measured: Measured, end: float, beyond: float) -> tuple[float, tuple[int, ...]]:
        """The least robustness, and of whom; nan where a column has no value and nothing is below 0."""
        found: tuple[float, tuple[int, ...]] = (inf, ())
        unknown: tuple[int, ...] | None = None
        for part in conjuncts(self.formula):
            named = {c.name for c in columns(part)}
            subjects = measured.subjects({QUANTITIES[n].of for n in named})
            values = {n: measured.values(n, subjects) for n in named}
            each = robustness(part, Signals(measured.t, values, end, beyond))
            without = np.isnan(each)
            if without.any():
                unknown = _sorted(subjects[int(np.argmax(without))])
            k = int(np.argmin(np.where(without, inf, each)))
            if each[k] < found[0]:
                found = float(each[k]), _sorted(subjects[k])
        return found if unknown is None or found[0] < 0 else (nan, unknown)


def _sorted(subject: Subject) -> tuple[int, ...]:
    return tuple(sorted(subject.vehicles))


@lru_cache(maxsize=64)
def _parsed(text: str) -> tuple[Formula, str]:
    formula = parse(text)
    return formula, check(formula, text)


def entry(run: Run, name: str) -> Mapping[str, Any]:
    """The verdict of a run on a claim by its id, or on a requirement by its text, with a verdict's keys."""
    return run.guarantee(name) if name in CLAIMS else Requirement(name).judge(run).entry()


def recorded_at_every_step(s: Scenario) -> Scenario:
    """The scenario recorded at every filter step: what a requirement is judged on."""
    rates = s.rates.model_copy(update={"record_dt_s": s.rates.filter_dt_s})
    return s.model_copy(update={"rates": rates})
