"""Describes a swept gain, and measures one set of gains: step scores, margins and the guarantee."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import SAFE_SET
from testbed.errors import UserError

if TYPE_CHECKING:
    from aircraft.airframes.schema import Airframe
    from aircraft.autopilots.specification import Row

SWEPT_GROUPS = ("turn", "speed", "climb", "all", "margins")
MOST_POINTS = 1000


@dataclass(frozen=True)
class Sweep:
    """One gain, section.name, and the values it takes."""

    gain: str
    values: tuple[float, ...]

    @classmethod
    def parse(cls, text: str, airframe: Airframe) -> Sweep:
        """From GAIN=FROM:TO:COUNT, factors in equal ratios, or GAIN=FROM:TO:COUNT:abs, values in equal steps.

        Ranges of an autopilot's parameters, such as RLL2SRV_TCONST, are values.
        Raises  UserError naming what is wrong with `text`
        """
        from aircraft.autopilots.gains import resolve

        name, _, numbers = text.partition("=")
        parts = numbers.split(":")
        absolute = parts[3:] == ["abs"]
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
            if len(parts) > 3 and not absolute:
                raise ValueError
        except (ValueError, IndexError):
            example = "turn.bandwidth=0.5:2:9 (factors), turn.bandwidth=5:15:9:abs (values)"
            raise UserError(f"--sweep {text}: write GAIN=FROM:TO:COUNT, such as {example}") from None
        if not (math.isfinite(low) and math.isfinite(high) and 1 <= count <= MOST_POINTS):
            raise UserError(f"--sweep {text}: finite ends, and 1 to {MOST_POINTS} points")
        try:
            gain = resolve(airframe, name.strip())
        except ValueError as error:
            raise UserError(f"--sweep {text}: {error}") from None
        if absolute or gain in airframe.parameters:
            return cls(gain, tuple(np.linspace(low, high, count).tolist()))
        if not (low > 0 and high > 0):
            raise UserError(f"--sweep {text}: factors must be above 0; for values append :abs")
        own = airframe.gain(gain)
        return cls(gain, tuple((own * np.geomspace(low, high, count)).tolist()))


@dataclass(frozen=True)
class Point:
    """One set of gains to fly: on which airframe, and the scenario, if any, as its resolved fields."""

    airframe: str
    gains: tuple[tuple[str, float], ...]
    scenario: str | None  # JSON
    file: Path | None  # the gains file that the scenario's aircraft fly

    @property
    def key(self) -> str:
        return json.dumps([self.gains, self.scenario])


def measure(point: Point) -> dict[str, Any]:
    """Step scores, margins and, with a scenario, the guarantee at one point; NaN where it cannot fly."""
    from aircraft.airframe import load
    from aircraft.autopilots.specification import evaluate
    from aircraft.jsbsim.errors import FdmError

    airframe = load(point.airframe).with_gains(dict(point.gains))
    row: dict[str, Any] = dict(point.gains)
    try:
        row |= summary(evaluate(airframe, SWEPT_GROUPS))
    except FdmError as error:
        row |= {"fault": str(error)}
    if point.scenario is not None:
        row |= _guarantee(point)
    return row


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """The specification in a line: the worst of each quantity, and how many bounds are missed."""

    def worst(group: str, quantity: str, lowest: bool = False) -> float:
        values = [r.value for r in rows if r.group == group and r.quantity == quantity]
        # a NaN is a response that never got there
        return float((np.min if lowest else np.max)(values)) if values else math.nan

    return {
        "missed": sum(not r.met for r in rows),
        "omega_t63_s": worst("turn", "t63_s"),
        "omega_overshoot": worst("turn", "overshoot"),
        "omega_overshoot_combined": worst("all", "omega_overshoot"),
        "altitude_change_m": worst("turn", "altitude_change_m"),
        "v_settling_s": worst("speed", "settling_s"),
        "v_t63_s": worst("speed", "t63_s"),
        "v_overshoot": worst("speed", "overshoot"),
        "zeta_t63_s": worst("climb", "t63_s"),
        "zeta_overshoot": worst("climb", "overshoot"),
        "gain_margin_db": worst("margins", "gain_db", lowest=True),
        "phase_margin_deg": worst("margins", "phase_deg", lowest=True),
        "disk_margin": worst("margins", "disk", lowest=True),
    }


def _guarantee(point: Point) -> dict[str, Any]:
    from testbed.scenario.scenario import parse
    from testbed.simulation.simulate import run

    s = parse(json.loads(point.scenario or "{}"))
    try:
        done = run(s)
    except UserError as error:
        return {"min_distance_m": math.nan, "min_h_m": math.nan, "fault": str(error)}
    separation, safe = nearest_approach(done), done.guarantee(SAFE_SET.id)
    return {
        "min_distance_m": separation["value"],
        "min_h_m": safe["value"],
        "ended_early": done.manifest.get("ended_early") or "",
    }
