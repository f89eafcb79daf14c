"""Whole runs in bare steps, and where their time goes as the number of vehicles grows."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.kinematic import KinematicFleet
from benchmarks.caches import swept
from benchmarks.clock import BareStep, Shares, clock, flight, in_turn
from benchmarks.interval import until_decided
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter
from testbed.records.run import RowWriter
from testbed.scenario import scenario
from testbed.scenario.scenario import Scenario
from testbed.simulation import simulate
from testbed.simulation.recorder import Recorder
from testbed.simulation.step_buffer import StepBuffer

X8 = ["plant=jsbsim", "duration_s=20", "record_dt_s=0.05", "lookahead_m=10", "manoeuvre_instants=0"]
X8 += ["rates.workers=1"]

# name -> (built-in scenario, changes, target in multiples of the run's bare steps)
RUNS: dict[str, tuple[str, list[str], float]] = {
    "20 X8s, filter 20 Hz, limited": ("paper-20-turn", [*X8, "filter_dt_s=0.05"], 1.5),
    "20 X8s, filter 200 Hz, limited": ("paper-20-turn", X8, 3.0),
    "2 X8s, filter 20 Hz, centralised": ("paper-2-turn", [*X8, "filter_dt_s=0.05"], 2.0),
    "2 X8s, filter 200 Hz, centralised": ("paper-2-turn", X8, 8.0),
    "paper-20-turn on unicycles": ("paper-20-turn", ["manoeuvre_instants=0"], 3.0),
}

KINDS = ("FDM", "barrier", "QP", "recording", "rest")


def whole_run(name: str, bare: BareStep, place: Path, goes: int) -> dict[str, Any]:
    """One row: the flight's ratio to its bare steps, and that of the run with start-up and files."""
    source, changes, target = RUNS[name]
    s = scenario.load(source, changes)
    flown = [flight(s, bare, place, goes)]

    def ratio() -> float:
        flown.append(flight(s, bare, place, goes))
        return (flown[-1].steps + flown[-1].finish) / flown[-1].bare

    found, f = until_decided(ratio, target, least=3, most=6), flown[-1]
    periods = s.rates.fdm_steps
    program = flight(_on_unicycles(source, changes), bare, place, 2) if s.plant == "jsbsim" else None
    return {
        "ratio": found.value,
        "interval": [found.low, found.high],
        "count": found.count,
        "with_start": found.value + f.start / f.bare,
        "start_s": f.start,
        "finish_s": f.finish,
        "us_per_filter_step": 1e6 * f.steps / f.filter_steps,
        "vehicle_steps": s.vehicles * s.filter_steps,
        "target": target,
        "in_turn": in_turn(s.vehicles, periods) / bare.seconds if s.plant == "jsbsim" else 0.0,
        "program": 0.0 if program is None else (program.steps + program.finish) / program.bare,
        "swept": swept(s.vehicles, periods) / bare.seconds if s.plant == "jsbsim" else 0.0,
        "parts": {kind: seconds / f.bare for kind, seconds in _parts(s).items()},
    }


def _on_unicycles(source: str, changes: list[str]) -> Scenario:
    """The same flight without aircraft: what it takes is the program's alone, in caches that are its own."""
    return scenario.load(source, [c for c in changes if not c.startswith(("plant=", "rates.workers="))])


def split(vehicles: int, bare: BareStep, duration_s: float) -> dict[str, float]:
    """Bare steps per filter step of X8s that meet on a circle, filter and recording at 20 Hz, by kind."""
    s = scenario.load(
        "paper-20-turn",
        [
            *X8,
            f"duration_s={duration_s}",
            "filter_dt_s=0.05",
            f"vehicles={vehicles}",
            f"start.radius_m={max(200, 4 * vehicles)}",
            "barrier.delta_m2=0",
            "barrier.smoothing_m2=30",
        ],
    )
    bare.measure()
    parts = _parts(s)
    bare.measure()
    unit = bare.seconds * s.filter_steps
    return {"vehicles": vehicles, **{kind: parts[kind] / unit for kind in KINDS}}


def _parts(s: Scenario) -> dict[str, float]:
    """Seconds of one flight by kind; the barrier's are h and its gradient, the QP's the rest of the filter.

    "JSBSim" is the part of "FDM" that the aircraft's own steps take in the flight, positions read.
    """
    stamps: list[float] = []
    shares = Shares()
    with shares.of(
        JSBSim=(Fdm, "run"),
        FDM=(KinematicFleet if s.plant == "unicycle" else JsbsimFleet, "step"),
        barrier=(TurnBarrier, "values"),
        QP=(CollisionFilter, "__call__"),
        recording=(Recorder, "look"),
        gathering=(StepBuffer, "add"),
        writing=(RowWriter, "close"),
    ):
        simulate.run(s, force=True, progress=lambda t, end: stamps.append(clock()))
        whole = clock() - stamps[0]
    seconds = dict(shares.seconds)
    seconds["recording"] += seconds.pop("gathering") + seconds.pop("writing")
    rest = whole - sum(seconds.values())
    return seconds | {"FDM": seconds["FDM"] + seconds["JSBSim"], "rest": rest}


def progress(text: str) -> None:
    """A line on stderr."""
    print(text, file=sys.stderr, flush=True)
