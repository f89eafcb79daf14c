"""Findings: each quantity of each rung, now against recorded, with its verdict."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from testbed.regression.quantities import Quantity
from testbed.regression.tolerance import ALPHA_FRESH, ALPHA_RECORDED, Change, compare, holm

DEGRADED, IMPROVED, WITHIN = "degraded", "improved", "within tolerance"

Runs = Mapping[str, Mapping[str, np.ndarray]]


@dataclass(frozen=True)
class Finding:
    """One quantity on one rung.

    p        Holm-adjusted, of a degradation
    verdict  degraded and improved are significant and beyond the tolerance; "within tolerance" is worse
             significantly, but by less; "" is nothing found
    """

    rung: str
    quantity: Quantity
    change: Change
    seeds: int
    tolerance: float
    p: float
    verdict: str

    @property
    def moved(self) -> bool:
        return self.verdict in (DEGRADED, IMPROVED)

    def row(self) -> dict[str, Any]:
        """For a table as wide as a terminal; `sentence` has the evidence too."""
        q, c = self.quantity, self.change
        return {
            "rung": self.rung,
            "quantity": f"{q.name} [{q.unit}]" if q.unit else q.name,
            "recorded": c.recorded,
            "now": c.now,
            "worse by": c.worse,
            "tolerance": self.tolerance,
            "verdict": self.verdict,
        }

    def as_dict(self) -> dict[str, Any]:
        q, own = self.quantity, ("seeds", "tolerance", "p", "verdict")
        named = {"rung": self.rung, "quantity": q.name, "unit": q.unit}
        return named | vars(self.change) | {name: getattr(self, name) for name in own}

    def sentence(self) -> str:
        """The finding in words: which quantity, which rung, by how much, on what evidence."""
        c, q = self.change, self.quantity
        unit = f" {q.unit}" if q.unit else ""
        if q.verdict:
            how = f"in {100 * c.recorded:.0f} % of runs -> in {100 * c.now:.0f} %"
        elif np.isinf(c.worse):
            how = "is missing in runs that had it"
        else:
            way = "worse" if c.worse > 0 else "better"
            how = f"{c.recorded:.3g} -> {c.now:.3g}{unit}, {way} by {abs(c.worse):.3g}{unit}"
            how += f" (tolerance {self.tolerance:.3g}{unit})"
        if self.verdict != IMPROVED:
            how += f", on {c.seeds_worse} of {self.seeds} seeds" if c.seeds_worse is not None else ""
            how += f", p {self.p:.2g}"
        return f"{self.verdict}: {q.name} on {self.rung}: {how}"


def findings(
    quantities: Iterable[Quantity],
    recorded: Runs,
    now: Runs,
    tolerances: Mapping[str, Mapping[str, float]],
    paired: bool,
) -> list[Finding]:
    """Every quantity on every rung of `now`, corrected together.

    recorded, now  rung -> quantity -> values; of the same seeds, in order, if `paired`
    tolerances     rung -> quantity -> in its unit
    """
    alpha = ALPHA_RECORDED if paired else ALPHA_FRESH
    cases = [(rung, q) for rung in now for q in quantities]
    changes = [compare(q, recorded[rung][q.name], now[rung][q.name], paired) for rung, q in cases]
    worse, better = (holm([getattr(c, name) for c in changes]) for name in ("p_worse", "p_better"))
    made = []
    for (rung, q), change, p, p_better in zip(cases, changes, worse, better, strict=True):
        # A quantity that no recorded run had has no tolerance, and cannot get worse.
        allowed = tolerances[rung][q.name]
        verdict = ""
        if p <= alpha:
            verdict = DEGRADED if change.worse > allowed else WITHIN
        elif p_better <= alpha and -change.worse > allowed:
            verdict = IMPROVED
        seeds = len(now[rung][q.name])
        made.append(Finding(rung, q, change, seeds, allowed, float(p), verdict))
    return made
