"""Time on a machine that others use too: processor time, least of several goes, in bare steps.

A bare step is `run()` of one X8 with its autopilot. What it takes depends on the machine and on who else is
on it, so everything is given as a multiple of bare steps measured in the same process, before and after.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from statistics import median

import numpy as np

from aircraft.airframe import load
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start
from testbed.scenario.scenario import Scenario
from testbed.simulation import simulate

clock = time.process_time


def least(call: Callable[[], object], repeat: int = 30, number: int = 1) -> float:
    """Seconds of one call: the least of `repeat` goes at `number` calls each."""
    best = float("inf")
    for _ in range(repeat):
        began = clock()
        for _ in range(number):
            call()
        best = min(best, clock() - began)
    return best / number


class BareStep:
    """Measures one bare step again and again; `seconds` is the median of the measurements so far."""

    def __init__(self) -> None:
        self.measured: list[float] = []

    def measure(self) -> float:
        """Measure now, on a fresh aircraft: where it lies in memory matters."""
        fdm = Fdm(load("x8"), 0.005, Origin())
        fdm.start(Start(0.0, 0.0, 0.0, 0.0, 20.0))
        now = least(fdm.executive.run, 20, 200)
        self.measured.append(now)
        return now

    @property
    def seconds(self) -> float:
        return median(self.measured)


def in_turn(vehicles: int, periods: int) -> float:
    """Seconds of one `run()` when that many X8s take turns of `periods` each and nothing else happens."""
    airframe, origin = load("x8"), Origin()
    fleet = [Fdm(airframe, 0.005, origin) for _ in range(vehicles)]
    for k, fdm in enumerate(fleet):
        fdm.start(Start(50.0 * k, 0.0, 0.0, 0.0, 20.0))
    steps = [fdm.executive.run for fdm in fleet]

    def turn() -> None:
        for step in steps:
            for _ in range(periods):
                step()

    goes = min(40, max(5, 4000 // vehicles))
    return least(turn, goes, max(1, 20 // periods)) / (vehicles * periods)


@dataclass
class Flight:
    """What a run took, each filter step being the least of the same step over several runs.

    start   s, until the first step: aircraft loaded and trimmed
    steps   s, the filter steps with judging and recording
    finish  s, after the last step: verdicts, files
    bare    s, the bare steps of the run: vehicles times FDM periods; 0 without
    """

    start: float
    steps: float
    finish: float
    bare: float
    filter_steps: int


def flight(s: Scenario, bare: BareStep, place: Path, goes: int = 3) -> Flight:
    """Fly `s` `goes` times into a folder below `place`, with bare steps measured between."""
    starts, stamps, ends = zip(*(_stamps(s, bare, place) for _ in range(goes)), strict=True)
    bare.measure()
    periods = s.filter_steps * s.rates.fdm_steps * s.vehicles
    steps = float(np.min(stamps, axis=0).sum())
    return Flight(min(starts), steps, min(ends), periods * bare.seconds, s.filter_steps)


def _stamps(s: Scenario, bare: BareStep, place: Path) -> tuple[float, np.ndarray, float]:
    """Seconds until the first filter step, of each step, and after the last one, of one run."""
    bare.measure()
    now: list[float] = []
    began = clock()
    simulate.run(s, place / "run", force=True, overwrite=True, progress=lambda t, end: now.append(clock()))
    return now[0] - began, np.diff(now), clock() - now[-1]


@dataclass
class Shares:
    """Seconds spent inside some functions, their insides not counted twice."""

    seconds: dict[str, float] = field(default_factory=dict)
    _inside: list[list[float]] = field(default_factory=list)

    @contextmanager
    def of(self, **methods: tuple[type, str]) -> Iterator[Shares]:
        """Count the methods (class, name) under the keyword's name while the block runs."""
        kept = [(owner, name, owner.__dict__[name]) for owner, name in methods.values()]
        self.seconds = dict.fromkeys(methods, 0.0)
        for label, (owner, name) in methods.items():
            setattr(owner, name, self._counted(label, owner.__dict__[name]))
        try:
            yield self
        finally:
            for owner, name, original in kept:
                setattr(owner, name, original)

    def _counted(self, label: str, function: Callable[..., object]) -> Callable[..., object]:
        def counted(*arguments: object, **named: object) -> object:
            self._inside.append([0.0])
            began = clock()
            try:
                return function(*arguments, **named)
            finally:
                whole = clock() - began
                self.seconds[label] += whole - self._inside.pop()[0]
                if self._inside:
                    self._inside[-1][0] += whole

        return counted
