"""Measures how near runs come to the paper's figures as published.

The curves of figure 2 are in `published` beside this module: each vertex is an exact sample of the authors'
run, but the vertices are a thinned subset, so curves are compared there and nowhere else.
"""

from __future__ import annotations

from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.records.run import Run

if TYPE_CHECKING:
    import pandas as pd

DURATION_S = 20.0
SERIES = ("turn", "straight")
# quantity -> (panel, unit, largest error that counts as reproduced)
QUANTITIES = {
    "v": ("2a", "m/s", 1e-4),
    "omega": ("2b", "deg/s", 2e-3),
    "min_distance": ("2c", "m", 1e-3),
    "path": ("2d", "m", 1e-3),
}


def vertices(quantity: str, series: str) -> pd.DataFrame:
    """Published vertices: columns x (s; m for the path) and y (m/s, deg/s or m).

    quantity  a key of QUANTITIES
    series    turn or straight
    """
    import pandas as pd

    with (
        resources.files("testbed.studies.paper") / "published" / f"two_vehicles_{quantity}.csv"
    ).open() as file:
        table = pd.read_csv(file)
    return table[table.series == series].reset_index(drop=True)


def stamp_shift(run: Run) -> float:
    """Seconds by which a published time stamp is early: one step of the authors' simulator.

    They logged after the motion, with the time before it: the sample at t is the state and input of t + dt.
    """
    return float(run.manifest["scenario"]["rates"]["fdm_dt_s"])


def errors(run: Run, quantity: str, series: str) -> np.ndarray:
    """|ours - published| at each vertex that lies within the run; for the path, to its nearest sample."""
    points = vertices(quantity, series)
    one = run.vehicles[run.vehicles.vehicle == 1]
    if quantity == "path":
        if run.manifest["scenario"]["duration_s"] < DURATION_S:
            points = points[points.x <= one.x_m.max()]
        dx = one.x_m.to_numpy()[:, None] - points.x.to_numpy()
        dy = one.y_m.to_numpy()[:, None] - points.y.to_numpy()
        return np.asarray(np.hypot(dx, dy).min(axis=0))
    t, ours = {
        "v": (one.t_s, one.v_command_mps),
        "omega": (one.t_s, np.degrees(one.omega_command_radps)),
        "min_distance": (run.pairs.t_s, run.pairs.distance_m),
    }[quantity]
    t, ours = t.to_numpy(), ours.to_numpy()
    period = t[1] - t[0]
    index = np.round((points.x.to_numpy() + stamp_shift(run)) / period).astype(int)
    # The last stamp of 20 s stands for a sample one step beyond the run.
    inside = index < len(t) + 1
    index = np.minimum(index[inside], len(t) - 1)
    return np.asarray(np.abs(ours[index] - points.y.to_numpy()[inside]))


def table(runs: dict[str, Run]) -> list[dict[str, Any]]:
    """One row per panel of figure 2 and series: vertices compared, largest and mean error, its bound.

    runs  turn and straight -> a finished run of published-2-turn and published-2-straight
    """
    rows = []
    for quantity, (panel, unit, bound) in QUANTITIES.items():
        for series in SERIES:
            error = errors(runs[series], quantity, series)
            rows.append(
                {
                    "panel": panel,
                    "quantity": quantity.removeprefix("min_"),
                    "series": series,
                    "unit": unit,
                    "vertices": int(error.size),
                    "max_error": float(error.max(initial=0.0)),
                    "mean_error": float(error.mean()) if error.size else 0.0,
                    "bound": bound,
                    "within": bool(error.size and error.max() <= bound),
                }
            )
    return rows
