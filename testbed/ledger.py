"""The ledger: predicted against realised hdot, and which channel the difference came through.

Over one filter period a pair's realised hdot is (h' - h) / dt at the true states; the unicycle under the
commands predicts L_g h u. The difference is laid to the channels to first order, vehicle by vehicle:

    L_g h (rates flown - u)   for v, omega and zeta, the rates averaged over the period,

the turn-rate part once more into what the heading did (omega) and what the course did beyond it (course:
sideslip and crab). The rest is of second order in the period, or the barrier's kink.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.unicycle import Array, Command
from testbed.record import Columns, Run

CHANNELS = ("v", "omega", "zeta", "course")


def residuals(
    lie: tuple[Array, Array],
    i: np.ndarray,
    j: np.ndarray,
    command: Command,
    before: Command,
    after: Command,
    drift: Array,
) -> Columns:
    """The residual of each pair by channel, m/s (P,) each.

    lie            L_g h of vehicles i and j, each (P, 3), at the start of the period
    command        flown over the period (N,)
    before, after  rates achieved at its two ends (N,)
    drift          (N,) rad/s, mean rate of course minus heading over the period; 0 where there is no heading
    """
    error = 0.5 * (before.array() + after.array()) - command.array()
    by = np.concatenate([error, drift[:, None]], axis=-1)
    by[:, 1] -= drift
    parts = {}
    for k, name in enumerate(CHANNELS):
        column = 1 if name == "course" else k
        parts[f"residual_{name}_mps"] = lie[0][:, column] * by[i, k] + lie[1][:, column] * by[j, k]
    return parts


def summary(run: Run, near_h_m: float = 50.0) -> dict[str, Any]:
    """Quantiles of the residual and its parts over recorded pairs with h below `near_h_m`, and worst moments.

    near_h_m  far pairs have large levers and no constraint: they would drown the encounter
    """
    pairs = run.pairs
    pairs = pairs[(pairs.h_m < near_h_m) & pairs.hdot_realised_mps.notna()]
    if not len(pairs):
        return {"rows": 0, "near_h_m": near_h_m, "quantiles": {}, "worst": []}
    parts = {name: pairs[f"residual_{name}_mps"] for name in CHANNELS}
    total = pairs.hdot_realised_mps - pairs.hdot_predicted_mps
    series = {"total": total, **parts, "rest": total - sum(parts.values())}
    levels = (0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
    worst = pairs.assign(total=total).nsmallest(5, "total")
    return {
        "rows": len(pairs),
        "near_h_m": near_h_m,
        "quantiles": {
            name: {f"{q:g}": float(v) for q, v in zip(levels, np.quantile(x, levels), strict=True)}
            for name, x in series.items()
        },
        "worst": [
            {
                "t_s": float(row.t_s),
                "vehicles": [int(row.i), int(row.j)],
                "h_m": float(row.h_m),
                "residual_mps": float(row.total),
                **{name: float(getattr(row, f"residual_{name}_mps")) for name in CHANNELS},
            }
            for row in worst.itertuples()
        ],
    }


def channel_bounds(run: Run, quantile: float = 1.0) -> dict[str, float]:
    """Per-channel bounds on |achieved - commanded|: v [m/s], omega [rad/s], zeta [m/s], at that quantile.

    What robust rows need to be told: see `filters.robust`.
    """
    rows = run.vehicles
    return {
        name: float(np.quantile(np.abs(rows[f"{name}_{unit}"] - rows[f"{name}_command_{unit}"]), quantile))
        for name, unit in (("v", "mps"), ("omega", "radps"), ("zeta", "mps"))
    }
