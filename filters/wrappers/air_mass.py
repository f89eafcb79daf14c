"""Lets a filter work in the frame that moves with the air.

Aircraft turn circles in the air, not over the ground, and an evading manoeuvre of constant speed and turn
rate is a circle in one frame only. Seen from the air mass the relative positions are the same, so Ds and h
keep their meaning, and the barrier's turn is one that aircraft fly in any steady wind.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from filters.cbf.problem import Problem, input_set
from filters.filter import Choose, Decision, Declaration, declaration
from filters.model import Array, Command, Limits, State, View


@dataclass(frozen=True)
class AirMass:
    """`filter`, seeing courses and speeds relative to the air; commands are over the ground, in U.

    filter  what chooses airspeed and turn rate
    wind    m/s, the air's motion (2,) or (3,) east, north (and up, not used): one frame for all vehicles;
            or a function of the view that measures it
    Raises  ValueError at a call if the wind is not finite, or not slower than the smallest v of U.

    With v_g e_g = v_a e_a + w and a steady w, at constant airspeed
        v_g^2   = (v_a + w_along)^2 + w_across^2        w_along, w_across: along and left of e_a
        omega_g = omega_a v_a (v_a + w_along) / v_g^2   =: omega_a / k(v_a)
    and climb rates, heights and relative positions are equal (the frame moves level). The filter sees the
    direction of e_a for theta and the airspeed for v. At the measured e_a both relations map v and omega of
    nominal commands into the air's frame and those chosen back. U bounds ground commands: airspeeds between
    the images of v_min and v_max map into it exactly; turn rates are kept to omega_max times the smallest k
    in between, which is conservative. Hence the clip to U at the end only removes round-off; and gamma,
    flown relative to the air, may lie outside that set (its ground speed varies by the wind): then the
    premise is not met, and some QPs may have no solution. A nominal speed below 0 (a goal behind) stays
    below 0; one below the slowest possible in that crosswind becomes the slowest possible.
    """

    filter: Choose
    wind: ArrayLike | Callable[[View], ArrayLike]

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        wind = self._wind(view, limits)
        seen = _through_air(view, wind)
        drift = wind * np.exp(-1j * seen.own().state.theta)
        lower, upper = limits.lower, limits.upper
        v_min, v_max = (_airspeed(np.asarray(v), drift) for v in (lower.v, upper.v))
        omega = limits.omega_max * _smallest_ratio(v_min, v_max, drift)
        box = Limits(v_min, v_max, omega, limits.zeta_max)

        target, low, high = input_set(view, nominal, limits)
        wanted = _airspeed(nominal.v, drift)
        ratio = _ratio(np.clip(wanted, v_min, v_max), drift)
        chosen = self.filter(seen, Command(wanted, nominal.omega * ratio, nominal.zeta), box)

        c = chosen.command
        ground = np.stack([np.hypot(c.v + drift.real, drift.imag), c.omega / _ratio(c.v, drift), c.zeta], -1)
        return Problem(target, low, high).decision(
            np.clip(ground, low, high),
            chosen.status,
            chosen.residual,
            chosen.pairs,
            chosen.hdot_predicted,
        )

    @property
    def declaration(self) -> Declaration:
        """That of the wrapped filter, without barrier and constraints.

        Its h is that of courses relative to the air, and its rows bind airspeeds, not the commands over the
        ground.
        """
        return replace(declaration(self.filter), barrier=None, constraints=None)

    def _wind(self, view: View, limits: Limits) -> complex:
        value = np.asarray(self.wind(view) if callable(self.wind) else self.wind, dtype=float)
        if value.shape not in ((2,), (3,)) or not np.isfinite(value).all():
            raise ValueError(f"one finite wind, east and north, for the frame of all vehicles; got {value}")
        if not np.hypot(value[0], value[1]) < np.min(limits.v_min):
            raise ValueError(
                f"a wind of {np.hypot(value[0], value[1]):g} m/s is not slower than v_min"
                f" {np.min(limits.v_min):g} m/s: there is no airspeed for every ground speed in the limits"
            )
        return complex(value[0], value[1])


def _through_air(view: View, wind: complex) -> View:
    """Courses, speeds and turn rates relative to the air, of any shape; exactly the same without wind."""
    state, rates = view.state, view.rates
    w = wind * np.exp(-1j * state.theta)
    ahead, left = rates.v - w.real, -w.imag
    turned = np.arctan2(left, ahead)
    # At constant airspeed the component of the turn along the ground's normal is what shows over the ground.
    across = np.where(ahead > 0, ahead, np.inf)
    omega = np.where(w == 0, rates.omega, rates.omega * rates.v / across)
    return view.altered(
        State(state.x, state.y, state.theta + turned, state.z),
        Command(np.hypot(ahead, left), omega, rates.zeta),
    )


def _airspeed(v_ground: Array, drift: Array) -> Array:
    """The airspeed along e_a that gives a ground speed; `drift` is the wind along and left of e_a."""
    forward = np.sqrt(np.maximum(v_ground**2 - drift.imag**2, 0.0))
    return np.asarray(np.copysign(forward, v_ground) - drift.real)


def _ratio(v: Array, drift: Array) -> Array:
    """k = omega_a / omega_g at airspeeds v."""
    ahead = v + drift.real
    return np.asarray((ahead**2 + drift.imag**2) / (v * ahead))


def _smallest_ratio(v_min: Array, v_max: Array, drift: Array) -> Array:
    """The smallest k over airspeeds in [v_min, v_max]."""
    # dk/dv = 0 where w_along v^2 + 2 w^2 v + w^2 w_along = 0; into a headwind the larger root is a minimum.
    w = np.abs(drift)
    headwind = np.where(drift.real < 0, -drift.real, np.inf)
    lowest = np.clip(w * (w + np.abs(drift.imag)) / headwind, v_min, v_max)
    return np.asarray(np.minimum.reduce([_ratio(v, drift) for v in (v_min, v_max, lowest)]))
