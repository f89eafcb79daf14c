"""Checks the wind columns against the scenario, and determines the wind in which each vehicle was flown."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import radians

import numpy as np

from testbed.verification.finding import Finding, compared
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario

COLUMNS = ("wind_east_mps", "wind_north_mps", "wind_up_mps")
# Of the shared origin above the ground [m].
HEIGHT_M = 300.0
SIGMA_MPS = {"none": 0.0, "light": 0.77, "moderate": 1.54, "severe": 2.32}
# Gusts are sums of many waves: of a normal quantity so many standard deviations are never seen.
MOST_SIGMA = 7.0
# The wind is held over a filter period, or over so long of a longer one [s].
HELD_S = 0.05 + 1e-9
ROUNDING = 1e-9


@dataclass(frozen=True)
class FlownIn:
    """The wind over the step that led to each instant: velocity (T, N, 3) m/s, within off (T, N) m/s."""

    velocity: Array
    off: Array


def wind(run: Recorded) -> Iterator[Finding]:
    """The recorded wind is the scenario's: exactly where it is steady, within its spread where it gusts."""
    if "disturbance" in run.parts:
        return
    said, s = recorded(run), run.scenario
    if said is None:
        if not blows(s):
            yield Finding("wind", "not recorded", "still air", True)
        return
    off = np.linalg.norm(said - steady(s, run.position[..., 2]), axis=-1)
    sigma = spread(s)
    if sigma:
        within = np.sqrt(3.0) * MOST_SIGMA * sigma
        good = bool((off <= within).all())
        why = "gusts are not computed again" if good else f"{off.max():.3g} m/s from the steady wind"
        own = f"{off.max():.2g} off"
        yield Finding("wind", f"{said.size} values", own, None if good else False, within, why)
        return
    yield compared("wind", off, np.zeros_like(off), ROUNDING * (1.0 + np.abs(said).max()))


def blows(s: Scenario) -> bool:
    """Whether the scenario's air moves, and its motion is recorded."""
    w = s["wind"]
    return bool(w["speed_mps"] or w["updraft_mps"] or w["shear_per_s"] or spread(s))


def spread(s: Scenario) -> float:
    """Standard deviation of each component of the gusts [m/s]; JSBSim's own are not recorded."""
    g = s["gusts"]
    return float(SIGMA_MPS[g["intensity"]] if g["sigma_mps"] is None else g["sigma_mps"])


def all_gusts(s: Scenario) -> float:
    """Standard deviation of each component of the gusts, JSBSim's own included [m/s]."""
    return spread(s) + SIGMA_MPS[s["gusts"]["jsbsim_turbulence"]]


def steady(s: Scenario, z: Array) -> Array:
    """The steady wind (..., 3) m/s east, north, up at heights z (...) m above the origin."""
    w = s["wind"]
    level = np.full(z.shape, float(w["speed_mps"]))
    if w["shear_exponent"]:
        level = level * np.maximum((HEIGHT_M + z) / HEIGHT_M, 0.0) ** w["shear_exponent"]
    level = level + w["shear_per_s"] * z
    towards = radians(w["towards_deg"])
    up = np.full(z.shape, float(w["updraft_mps"]))
    return np.stack([level * np.cos(towards), level * np.sin(towards), up], axis=-1)


def recorded(run: Recorded) -> Array | None:
    """The wind columns (T, N, 3) m/s; None if they are not there."""
    if not all(name in run.vehicles for name in COLUMNS):
        return None
    return np.stack([run.vehicles[name] for name in COLUMNS], axis=-1)


def flown_in(run: Recorded) -> FlownIn | None:
    """What the vehicles were flown in until each recorded instant; None if the record does not tell."""
    s = run.scenario
    if s["gusts"]["jsbsim_turbulence"] != "none":
        return None
    now = recorded(run)
    if now is None:
        return FlownIn(np.zeros_like(run.position), np.zeros(run.position.shape[:2]))
    if run.complete and s["rates"]["filter_dt_s"] <= HELD_S:
        # The start was trimmed for the wind there.
        return FlownIn(np.concatenate([now[:1], now[:-1]]), np.zeros(now.shape[:2]))
    if "disturbance" in run.parts or spread(s):
        return None
    # Steady: what a step's climb changes of it.
    climbed = np.abs(run.vehicles["zeta_mps"]) * HELD_S + 0.1
    per_metre = np.linalg.norm(steady(s, run.position[..., 2] + 1.0) - now, axis=-1)
    return FlownIn(now, 2.0 * climbed * per_metre)
