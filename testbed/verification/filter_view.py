"""Works out the poses that the filter saw: true, late or predicted ones, or unknown."""

from __future__ import annotations

import tomllib
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from testbed.verification import fleet
from testbed.verification.future import Pose, manoeuvre
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import CENTRAL, Scenario, arc, errs, filters_own

USUAL = ("inverting", "perfect")  # the autopilot and the sensors that no name says
AIRFRAMES = Path(__file__).parents[2] / "aircraft" / "airframes"
# A lagged vehicle is flown on for so many of its longest time constants, in so many steps.
TAIL, STEPS = 20.0, 400
# A table's time constants where it gives none [s].
TABLE = {"v": 1.0, "omega": 0.35, "zeta": 0.3}


def filter_view(run: Recorded) -> Pose | str:
    """Poses (T, N) whose rows the filter solved, by what each vehicle knows of itself; or why unknown."""
    s = run.scenario
    measured, link, remedy = s["sensing"], s["network"], s["remedy"]
    if set(run.parts) & {"filter", "disturbance"}:
        return "the filter or the disturbance was not the scenario's"
    if errs(measured):
        return "the filter saw measured poses, which are not recorded"
    if remedy["air_mass"]:
        return "the filter saw the vehicles from the moving air"
    central = s["filter"]["kind"] in CENTRAL
    late = measured["delay_s"] + (link["latency_s"] if central else 0.0)
    if (central and link["loss"]) or (late and link["stale"] == "extrapolate"):
        return "the filter saw poses carried on over lost packets"
    pose, rates = Pose(run.position, run.vehicles["theta_rad"]), run.rates
    if late and fleet.strangers(s):
        return "the filter saw late rates of intruders"
    if late:
        if not run.complete:
            return "the filter saw poses of instants that are not recorded"
        pose, rates = _late(pose, rates, late, s["rates"]["filter_dt_s"])
    if remedy["predict_lags"]:
        known = lags(s)
        if known is None:
            return "the lags predicted are not to be found"
        return _settled(s, pose, rates, known[..., :2])
    return arc(pose, rates, remedy["prediction_s"]) if remedy["prediction_s"] else pose


def _late(pose: Pose, rates: Array, age: float, dt: float) -> tuple[Pose, Array]:
    """Poses and rates `age` s earlier, straight between recorded ones; before the first, flown back."""
    steps = np.arange(len(rates)) - age / dt
    first = np.floor(steps + 1e-9).astype(int)
    share = np.maximum(steps - first, 0.0)
    low, high = np.maximum(first, 0), np.clip(first + (share > 1e-9), 0, len(rates) - 1)

    def at(values: Array) -> Array:
        between = share.reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(values[low] * (1.0 - between) + values[high] * between)

    position, theta, known = at(pose.position), at(pose.theta), at(rates)
    before = steps < -1e-9
    back = arc(Pose(pose.position[0], pose.theta[0]), rates[0], np.minimum(steps, 0.0)[before, None] * dt)
    position[before], theta[before], known[before] = back.position, back.theta, rates[0]
    return Pose(position, theta), known


def lags(s: Scenario) -> Array | None:
    """(N, 3, 4) of v, omega, zeta: time constant and delay [s], largest fall and rise, unit per second.

    None if an airframe's are not to be found.
    """
    if s["lags"]["source"] == "table" and s["plant"] != "jsbsim":
        every = np.tile(_of_table(s["lags"]), (s["vehicles"], 1, 1))
        every[~fleet.under(s), :, :2] = 0.0
        return every
    known = {}
    for name in fleet.airframes(s):
        called, *asked = f"{name}@{s.get('sensors', '')}".rstrip("@").split("@")
        other = "@".join(a.removesuffix(".eq") for a in asked if a not in USUAL)
        if other in ("typical", "poor"):
            other = f"inverting@{other}"
        folder = airframe_folder(s, called)
        file = f"autopilots/{other}.toml" if other else "airframe.toml"
        try:
            said = tomllib.loads((folder / file).read_text(encoding="utf-8-sig"))["identified"]
            known[name] = [_of_channel(said[c], s["lags"]["limits"]) for c in TABLE]
        except (OSError, ValueError, KeyError, TypeError):
            return None
    found = np.array([known[name] for name in fleet.airframes(s)])
    found[~fleet.under(s), :, :2] = 0.0  # intruders are not about to fly gamma
    return found


def airframe_folder(s: Scenario, name: str) -> Path:
    """Where an airframe's files are."""
    ours = AIRFRAMES / name
    return ours if ours.is_dir() else Path(s.get("airframes_folder", ""), name)


def _of_table(table: dict[str, Any]) -> Array:
    """(3, 4) as the scenario's table says."""
    named = {
        "v": ("v_fall_max_mps2", "v_rise_max_mps2"),
        "omega": ("omega_change_max_degps2",) * 2,
        "zeta": ("zeta_change_max_mps2",) * 2,
    }
    found = []
    for name, absent in TABLE.items():
        constant, unit = table[f"{name}_time_constant_s"], radians(1.0) if name == "omega" else 1.0
        most = [np.inf if table[x] is None or not table["limits"] else unit * table[x] for x in named[name]]
        found.append((absent if constant is None else constant, table[f"{name}_delay_s"], *most))
    return np.array(found, dtype=float)


def _of_channel(said: dict[str, float], limits: bool) -> tuple[float, float, float, float]:
    """As an airframe's file says of one channel."""
    rise = said["rate_max"] if limits and "rate_max" in said else np.inf
    fall = -said["rate_min"] if limits and "rate_min" in said else rise
    return said["time_constant_s"], said["delay_s"], fall, rise


def _settled(s: Scenario, pose: Pose, rates: Array, lags: Array) -> Pose:
    """Where a unicycle must be now to end up, flying gamma, where the lagging vehicles do.

    Each channel keeps its rate for its delay and then decays towards gamma's. Flown on until nothing is left
    of that, and back along gamma.
    """
    gamma = manoeuvre(filters_own(s))
    excess = rates - gamma
    constant, delay = np.maximum(lags[..., 0], 1e-12), lags[..., 1]
    # Simpson's rule between the instants at which a channel begins to answer.
    ends = np.sort(delay[:, :2], axis=1)
    last = ends[:, 1] + TAIL * lags[:, :2, 0].max(axis=1)
    marks = np.stack([np.zeros(len(gamma)), ends[:, 0], ends[:, 1], last], axis=1)
    moved = np.zeros(pose.theta.shape, dtype=complex)
    for k in range(3):
        step = (marks[:, k + 1] - marks[:, k]) / STEPS
        for m in range(STEPS + 1):
            weight = step / 3.0 * (1 if m in (0, STEPS) else 4 if m % 2 else 2)
            t = (marks[:, k] + m * step)[:, None]
            waited = np.maximum(t - delay, 0.0) / constant
            speed = gamma[:, 0] + excess[..., 0] * np.exp(-waited[:, 0])
            angle = np.minimum(t, delay) - constant * np.expm1(-waited)
            turned = gamma[:, 1] * t[:, 0] + excess[..., 1] * angle[:, 1]
            moved = moved + weight * speed * np.exp(1j * turned)
    whole = lags.sum(axis=-1)
    end = pose.position.copy()
    going = np.exp(1j * pose.theta) * moved
    end[..., 0] += going.real
    end[..., 1] += going.imag
    end[..., 2] += gamma[:, 2] * last + excess[..., 2] * whole[:, 2]
    theta = pose.theta + gamma[:, 1] * last + excess[..., 1] * whole[:, 1]
    return arc(Pose(end, theta), np.broadcast_to(gamma, rates.shape), -last)
