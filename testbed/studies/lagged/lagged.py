"""Compares the lagged plant with the aircraft: the head-on encounter from perturbed starts.

python -m testbed.studies.lagged.lagged x8 rascal > docs/guide/data/lagged.csv
"""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.claims.nearest import nearest_approach
from testbed.scenario.scenario import Scenario
from testbed.scenario.variants import changed, load_base
from testbed.simulation.simulate import run
from testbed.studies.common.measure import default_starts

if TYPE_CHECKING:
    import pandas as pd

SETTINGS = (
    "rates.filter_dt_s=0.05",
    "rates.record_dt_s=0.05",
    "checks.manoeuvre_instants=0",
    "duration_s=12",
)
CHANNELS = {"v": ("v_mps", 1.0), "omega": ("omega_radps", 180 / np.pi), "zeta": ("zeta_mps", 1.0)}


def compare(airframe: str, lookahead_m: float, seed: int) -> dict[str, Any]:
    """One start on both plants; seed 0 is the scenario's own, unperturbed.

    The channels' rms differences [m/s, deg/s, m/s] run from the start to the aircraft's closest approach.
    """
    fields = [*SETTINGS, f'airframes=["{airframe}"]', f"guidance.lookahead_m={lookahead_m}"]
    base = load_base("paper-2-turn", fields)
    s = default_starts(base).model_copy(update={"seed": seed}) if seed else base
    aircraft, lagged = (_fly(s, plant) for plant in ("jsbsim", "lagged"))
    until = nearest_approach(aircraft)["t_s"]
    row: dict[str, Any] = {"airframe": airframe, "lookahead_m": lookahead_m, "start": seed}
    row["aircraft_m"] = nearest_approach(aircraft)["value"]
    row["lagged_m"] = nearest_approach(lagged)["value"]
    row["difference_m"] = row["lagged_m"] - row["aircraft_m"]
    one, other = (r.vehicles[r.vehicles.t_s <= until] for r in (aircraft, lagged))
    for name, (column, factor) in CHANNELS.items():
        off = (one[column].to_numpy() - other[column].to_numpy()) * factor
        row[f"{name}_rms"] = float(np.sqrt(np.mean(off**2)))
    return row


def _fly(s: Scenario, plant: str) -> Any:
    return run(changed(s, {"plant": plant}), force=True)


def table(airframes: list[str], starts: range = range(11)) -> pd.DataFrame:
    """Every start of every airframe, with the look-ahead as printed and with 10 m."""
    import pandas as pd

    return pd.DataFrame([compare(a, look, k) for a in airframes for look in (10.0, 1.0) for k in starts])


if __name__ == "__main__":
    table(sys.argv[1:] or ["x8", "rascal"]).to_csv(sys.stdout, index=False, float_format="%.3f")
