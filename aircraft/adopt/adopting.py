"""Adopts a model in stages: copy, controls, speeds, derivatives, thrust, gains, search, files, verdict."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from aircraft.adopt.controls import Controls, find_controls, has_rudder, thrust_lag
from aircraft.adopt.copying import Copy, safe_copy
from aircraft.adopt.derivatives import Local, differentiate
from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.feedforward import KNOTS, airframe_gains, level_gains, thrust_gains
from aircraft.adopt.kinds import only_winged
from aircraft.adopt.loops import Scales, Times, envelope_gains, loop_gains, times
from aircraft.adopt.rig import Rig
from aircraft.adopt.skeleton import skeleton
from aircraft.adopt.source import find
from aircraft.adopt.speeds import Found, find_speeds, rounded
from aircraft.adopt.thrust import BEFORE_AFTERBURNER, Thrust, idle, measure_thrust
from aircraft.airframes.references import MISSING
from aircraft.airframes.schema import Airframe
from aircraft.airframes.setup import Engines, Setup, is_property
from aircraft.autopilots.specification import BANK_TAN, CLIMB, TURN
from aircraft.jsbsim.errors import FdmError, UnresolvedError
from aircraft.jsbsim.geodesy import G_MPS2

Say = Callable[[str], None]

_CLIMB_SHARE = 0.6  # of the climb rate that full throttle gives
_SINK_SHARE = 0.8
_SPEED_STEP = 4.0  # m/s, of an aircraft that flies at 15 to 25 m/s; at most what
_SPEEDING_S = 3.5  # of full throttle, and of idle, change
_FILTERS = frozenset(
    ("lag_filter", "lead_lag_filter", "washout_filter", "second_order_filter", "integrator", "pid")
)


@dataclass(frozen=True)
class Model:
    """What the stages have found of a model."""

    copy: Copy
    airframe: Airframe  # with the gains found
    controls: Controls
    found: Found
    locals_: tuple[Local, ...]
    times: Times
    notes: tuple[str, ...]

    def with_scales(self, scales: Scales) -> Airframe:
        """The airframe with loop gains scaled."""
        gains = dict(self.airframe.gains)
        gains |= loop_gains(self.times, self.locals_, self.controls, gains["airframe"], scales)
        return self.airframe.model_copy(update={"gains": gains})


def examine(name_or_path: str, folder: Path, say: Say) -> Model:
    """Copy a model to `folder` and find what the autopilot needs of it. Raises AdoptionError."""
    say("files: copying the model and making it safe")
    source = find(name_or_path)
    copy = safe_copy(source, folder.name)
    only_winged(copy)
    folder.mkdir(parents=True, exist_ok=True)
    copy.write(folder)
    setup = Setup(
        gear=0.0 if copy.retracts else None,
        flaps=None,
        fuel_freeze=True,
        captive=_has_filters(copy),
    )
    full = BEFORE_AFTERBURNER if _augmented(copy) else 1.0
    engines = Engines(count=copy.engine_count, mixture=1.0, propeller=1.0, idle=0.0, full=full)
    notes = list(copy.notes)
    if full < 1.0:
        notes.append("its afterburner is left out: throttle up to 0.98")
    say("loading: the model in JSBSim")
    try:
        rig = Rig(_loaded(copy, skeleton(folder, folder.name, setup, engines, rudder=True), notes))
        rudder = has_rudder(rig)
        if not rudder:
            rig = Rig(skeleton(folder, folder.name, setup, engines, rudder=False))
        say("speeds: stall, and level flight from the slowest up")
        found = find_speeds(rig)
        middle = found.near((found.lowest + found.highest) / 2)
        say("controls: surfaces, signs, travels and lags")
        held = rig.at(middle)
        controls = find_controls(rig, held)
        least = idle(rig, rig.at(middle))
        if least > 0:
            notes.append(f"its engines stop below throttle {least:g}: that is its idle")
            engines = engines.model_copy(update={"idle": least})
        airframe = skeleton(
            folder, folder.name, setup, engines, rudder=rudder and controls.rudder is not None
        )
        rig = Rig(airframe)
        say("derivatives: differentiating the model at level flights")
        locals_, thrusts = [], []
        for v in np.linspace(found.lowest, min(found.highest * 1.03, found.top), KNOTS).tolist():
            trim = rig.trim(v, found.near(v))
            locals_.append(differentiate(rig, rig.at(trim), trim, controls))
            held = rig.at(trim)
            thrusts.append(measure_thrust(held, locals_[-1].drag, engines))
        say("thrust: how quickly it follows the throttle")
        lag = thrust_lag(rig.at(locals_[KNOTS // 2].trim))
    except FdmError as error:
        raise AdoptionError(
            "loading" if "locals_" not in locals() else "derivatives", _plain(error, folder)
        ) from None
    base = airframe_gains(rig, locals_, controls)
    level = level_gains(locals_, controls, base)
    gains = {
        "airframe": base,
        "level": level,
        "thrust": thrust_gains(thrusts, engines),
        "envelope": envelope_gains(found, locals_, base, level),
    }
    t = times(locals_, controls, lag)
    gains |= loop_gains(t, locals_, controls, base, Scales())
    _finite(gains)
    speeds = rounded(found).model_copy(update=_rates(found, locals_, thrusts))
    made = airframe.model_copy(
        update={
            "gains": gains,
            "speeds": speeds,
            "surfaces": controls.surfaces(),
            "title": copy.about.get("description", folder.name)[:100] or folder.name,
        }
    )
    said = (*notes, *found.notes, *controls.notes)
    return Model(copy, made, controls, found, tuple(locals_), t, said)


def _loaded(copy: Copy, airframe: Airframe, notes: list[str]) -> Airframe:
    """The airframe, with properties declared that the model reads and nobody makes."""
    from aircraft.jsbsim.loading import load

    try:
        load(airframe, 0.005)
    except UnresolvedError as error:
        missing = sorted({f.message.removeprefix(MISSING) for f in error.findings})
        odd = [name for name in missing if not is_property(name)]
        if odd:
            raise AdoptionError("loading", f"JSBSim cannot read the property name {odd[0]!r}") from None
        copy.declare(missing)
        copy.write(airframe.folder)
        notes.append(f"declared as 0, for nobody makes them: {', '.join(missing)}")
        try:
            load(airframe, 0.005)
        except FdmError as again:
            raise AdoptionError("loading", _plain(again, airframe.folder)) from None
    except FdmError as error:
        raise AdoptionError("loading", _plain(error, airframe.folder)) from None
    return airframe


def _plain(error: Exception, folder: Path) -> str:
    return " ".join(str(error).replace(f"{folder.resolve()}/", "").split())


def _has_filters(copy: Copy) -> bool:
    """Whether the model's own flight control has components that keep a state."""
    trees = (copy.model, *copy.systems.values())
    return any(e.name in _FILTERS for tree in trees for e in tree.walk())


