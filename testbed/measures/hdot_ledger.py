"""The hdot ledger: predicted against realised hdot, and which channel caused the difference.

Over one filter period a pair's realised hdot is (h' - h) / dt at the true states; the unicycle under the
commands predicts L_g h u. To first order the difference is the sum of these parts, vehicle by vehicle:

    L_g h (rates flown - u)   for v, omega and zeta, the rates averaged over the period,

The turn-rate part is split into the heading's (omega) and what the course turned beyond it (course: sideslip
and crab). What remains is of second order in the period, or comes from the barrier's kink.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from filters.model import Array, Command
from testbed.records.run import Columns, Run

if TYPE_CHECKING:
    import pandas as pd

CHANNELS = ("v", "omega", "zeta", "course")
# Far pairs have large levers and no constraint: their residuals would hide those of the encounter.
NEAR_H_M = 10.0
# Moments of a pair closer than this count as one [s].
APART_S = 0.5


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


def near(run: Run, near_h_m: float = NEAR_H_M) -> pd.DataFrame:
    """The recorded rows of pairs with h below `near_h_m` whose motion since is known."""
    if not len(run.pairs):
        return run.pairs
    return run.pairs[(run.pairs.h_m < near_h_m) & run.pairs.hdot_realised_mps.notna()]


def summary(run: Run, near_h_m: float = NEAR_H_M, worst_moments: int = 5) -> dict[str, Any]:
    """Quantiles of the residual and its parts over recorded pairs with h below `near_h_m`; the worst moments.

    Moments of one pair are at least half a second apart, since neighbouring steps hardly differ.
    """
    pairs = near(run, near_h_m)
    if not len(pairs):
        return {"rows": 0, "near_h_m": near_h_m, "quantiles": {}, "worst": []}
    parts = {name: pairs[f"residual_{name}_mps"] for name in CHANNELS}
    total = pairs.hdot_realised_mps - pairs.hdot_predicted_mps
    series = {"total": total, **parts, "rest": total - sum(parts.values())}
    levels = (0.0, 0.01, 0.05, 0.25, 0.5, 0.75, 0.95, 0.99, 1.0)
    return {
        "rows": len(pairs),
        "near_h_m": near_h_m,
        "quantiles": {
            name: {f"{q:g}": float(v) for q, v in zip(levels, np.quantile(x, levels), strict=True)}
            for name, x in series.items()
        },
        "worst": _worst(pairs.assign(**series), worst_moments),
    }


def _worst(pairs: pd.DataFrame, most: int) -> list[dict[str, Any]]:
    """The moments of least residual, worst first; `pairs` with the columns total, rest and the channels'."""
    found: list[dict[str, Any]] = []
    for row in pairs.sort_values("total", kind="stable").itertuples():
        vehicles, t = [int(row.i), int(row.j)], float(row.t_s)
        if any(m["vehicles"] == vehicles and abs(m["t_s"] - t) < APART_S for m in found):
            continue
        moment = {"t_s": t, "vehicles": vehicles, "h_m": float(row.h_m), "residual_mps": float(row.total)}
        found.append(moment | {name: float(getattr(row, name)) for name in (*CHANNELS, "rest")})
        if len(found) == most:
            break
    return found


def channel_bounds(run: Run, quantile: float = 1.0, near_h_m: float | None = None) -> dict[str, float]:
    """Per-channel bounds on |achieved - commanded|: v [m/s], omega [rad/s], zeta [m/s], at that quantile.

    near_h_m  only of vehicles while they have a pair with h below it; None takes the whole flight
    Robust rows are given these: see `filters.wrappers.row_margins`. Without rows the bounds are nan.
    """
    rows = run.vehicles
    if near_h_m is not None:
        pairs = near(run, near_h_m)
        met = {(t, v) for column in ("i", "j") for t, v in zip(pairs.t_s, pairs[column], strict=True)}
        rows = rows[[moment in met for moment in zip(rows.t_s, rows.vehicle, strict=True)]]
    names = (("v", "mps"), ("omega", "radps"), ("zeta", "mps"))
    if not len(rows):
        return {name: float("nan") for name, _ in names}
    return {
        name: float(np.quantile(np.abs(rows[f"{name}_{unit}"] - rows[f"{name}_command_{unit}"]), quantile))
        for name, unit in names
    }


def robust_settings(bounds: dict[str, float]) -> dict[str, float]:
    """Those bounds as the scenario fields that raise the filter's rows by them."""
    return {
        "remedy.robust_v_mps": bounds["v"],
        "remedy.robust_omega_degps": float(np.degrees(bounds["omega"])),
        "remedy.robust_zeta_mps": bounds["zeta"],
    }
