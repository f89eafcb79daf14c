"""Measures several airframes or sets of gains alike: each loop's transfer and margins, and steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.airframes.sensors import sensors_of
from aircraft.autopilots.linear_autopilot import loops
from aircraft.autopilots.linear_model import linear_or_none
from aircraft.autopilots.margins import (
    Margins,
    Response,
    margins,
    model_margins,
    model_response,
    response,
)
from aircraft.autopilots.specification import climb_max, climb_rate, steps_of, turn_rate
from aircraft.autopilots.stability import flown_oscillation, unstable_modes
from aircraft.autopilots.tuning import Flight, Score, fly, score
from aircraft.jsbsim.errors import FdmError

FREQUENCY_RADPS = np.geomspace(0.1, 300.0, 400)
# The command whose step shows a loop's work: command channel, group of the step specification.
SHOWN_BY = {
    "elevator": ("zeta", "climb"),
    "aileron": ("omega", "turn"),
    "throttle": ("v", "speed"),
    "rudder": ("omega", "turn"),
}
CHANNELS = ("v", "omega", "zeta")
_SPEED_STEP_MPS, _CLIMB_STEP_MPS = 2.0, 2.0
_DT_S = 0.005


@dataclass(frozen=True)
class Loop:
    """One loop of one airframe at v [m/s], broken at the plant input; None without margins where unstable.

    flown  whether L was measured in flight, in place of the linear model's
    """

    v: float
    transfer: Response
    margins: Margins | None
    flown: bool


@dataclass(frozen=True)
class Answer:
    """A step of one command: from and to, and how the channel follows it."""

    before: float
    after: float
    flight: Flight
    score: Score


@dataclass(frozen=True)
class Compared:
    """One airframe among those that are compared, by the names of its loops and of command channels."""

    airframe: Airframe
    v: float
    unstable: str  # why it is, or nothing
    loops: dict[str, Loop]
    answers: dict[str, Answer]


def compare(
    airframes: Sequence[Airframe],
    v: float | None = None,
    progress: Callable[[str], None] = lambda what: None,
) -> list[Compared]:
    """Every airframe in level flight at v [m/s], by default each at its own start speed, and its steps.

    The step in turn rate is the least that any of them is asked for; that in speed and climb is 2 m/s.
    Raises  ValueError for a speed that one of them is not flown at, FdmError where one cannot fly
    """
    speeds = [a.speeds.start_mps if v is None else v for a in airframes]
    for a, at in zip(airframes, speeds, strict=True):
        if not a.speeds.v_min_mps <= at <= a.speeds.v_max_mps:
            span = f"{a.speeds.v_min_mps:g} to {a.speeds.v_max_mps:g} m/s"
            raise ValueError(f"{a.name} is flown at {span}, not at {at:g} m/s")
    turn = min(turn_rate(a.speeds, at) for a, at in zip(airframes, speeds, strict=True))
    climb = min(_CLIMB_STEP_MPS, *(min(climb_rate(a.speeds), climb_max(a)) for a in airframes))
    lasts = {
        group: max((s.duration for a in airframes for s in steps_of(a) if s.group == group), default=10.0)
        for _, group in SHOWN_BY.values()
    }
    found = []
    for a, at in zip(airframes, speeds, strict=True):
        try:
            progress(f"loops of {a.name} at {at:g} m/s")
            unstable, mine = _loops(a, at)
            progress(f"steps of {a.name}")
            found.append(Compared(a, at, unstable, mine, _answers(a, at, turn, climb, lasts)))
        except FdmError as error:
            raise FdmError(f"{a.name}: {error}; see: testbed aircraft check {a.argument}") from None
    return found


def _answers(
    airframe: Airframe, v: float, turn: float, climb: float, lasts: Mapping[str, float]
) -> dict[str, Answer]:
    """A step in each command from level flight at v [m/s]; lasts [s] by group of the specification."""
    room = v + _SPEED_STEP_MPS <= airframe.speeds.v_max_mps  # else down
    to = v + _SPEED_STEP_MPS if room else v - _SPEED_STEP_MPS
    asked = {"v": (v, to, "speed"), "omega": (0.0, turn, "turn"), "zeta": (0.0, climb, "climb")}
    answers = {}
    for channel, (before, after, group) in asked.items():
        command = [v, 0.0, 0.0]
        command[CHANNELS.index(channel)] = after
        flight = fly(airframe, v, command, lasts[group], _DT_S)
        scored = score(flight.t, getattr(flight, channel), before, after)
        answers[channel] = Answer(before, after, flight, scored)
    return answers


def _loops(airframe: Airframe, v: float) -> tuple[str, dict[str, Loop]]:
    """Why the closed loop is unstable, or nothing, and every loop at v [m/s].

    Behind sensors that are not perfect the loops are measured.
    """
    model = linear_or_none(airframe, v, _DT_S) if sensors_of(airframe.sensors).perfect else None
    modes = [] if model is None else unstable_modes(model, v)
    worst = modes[0] if modes else flown_oscillation(airframe, v, _DT_S)
    found = {}
    for name in loops(airframe):
        # The engine's own lag is not in the linear model.
        if model is None or (name == "throttle" and model.point.engine_lag):
            transfer = response(airframe, v, name, _DT_S)
            at = None if worst else margins(transfer)
            found[name] = Loop(v, transfer, at, flown=True)
        else:
            transfer = model_response(model, name, FREQUENCY_RADPS)
            found[name] = Loop(v, transfer, None if worst else model_margins(model, name), flown=False)
    return str(worst or ""), found


def rows(found: Sequence[Compared]) -> list[dict[str, Any]]:
    """One row for each loop of each airframe: margins, and the score of the step that shows it."""
    made = []
    for c in found:
        for name, loop in c.loops.items():
            channel, _ = SHOWN_BY.get(name, ("", ""))
            row: dict[str, Any] = {"loop": name, "airframe": c.airframe.name, "v_mps": c.v}
            known = loop.margins or Margins(*4 * (float("nan"),))
            row |= {"stable": not c.unstable} | asdict(known)
            row["transfer"] = "flown" if loop.flown else "linear model"
            if channel:
                answer = c.answers[channel]
                row |= {"step": channel, "before": answer.before, "after": answer.after}
                row |= {k: getattr(answer.score, k) for k in ("t63", "overshoot", "settling", "final_error")}
            made.append(row)
    return sorted(made, key=lambda row: list(SHOWN_BY).index(row["loop"]) if row["loop"] in SHOWN_BY else 9)
