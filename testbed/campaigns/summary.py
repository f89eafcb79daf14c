"""Summarises a campaign's rows cell by cell, with the statistics of `testbed.statistics`."""

from __future__ import annotations

from typing import Any

import numpy as np

from testbed.campaigns.bases import AXIS
from testbed.campaigns.distinct import distinct_results
from testbed.campaigns.flight import FAILED, REFUSED
from testbed.campaigns.progress import Progress
from testbed.claims.registry import SEPARATION_INTRUDERS
from testbed.records.verdict import Status
from testbed.statistics import Quantile, Rate, paired_verdicts, quantile, rate


def summary(state: Progress) -> list[dict[str, Any]]:
    """Per cell: how many runs there are and how many of them differ; how many lost the guarantee, with the
    Clopper-Pearson interval; its least value, 5 % quantile (interval of order statistics) and median; the
    pairs of equal seeds, or encounters, against the first cell that has the same.

    A run counts as lost unless the guarantee holds: also a refused or failed run, which is counted again as
    such. `distinct` is the number of different results. With a stopping rule the interval is that of the look
    that stopped the cell.
    """
    guarantee = state.plan.campaign.guarantee
    firsts: dict[str, np.ndarray] = {}
    rows = []
    for cell in state.plan.cells:
        runs = [r for r in state.plan.of(cell.number) if r.id in state.entries]
        found = [state.entries[r.id]["row"] for r in runs]
        outcomes = np.array([state.lost(r) for r in runs], dtype=bool)
        look = state.looks.get(cell.number)
        seen = look.rate if look is not None and look.rate.runs == len(runs) else rate(outcomes)
        values = [row["guarantees"].get(guarantee, [None])[0] for row in found]
        numbers = np.array([v for v in values if v is not None], dtype=float)
        low = quantile(numbers, 0.05)
        row: dict[str, Any] = {
            "cell": cell.label,
            "parameters": cell.parameters,
            "runs": len(runs),
            "distinct": distinct_results(found),
            "lost": seen.count,
            "rate_low": seen.low,
            "rate_high": seen.high,
            "confidence": seen.confidence,
            "rate_method": Rate.method,
            "refused": sum(r["status"] == REFUSED for r in found),
            "failed": sum(r["status"] == FAILED for r in found),
            "ended_early": sum(r["ended_early"] is not None for r in found),
            "least": float(numbers.min()) if numbers.size else None,
            "quantile_05": [low.value, low.low, low.high],
            "quantile_method": Quantile.method,
            "median": float(np.median(numbers)) if numbers.size else None,
            "decision": str(look.decision) if look is not None else None,
            "against_first": None,
        }
        row |= _arrived(found)
        if (beside := _beside_intruders(guarantee, found)) is not None:
            row["beside_intruders"] = beside
        first = firsts.setdefault(str(cell.parameters.get(AXIS, "")), outcomes)
        if first is not outcomes and (n := min(first.size, outcomes.size)):
            pairs = paired_verdicts(first[:n], outcomes[:n])
            row["against_first"] = {
                "only_first": pairs.only_first,
                "only_this": pairs.only_second,
                "p_value": pairs.p_value,
            }
        rows.append(row)
    return rows


def _arrived(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Of the runs flown: vehicles that arrived, of those with a goal; median of the runs' mean time added.

    Nothing where no vehicle has a goal, or runs were flown before this was counted.
    """
    seen = [row["arrived"] for row in found if row.get("arrived")]
    due = sum(of for _, of, _ in seen)
    if not due:
        return {}
    added = [more for _, _, more in seen if more is not None]
    return {
        "arrived": sum(count for count, _, _ in seen),
        "with_goal": due,
        "time_added_s": float(np.median(added)) if added else None,
    }


def _beside_intruders(guarantee: str, found: list[dict[str, Any]]) -> dict[str, Any] | None:
    """How many runs lost the separation from intruders, and its least value, beside what is counted.

    None where there are no intruders, or that is what is counted.
    """
    name = SEPARATION_INTRUDERS.id
    known = [row["guarantees"][name] for row in found if name in row["guarantees"]]
    if guarantee == name or not known:
        return None
    values = [value for value, _ in known if value is not None]
    lost_ = sum(verdict != Status.HOLDS for _, verdict in known)
    return {"lost": lost_, "least": float(min(values)) if values else None}


def table(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows for a terminal."""

    def number(value: float | None) -> str:
        return "" if value is None else f"{value:.2f}"

    axes = [a for a in rows[0]["parameters"] if len({str(r["parameters"][a]) for r in rows}) > 1]
    shown = []
    for r in rows:
        line = {a.rpartition(".")[2]: str(r["parameters"][a]) for a in axes} or {"cell": r["cell"]}
        interval = f"{100 * r['confidence']:.3g} % interval"
        line |= {
            "lost": f"{r['lost']}/{r['runs']}",
            "distinct": r["distinct"],
            interval: f"{100 * r['rate_low']:.1f}-{100 * r['rate_high']:.1f} %",
            "least": number(r["least"]),
            "median": number(r["median"]),
        }
        if any("with_goal" in q for q in rows):
            line |= {
                "arrived": f"{r['arrived']}/{r['with_goal']}" if "with_goal" in r else "",
                "added [s]": number(r.get("time_added_s")),
            }
        if any("beside_intruders" in q for q in rows):
            beside = r.get("beside_intruders", {"lost": 0, "least": None})
            line |= {"lost to intruders": beside["lost"], "least to them": number(beside["least"])}
        for name in ("refused", "failed"):
            if any(q[name] for q in rows):
                line[name] = r[name]
        if any(q["decision"] for q in rows):
            line["rate is"] = r["decision"] or ""
        if len(rows) > 1:
            pair = r["against_first"]
            line["against first"] = (
                f"{pair['only_this']}:{pair['only_first']}, p {pair['p_value']:.2g}" if pair else ""
            )
        shown.append(line)
    return shown
