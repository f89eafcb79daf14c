"""Load factors found from a record: a flight whose acceleration jumps at the ends, sound and forged."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from testbed.verification.recorded import Recorded
from testbed.verification.telemetry import ATTITUDE, G_MPS2, telemetry

DT = 0.05
# A Rascal told to descend at once: its tail goes down, its lift first up and then away.
JUMP = np.array([0.9994, 1.0871, 0.9966, 0.7343, 0.5330, 0.4055])
STEADY = np.ones(20)


def recorded(load: np.ndarray) -> Recorded:
    """Wings level, due east, nose ahead: the lift alone changes the climb rate, linearly between instants."""
    count = len(load)
    climb = np.concatenate([[0.0], np.cumsum(0.5 * (load[1:] + load[:-1]) - 1.0)]) * DT * G_MPS2
    columns = dict.fromkeys((*ATTITUDE, "theta_rad", "x_m", "y_m", "z_m", "beta_rad"), np.zeros(count))
    columns |= {"v_mps": np.full(count, 20.0), "zeta_mps": climb}
    columns |= {"load_factor": load, "airspeed_mps": np.hypot(20.0, climb)}
    columns |= {"alpha_rad": -np.arctan2(climb, 20.0)}
    rates = {"record_dt_s": DT, "filter_dt_s": DT, "fdm_dt_s": DT}
    scenario: dict[str, Any] = {
        "rates": rates, "plant": "jsbsim",
        "gusts": {"intensity": "none", "sigma_mps": None, "jsbsim_turbulence": "none"},
    }  # fmt: skip
    vehicles = {name: values[:, None] for name, values in columns.items()}
    none = np.zeros(0, dtype=int)
    return Recorded({}, scenario, None, [], DT * np.arange(count), vehicles, {}, none, none, [], {})


def differing(run: Recorded) -> set[str]:
    return {found.what for found in telemetry(run) if found.agrees is False}


def with_load(run: Recorded, row: int, by: float) -> Recorded:
    load = run.vehicles["load_factor"].copy()
    load[row] += by
    return replace(run, vehicles=run.vehicles | {"load_factor": load})


@pytest.mark.parametrize(
    "load", [[*JUMP, *STEADY], [*STEADY, *JUMP[::-1]], [*STEADY, *JUMP, *STEADY], JUMP[:4]]
)
def test_a_load_factor_that_jumps_is_no_error(load: list[float]) -> None:
    assert differing(recorded(np.array(load))) == set()


@pytest.mark.parametrize("row", [0, 1, 4, -1])
def test_a_forged_load_factor_is_found_at_the_ends_too(row: int) -> None:
    starts, ends = recorded(np.array([*JUMP, *STEADY])), recorded(np.array([*STEADY, *JUMP[::-1]]))
    for run in (starts, ends):
        assert differing(with_load(run, row, 0.4)) == {"load_factor"}
    # In steady flight hundredths are found, though the other end of the flight jumps.
    assert differing(with_load(starts, -1, 0.03)) == {"load_factor"}
    assert differing(with_load(ends, 0, 0.03)) == {"load_factor"}


def test_three_instants_do_not_tell_how_the_acceleration_changes() -> None:
    told = {found.what: found.agrees for found in telemetry(recorded(JUMP[:3]))}
    assert told["load_factor"] is None and told["airspeed_mps"]
