"""Makes the thinned tables that a page offers beside the figures of a run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from testbed.records.run import Run
from testbed.report import figures, playback

Runs = Mapping[str, Run]
# Rows of each series, and of all paths together.
SERIES_ROWS, PATH_ROWS = 2001, 20_000
# Columns of one vehicle that travel, where a run has them.
SHOWN = (
    *(
        f"{channel}{kind}_{unit}"
        for channel, unit in (("v", "mps"), ("omega", "radps"), ("zeta", "mps"))
        for kind in ("", "_command")
    ),
    "roll_rad",
    "beta_rad",
)


def series(runs: Runs) -> pd.DataFrame:
    """What the panels draw: vehicle 1 and the least distance and h, a row per plant and time, thinned."""
    made = []
    for label, run in runs.items():
        rows = one_vehicle(label, run, 1)
        if len(run.pairs):
            least = run.pairs.groupby("t_s")[["distance_m", "h_m"]].min().add_prefix("least_")
            rows = rows.merge(least, left_on="t_s", right_index=True)
        made.append(rows)
    return pd.concat(made, ignore_index=True)


def one_vehicle(label: str, run: Run, vehicle: int) -> pd.DataFrame:
    """What one vehicle was told and did, and an aircraft's bank and sideslip, at thinned times."""
    rows = figures.one(run, vehicle).reset_index(drop=True)
    kept = _thin(run, rows.t_s.to_numpy(), SERIES_ROWS)
    rows = rows.loc[kept, ["t_s", "vehicle", *(c for c in SHOWN if c in rows)]].round(6)
    rows.insert(0, "plant", label)
    return rows


def paths(runs: Runs) -> pd.DataFrame:
    """Where every vehicle was, thinned to PATH_ROWS in all."""
    made = []
    for label, run in runs.items():
        n = run.manifest["scenario"]["vehicles"]
        t = run.vehicles.t_s.to_numpy()[::n]
        kept = t[_thin(run, t, PATH_ROWS // (n * len(runs)))]
        rows = run.vehicles.loc[run.vehicles.t_s.isin(kept), ["t_s", "vehicle", "x_m", "y_m", "z_m"]].round(4)
        rows.insert(0, "plant", label)
        made.append(rows)
    return pd.concat(made, ignore_index=True)


def _thin(run: Run, t: np.ndarray, most: int) -> np.ndarray:
    return playback.frames(t, max(2, most), [g["t_s"] for g in run.guarantees if g["t_s"] is not None])


def tracking(label: str, run: Run) -> list[dict[str, Any]]:
    """RMS and largest tracking error of each channel over all vehicles, and where the largest was."""
    table, made = run.vehicles, []
    for channel, unit, shown, scale in (
        ("v", "mps", "m/s", 1.0),
        ("omega", "radps", "deg/s", np.degrees(1.0)),
        ("zeta", "mps", "m/s", 1.0),
    ):
        error = scale * (table[f"{channel}_{unit}"] - table[f"{channel}_command_{unit}"]).to_numpy()
        k = int(np.argmax(np.abs(error)))
        made.append(
            {
                "plant": label,
                "channel": f"{channel} [{shown}]",
                "rms": float(np.sqrt(np.mean(error**2))),
                "median": float(np.median(np.abs(error))),
                "largest": float(abs(error[k])),
                "at [s]": float(table.t_s.iloc[k]),
                "vehicle": int(table.vehicle.iloc[k]),
            }
        )
    return made
