"""A short search on flown steps: scales the loop gains that the formulas give."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from aircraft.adopt.adopting import Model
from aircraft.adopt.loops import Scales
from aircraft.adopt.scoring import Case, Scored, cases, disk_margins, flown
from aircraft.jsbsim.steady import Trim

Near = Callable[[float], Trim | None]

_OVERSHOOT = {"omega": 0.06, "zeta": 0.07, "v": 0.05}  # what a search is content with
_FINAL = 0.03
_LOOP = {"omega": "aileron", "zeta": "elevator", "v": "throttle"}
_DISK = 0.8  # of the channel's loop: quicker ones are not tried below
_HELD, _MOST_HELD = 0.75, 5  # disk margin of throttle and rudder, and how often their feedback is lowered
_FIRMER = (1.4, 2.0)  # feedback of speed, of what the formula gives
_FASTER, _SLOWER = 1.35, 0.75
_TURNS, _CLIMBS = (1.0, 3.2), (0.35, 1.3)  # of the formulas' bandwidth
_LAGS = (1.0, 2.5, 5.0)  # of the models that errors are taken from, on what the formulas give
_MOST_TRIES = 6
_GAIN = 0.97  # a step that is not this much quicker is as quick as the aircraft is


@dataclass(frozen=True)
class Tried:
    """The scores of one channel's steps with certain scales."""

    scales: Scales
    scored: tuple[Scored, ...]

    @property
    def overshoot(self) -> float:
        return max(s.overshoot for s in self.scored)

    @property
    def error(self) -> float:
        return max(s.final_error for s in self.scored)

    @property
    def t63(self) -> float:
        return max(s.t63 for s in self.scored)

    def good(self, channel: str) -> bool:
        """Whether overshoot and final error are what a search is content with."""
        return self.overshoot <= _OVERSHOOT[channel] and self.error <= _FINAL


def search(model: Model, near: Near, say: Callable[[str], None]) -> Scales:
    """Scales with which turns, climbs and speed are quick and do not overshoot, one after another."""
    scales = Scales()
    if model.controls.rudder is None:
        say("search: the share of side force that bank answers")
        scales = _best(model, "omega", near, [replace(scales, side=x) for x in (0.0, 0.25, 0.5)])
    else:
        say("search: the rudder's feedback")
        scales = _lowered(model, scales, "rudder", "yaw", near)
    say("search: turns")
    scales = _best(model, "omega", near, [replace(scales, turn_lag=x) for x in _LAGS])
    scales = _quicker(model, scales, "omega", "turn", _TURNS, near)
    say("search: climbs")
    scales = _best(model, "zeta", near, [replace(scales, climb_lag=x) for x in _LAGS])
    scales = _quicker(model, scales, "zeta", "climb", _CLIMBS, near)
    say("search: speed")
    scales = _best(model, "v", near, [replace(scales, speed_lag=x) for x in _LAGS])
    scales = _quicker(model, scales, "v", "speed", (0.5, 2.5), near)
    return _held(model, scales, near)


def _held(model: Model, scales: Scales, near: Near) -> Scales:
    """Raise the feedback of speed where steps end beside; lower it for the throttle's disk margin."""
    now = _try(model, scales, "v", near)
    for hold in () if now.good("v") else _FIRMER:
        then = _try(model, replace(scales, hold=hold), "v", near)
        if _cost(then) < _cost(now) and _margin(model, then.scales, "throttle", near) >= _HELD:
            now = then
    return _lowered(model, now.scales, "throttle", "hold", near)


def _lowered(model: Model, scales: Scales, loop: str, name: str, near: Near) -> Scales:
    """Lower a feedback until its loop has the disk margin, while that helps: some are unstable without."""
    margin = _margin(model, scales, loop, near)
    for _ in range(_MOST_HELD):
        if margin >= _HELD:
            break
        lower = replace(scales, **{name: _SLOWER * getattr(scales, name)})
        before, margin = margin, _margin(model, lower, loop, near)
        if margin <= before:
            break
        scales = lower
    return scales


def _steps(model: Model, channel: str) -> list[Case]:
    """The steps of one channel; of climbs and descents the climbs."""
    mine = [c for c in cases(model.airframe) if c.channel == channel]
    return [c for c in mine if c.command[2] > 0] if channel == "zeta" else mine


def _try(model: Model, scales: Scales, channel: str, near: Near) -> Tried:
    airframe = model.with_scales(scales)
    return Tried(scales, tuple(flown(airframe, c, near)[0] for c in _steps(model, channel)))


def _best(model: Model, channel: str, near: Near, options: list[Scales]) -> Scales:
    tried = [_try(model, option, channel, near) for option in options]
    return min(tried, key=_cost).scales


def _quicker(
    model: Model, scales: Scales, channel: str, name: str, ends: tuple[float, float], near: Near
) -> Scales:
    """Raise one bandwidth while steps stay good and get quicker; lower it until they are good."""
    now = _try(model, scales, channel, near)
    tries = 0
    while now.good(channel) and tries < _MOST_TRIES:
        tries += 1
        value = getattr(now.scales, name) * _FASTER
        if value > ends[1]:
            break
        then = _try(model, replace(now.scales, **{name: value}), channel, near)
        if (
            not then.good(channel)
            or then.t63 > _GAIN * now.t63
            or not _robust(model, then.scales, channel, near)
        ):
            break
        now = then
    best = now
    lag = f"{name}_lag"
    while not best.good(channel) and tries < _MOST_TRIES:
        tries += 1
        value = getattr(now.scales, name) * _SLOWER
        if value < ends[0] * 0.4:
            break
        changed: dict[str, float] = {name: value}
        if hasattr(now.scales, lag):
            changed[lag] = getattr(now.scales, lag) * 1.3
        now = _try(model, replace(now.scales, **changed), channel, near)
        if _cost(now) < _cost(best):
            best = now
    return best.scales


def _cost(tried: Tried) -> float:
    """What a search lowers where no scale is good: overshoot and error, and a little the time."""
    if not math.isfinite(tried.t63):
        return math.inf
    return tried.overshoot + tried.error + 0.02 * tried.t63


def _margin(model: Model, scales: Scales, loop: str, near: Near) -> float:
    """The disk margin of a loop, the worse of lowest and highest speed."""
    airframe, s = model.with_scales(scales), model.airframe.speeds
    return min(disk_margins(airframe, (s.v_min_mps, s.v_max_mps), near, loops_=(loop,)).values())


def _robust(model: Model, scales: Scales, channel: str, near: Near) -> bool:
    """Whether the channel's own loop has margin at the lowest speed; the others are still to be searched."""
    v = [model.airframe.speeds.v_min_mps]
    found = disk_margins(model.with_scales(scales), v, near, 8.0, [_LOOP[channel]])
    return min(found.values()) >= _DISK
