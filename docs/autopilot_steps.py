"""Makes the table of docs/guide/autopilots.md: steps flown, and what was calculated for the loops alone.

python docs/autopilot_steps.py docs/guide/data/autopilots

Calculated beforehand: roll with one degree of freedom, the vertical plane with three, in which the attitude
follows its command; gains and limits as in the autopilot, throttle of level flight known. Flown: the aircraft
under the autopilot's equations. Flown tight: the same with inner loops that hold the attitude.
"""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from aircraft.airframe import load
from aircraft.airframes.schema import Airframe
from aircraft.autopilots.tuning import fly
from aircraft.equations.catalogue import equations_of
from aircraft.jsbsim.geodesy import G_MPS2

Array = NDArray[np.float64]

V_MPS, OMEGA_RADPS, BAND = 18.0, math.radians(11.7), 0.3
RANGE = {"AIRSPEED_MIN": 12.5, "AIRSPEED_MAX": 30.0, "TRIM_THROTTLE": 32.0}
MAP = {"FW_AIRSPD_MIN": 12.5, "FW_AIRSPD_TRIM": 18.0, "FW_AIRSPD_MAX": 30.0, "FW_THR_TRIM": 0.316}
MAP |= {"FW_THR_ASPD_MIN": 0.239, "FW_THR_ASPD_MAX": 0.62, "FW_T_CLMB_MAX": 8.0, "FW_T_SINK_MIN": 3.0}
TIGHT = {
    "arduplane": {"PTCH_RATE_P": 0.5, "PTCH_RATE_I": 5.0, "RLL_RATE_I": 0.6},
    "px4": {"FW_PR_P": 0.5, "FW_PR_I": 5.0, "FW_PR_FF": 0.417, "FW_RR_I": 0.5},
}
# The step: command (v, omega, zeta), what answers, from, to, share within which it is settled.
STEPS = {
    "turn": ((V_MPS, -OMEGA_RADPS, 0.0), "bank_rad", 0.0, math.atan(V_MPS * OMEGA_RADPS / G_MPS2), 0.05),
    "faster": ((20.0, 0.0, 0.0), "v", V_MPS, 20.0, 0.05),
    "slower": ((16.0, 0.0, 0.0), "v", V_MPS, 16.0, 0.05),
    "climb": ((V_MPS, 0.0, 2.0), "zeta", 0.0, 2.0, 0.1),
}
DURATION_S = 60.0


@dataclass(frozen=True)
class Loops:
    """One set of parameters of an autopilot on the X8.

    parameters  on top of the autopilot's defaults; None for those that the X8's folder has
    calculated  step -> t63 [s], settling [s]; NaN where it was not calculated
    """

    autopilot: str
    parameters: dict[str, float] | None
    calculated: dict[str, tuple[float, float]]

    def airframe(self, tight: bool = False) -> Airframe:
        found = load(f"x8@{self.autopilot}")
        if self.parameters is not None:
            usual = {name: p.default for name, p in equations_of(found).parameters.items()}
            found = found.with_gains(usual | self.parameters)
        return found.with_gains(TIGHT[self.autopilot]) if tight else found


ALL = {
    "ArduPlane, defaults": Loops(
        "arduplane",
        RANGE,
        {"turn": (0.58, 1.2), "faster": (1.2, 15.0), "slower": (3.2, math.nan), "climb": (4.8, 8.0)},
    ),
    "ArduPlane, X8 file": Loops(
        "arduplane",
        None,
        {"turn": (0.38, 0.95), "faster": (1.7, 10.0), "slower": (3.2, math.nan), "climb": (3.0, 6.0)},
    ),
    "PX4, defaults": Loops(
        "px4",
        {"FW_THR_TRIM": 0.316},
        {"turn": (0.53, 1.0), "faster": (3.6, 60.0), "slower": (3.8, math.nan), "climb": (0.7, 16.0)},
    ),
    "PX4, throttle mapped": Loops(
        "px4",
        MAP,
        {"turn": (0.57, 1.1), "faster": (3.4, 21.0), "slower": (3.8, math.nan), "climb": (0.7, 1.0)},
    ),
}


def response(airframe: Airframe, step: str) -> tuple[Array, Array]:
    """Times [s] and the answer to a step, 0 before it and 1 where it should end."""
    command, name, before, after, _ = STEPS[step]
    f = fly(airframe, V_MPS, command, DURATION_S if name != "bank_rad" else 10.0, telemetry=["roll_rad"])
    answer = f.telemetry["roll_rad"] if name == "bank_rad" else getattr(f, name)
    return f.t, (answer - before) / (after - before)


def times(t: Array, share: Array, band: float) -> tuple[float, float]:
    """t63 and settling [s]: when the answer reaches 63 %, and is last outside the band about its end."""
    reached, outside = np.flatnonzero(share >= 0.632), np.flatnonzero(np.abs(share - 1) > band)
    return float(t[reached[0]]) if len(reached) else math.nan, float(t[outside[-1]]) if len(outside) else 0.0


def within(value: float, calculated: float) -> bool:
    """Whether a time is within 30 % of the one calculated, or that is not known."""
    return math.isnan(calculated) or abs(value / calculated - 1) <= BAND


def rows() -> pd.DataFrame:
    made = []
    for name, loops in ALL.items():
        for step, (t63, settling) in loops.calculated.items():
            row: dict[str, object] = {"loops": name, "step": step, "calculated_t63_s": t63}
            row["calculated_settling_s"] = settling
            for kind, tight in (("flown", False), ("tight", True)):
                found = times(*response(loops.airframe(tight), step), STEPS[step][4])
                row |= {f"{kind}_t63_s": round(found[0], 2), f"{kind}_settling_s": round(found[1], 1)}
            made.append(row)
    return pd.DataFrame(made)


def markdown(table: pd.DataFrame) -> str:
    """As the page shows it; what is more than 30 % from the calculation is bold."""

    def cell(row: pd.Series[float], kind: str) -> str:
        parts = []
        for quantity, form in (("t63_s", ".2f"), ("settling_s", ".1f")):
            value, of = row[f"{kind}_{quantity}"], row[f"calculated_{quantity}"]
            text = "" if math.isnan(value) else format(value, form)
            if quantity == "settling_s" and value >= DURATION_S:
                text = f"over {DURATION_S:g}"
            off = kind != "calculated" and not within(min(value, DURATION_S), of)
            parts.append(f"**{text}**" if off and text else text)
        return " | ".join(parts)

    lines = [
        "| loops | step | calculated t63 [s] | settled [s] | flown t63 [s] | settled [s]"
        " | flown tight t63 [s] | settled [s] |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for _, r in table.iterrows():
        lines.append(
            f"| {r.loops} | {r.step} | {cell(r, 'calculated')} | {cell(r, 'flown')} | {cell(r, 'tight')} |"
        )
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    made = rows()
    made.to_csv(Path(sys.argv[1]) / "steps.csv", index=False)
    print(markdown(made), end="")
