"""Says which cells the answer's page flies, and why those: a stated fraction of all that could be flown.

A base case is varied by one factor at a time; the filter and guidance that keep most are flown in both
weathers, all missions and both aircraft.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from testbed.errors import UserError
from testbed.studies.answer.cells import UNICYCLE, Cell

FIRST_SEED = 2001
NONE, SMOOTHED, LAGS = "none", "smoothed", "lags, +0.5 m"
LAGS_4, RANGE, FLOW = "lags, +4 m, smoothed", "lags, +4 m, smoothed, range cost", "flow, +2 m"
KEPT, FASTER, EVADING = "flow, +2 m, h kept", "flow, +2 m, kappa 0.5", "evading layers"
SLEWED = "flow, +1 m, h kept, slewed"
SENSED = ("x8@typical", "x8@arduplane@typical", "x8@px4@typical")


@dataclass(frozen=True)
class Block:
    """Cells flown for one reason, all from as many seeds."""

    why: str
    seeds: int
    cells: tuple[Cell, ...]


def _cells(
    vehicles: Iterable[str],
    number: int,
    mission: str,
    weather: Iterable[str],
    remedies: Iterable[str],
    guidance: Iterable[str] = ("straight",),
) -> tuple[Cell, ...]:
    return tuple(
        Cell(vehicle, number, mission, air, remedy, way)
        for vehicle in vehicles
        for air in weather
        for remedy in remedies
        for way in guidance
    )


BOTH, AIR, CALM = ("x8", "rascal"), ("calm", "windy"), ("calm",)
DESIGN = (
    Block(
        "Two vehicles, head-on: unicycles, then both aircraft in both weathers under each remedy",
        20,
        (
            *_cells((UNICYCLE,), 2, "swap", CALM, (NONE,)),
            *_cells(BOTH, 2, "swap", AIR, (NONE, LAGS, FLOW)),
        ),
    ),
    Block(
        "Two vehicles that cross at a right angle: the mission alone is changed",
        20,
        _cells(("x8",), 2, "streams", CALM, (NONE, LAGS, FLOW)),
    ),
    Block(
        "Two vehicles with typical sensors under each autopilot: the autopilot alone is changed",
        20,
        _cells((*SENSED, *(name.replace("x8", "rascal") for name in SENSED)), 2, "swap", CALM, (LAGS, FLOW)),
    ),
    Block(
        "Twenty X8s swap places: the base case of fleets, under each remedy with straight guidance",
        5,
        (
            *_cells((UNICYCLE,), 20, "swap", CALM, (NONE,)),
            *_cells(("x8",), 20, "swap", CALM, (NONE, LAGS_4, FLOW)),
        ),
    ),
    Block(
        "The range-weighted cost with the lags remedy, both aircraft",
        10,
        _cells(BOTH, 20, "swap", CALM, (RANGE,)),
    ),
    Block(
        "Guidance alone is changed, under the paper's filter: what it does without a remedy",
        5,
        _cells(("x8",), 20, "swap", CALM, (NONE,), ("layers", "roundabout")),
    ),
    Block(
        "What decides: the flow filter that keeps h as well, in layers, both aircraft, both weathers",
        20,
        _cells(BOTH, 20, "swap", AIR, (KEPT,), (EVADING,)),
    ),
    Block(
        "The flow filter around the ring",
        20,
        _cells(("x8",), 20, "swap", CALM, (FASTER,), ("roundabout",)),
    ),
    Block(
        "Fifty around the ring",
        5,
        _cells(("x8",), 50, "swap", CALM, (FASTER,), ("roundabout",)),
    ),
    Block(
        "Random goals: X8s and Rascals under the flow filter, beside unicycles under the paper's, smoothed",
        20,
        (
            *_cells((UNICYCLE,), 20, "random", CALM, (SMOOTHED,)),
            *_cells(BOTH, 20, "random", CALM, (KEPT,), (EVADING,)),
        ),
    ),
    Block(
        "Random goals, X8s: remedy and guidance changed one at a time",
        5,
        (
            *_cells(("x8",), 20, "random", CALM, (NONE, RANGE, FLOW)),
            *_cells(("x8",), 20, "random", ("windy",), (KEPT,), (EVADING,)),
        ),
    ),
    Block(
        "Two streams of ten cross, X8s",
        5,
        (
            *_cells(("x8",), 20, "streams", CALM, (NONE, RANGE, FLOW)),
            *_cells(("x8",), 20, "streams", CALM, (KEPT,), (EVADING,)),
        ),
    ),
    Block(
        "Twenty with typical sensors under each autopilot",
        5,
        (
            *_cells(SENSED, 20, "swap", CALM, (RANGE,)),
            *_cells(SENSED, 20, "swap", CALM, (KEPT,), (EVADING,)),
        ),
    ),
    Block(
        "Wind, without the flow filter",
        5,
        _cells(("x8",), 20, "swap", ("windy",), (RANGE,)),
    ),
    Block(
        "Random goals under commands that change slowly, both aircraft",
        20,
        _cells(BOTH, 20, "random", CALM, (SLEWED,), (EVADING,)),
    ),
    Block(
        "The same in wind, and where the fleet changes places",
        5,
        (
            *_cells(BOTH, 20, "random", ("windy",), (SLEWED,), (EVADING,)),
            *_cells(BOTH, 20, "swap", CALM, (SLEWED,), (EVADING,)),
        ),
    ),
)
CELLS = {cell: block.seeds for block in DESIGN for cell in block.cells}


def chosen(text: str) -> list[Cell]:
    """The design's cells by number, from 1: "3", "1,4-7". UserError for what is no such number."""
    all_, found = list(CELLS), []
    for part in text.split(","):
        first, _, last = part.strip().partition("-")
        ends = [first, last or first]
        if not all(end.isdecimal() and 1 <= int(end) <= len(all_) for end in ends):
            raise UserError(
                f"--cells {part.strip()}: give numbers from 1 to {len(all_)}, as 3 or 1,4-7; see --list"
            )
        if int(ends[1]) < int(ends[0]):
            raise UserError(f"--cells {part.strip()}: the last number is below the first")
        found += all_[int(ends[0]) - 1 : int(ends[1])]
    return list(dict.fromkeys(found))