def _augmented(copy: Copy) -> bool:
    trees = (copy.model, *copy.engines.values())
    return any(e.name == "augmented" and e.text.strip() == "1" for tree in trees for e in tree.walk())


def _finite(gains: dict[str, dict[str, float]]) -> None:
    for section, values in gains.items():
        for name, value in values.items():
            values[name] = value = float(value)
            if not math.isfinite(value):
                raise AdoptionError("gains", f"gains.{section}.{name} is {value}: a derivative is missing")


def _rates(found: Found, locals_: list[Local], thrusts: list[Thrust]) -> dict[str, float]:
    """Climb and turn rates and changes of speed of the steps, which thrust, drag and wing sustain."""
    rates = []
    for x, thrust in zip(locals_, thrusts, strict=True):
        up = (thrust.most - x.drag) * x.v / G_MPS2 * _CLIMB_SHARE
        down = (x.drag - thrust.least) * x.v / G_MPS2 * _SINK_SHARE
        rates += [up, down]
    climb = min(*rates, CLIMB * max(1.0, found.lowest / 20.0))
    load = (found.lowest / found.stall) ** 2 * 0.85
    bank_tan = min(BANK_TAN, math.sqrt(max(load**2 - 1.0, 0.01)) * 0.8)
    turn = min(TURN, bank_tan * G_MPS2 / found.lowest)
    middle = KNOTS // 2
    gains = [thrust.most - x.drag for x, thrust in list(zip(locals_, thrusts, strict=True))[: middle + 1]]
    slows = locals_[middle].drag - thrusts[middle].least
    step = min(_SPEEDING_S * min(*gains, slows), _SPEED_STEP * max(1.0, found.lowest / 15.0))
    return {
        "climb_mps": max(round(climb, 2), 0.1),
        "turn_radps": round(turn, 4),
        "step_mps": max(round(step, 2), 0.2),
    }
