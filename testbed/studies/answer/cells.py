"""Makes the scenario of a cell of the answer: fleet, mission, air, remedy and guidance."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from testbed.errors import UserError, nearest
from testbed.scenario.scenario import Scenario, load
from testbed.scenario.variants import changed
from testbed.studies.common.measure import Fields, default_starts

NUMBERS = (2, 20, 50)
UNICYCLE = "unicycle"
# With the printed look-ahead of 1 m straight guidance asks an aircraft for more heading bandwidth than it
# has.
COMMON = ("guidance.lookahead_m=10", "rates.filter_dt_s=0.05", "rates.record_dt_s=1")
# Built-in scenarios differ in their barriers; here all begin with the paper's, and a remedy smooths it.
PAPERS = ("barrier.delta_m2=0.01", "barrier.smoothing_m2=0")
# Random starts have h >= 25 m as unicycles: with 4 m one X8 draw in two begins outside the flow filter's set.
MISSIONS: dict[str, dict[int, tuple[str, ...]]] = {
    "swap": {
        2: ("paper-2-turn", "duration_s=40"),
        20: ("paper-20-turn", "duration_s=120"),
        50: (
            "paper-20-turn", "vehicles=50", "duration_s=60", "start.lateral_perturbation_m=5",
            "start.heading_perturbation_deg=5", "start.height_perturbation_m=1",
        ),
    },
    "streams": {
        2: ("crossing-streams", "vehicles=2", "duration_s=40", "filter.kind=centralised", *PAPERS),
        20: ("crossing-streams", "duration_s=120", *PAPERS),
    },
    "random": {
        20: ("random-goals", "start.start_h_m=25", *PAPERS),
        50: ("random-goals", "start.start_h_m=25", "vehicles=50", "start.square_m=1100", *PAPERS),
    },
}  # fmt: skip
WEATHER: dict[str, Fields] = {
    "calm": {},
    "windy": {"wind.speed_mps": 5.0, "wind.towards_deg": 60.0, "gusts.intensity": "light"},
}
_LAGS_4: Fields = {
    "remedy.predict_lags": True,
    "remedy.ds_buffer_m": 4.0,
    "remedy.smoothing_m2": 30.0,
}
REMEDIES: dict[str, Fields] = {
    "none": {},
    "smoothed": {"remedy.smoothing_m2": 30.0},
    "lags, +0.5 m": {"remedy.predict_lags": True, "remedy.ds_buffer_m": 0.5},
    "lags, +4 m, smoothed": _LAGS_4,
    "lags, +4 m, smoothed, range cost": _LAGS_4 | {"filter.cost": "range"},
    "flow, +2 m": {"filter.kind": "flow", "filter.margin_m": 2.0},
    "flow, +2 m, h kept": {
        "filter.kind": "flow",
        "filter.margin_m": 2.0,
        "filter.h_margin_m": 1.5,
        "filter.kappa": 0.5,
    },
    # Commands change no faster than an aircraft can slow down in a descent of 2 m/s, and follow in a turn.
    "flow, +1 m, h kept, slewed": {
        "filter.kind": "flow",
        "filter.margin_m": 1.0,
        "filter.h_margin_m": 1.0,
        "filter.kappa": 0.5,
        "filter.speed_slew_mps2": 1.0,
        "filter.climb_slew_mps2": 2.0,
    },
    "flow, +2 m, kappa 0.5": {"filter.kind": "flow", "filter.margin_m": 2.0, "filter.kappa": 0.5},
    "lags, +1 m, smoothed, alpha 0.3 h": {
        "remedy.predict_lags": True,
        "remedy.ds_buffer_m": 1.0,
        "remedy.smoothing_m2": 30.0,
        "alpha.kind": "linear",
        "alpha.coefficient": 0.3,
    },
    "0.8 s ahead, +0.5 m": {"remedy.prediction_s": 0.8, "remedy.ds_buffer_m": 0.5},
}
GUIDANCE: dict[str, Fields] = {
    "straight": {},
    "layers": {"guidance.kind": "layers"},
    # Steeper, an aircraft that descends cannot slow down as fast as it was identified to in level flight.
    "evading layers": {
        "guidance.kind": "layers",
        "guidance.evading": True,
        "guidance.goal_offset_m": 12.0,
        "limits.zeta_max_mps": 2.0,
    },
    "roundabout": {"guidance.kind": "roundabout"},
}
# What a unicycle has no use for: it has no lags.
FLOWS = tuple(name for name, fields in REMEDIES.items() if fields.get("filter.kind") == "flow")
OF_AIRCRAFT = (*FLOWS, *(name for name, fields in REMEDIES.items() if "remedy.predict_lags" in fields))
# In wind the flow filter's evading turn must be flyable (F3 of flow.md): at least 12.5 m/s of airspeed, 5 m/s
# of wind, 1 m/s of gusts.
FLYABLE: Fields = {"barrier.v_mps": 19.0}


class Cell(NamedTuple):
    """One setting: its columns in tables, in their order.

    vehicle  "unicycle", or an airframe with its autopilot and sensors, as "x8@px4@typical"
    """

    vehicle: str
    number: int
    mission: str
    weather: str
    remedy: str
    guidance: str

    def named(self) -> dict[str, Any]:
        """Its values by column."""
        return dict(zip(COLUMNS, self, strict=True))

    def __str__(self) -> str:
        return f"{self.number} {self.vehicle}, {self.mission}, {self.weather}; {self.remedy}; {self.guidance}"


COLUMNS = list(Cell.__annotations__)
OPTIONS = {
    "number": "--vehicles",
    "mission": "--missions",
    "weather": "--weather",
    "remedy": "--only",
    "guidance": "--guidance",
}
AXES: Mapping[str, Sequence[Any]] = {
    "number": NUMBERS,
    "mission": tuple(MISSIONS),
    "weather": tuple(WEATHER),
    "remedy": tuple(REMEDIES),
    "guidance": tuple(GUIDANCE),
}


def product(axes: Mapping[str, Sequence[Any]]) -> list[Cell]:
    """Every combination of the values of each of `COLUMNS`, but for those that mean nothing.

    Left out: a mission that is not flown by that number of vehicles, and unicycles in wind or with remedies
    for lags. Raises UserError for a value that an axis does not have, or if nothing is left
    """
    for name, known in AXES.items():
        for value in axes[name]:
            if value not in known:
                choices = [str(k) for k in known]
                raise UserError(f"{OPTIONS[name]} {value!r}: unknown; {nearest(str(value), choices)}")
    order = ("number", "mission", "vehicle", "weather", "remedy", "guidance")
    made = [
        Cell(**dict(zip(order, values, strict=True)))
        for values in itertools.product(*(dict.fromkeys(axes[name]) for name in order))
    ]
    if kept := [cell for cell in made if _means_something(cell)]:
        return kept
    raise UserError(
        f"--missions {axes['mission'][0]}: nothing to fly; 2 vehicles fly swap and streams, 50 swap and"
        " random, and unicycles have neither wind nor lags"
    )


def _means_something(cell: Cell) -> bool:
    if cell.number not in MISSIONS[cell.mission]:
        return False
    return cell.vehicle != UNICYCLE or (cell.weather == "calm" and cell.remedy not in OF_AIRCRAFT)


def scenario(cell: Cell, changes: Sequence[str] = ()) -> Scenario:
    """What the cell flies; `changes` as --set takes them. Raises UserError where it cannot be flown."""
    name, *more = MISSIONS[cell.mission][cell.number]
    base = default_starts(load(name, [*COMMON, *more, *changes]))
    aircraft: Fields = {"plant": "unicycle"}
    if cell.vehicle != UNICYCLE:
        aircraft = {"plant": "jsbsim", "airframes": [cell.vehicle]} | WEATHER[cell.weather]
        if cell.remedy in FLOWS and cell.weather == "windy":
            aircraft |= FLYABLE
    return changed(base, aircraft | GUIDANCE[cell.guidance] | REMEDIES[cell.remedy])


def scenarios(cells: Iterable[Cell], changes: Sequence[str] = ()) -> dict[Cell, Scenario]:
    """The scenarios of the cells, in their order."""
    return {cell: scenario(cell, changes) for cell in cells}
