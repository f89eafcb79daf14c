"""Checks an aircraft's telemetry against its motion: airspeed, flow angles, bank and load factor.

Attitude, ground velocity and wind determine airspeed, angle of attack and sideslip exactly. The change of the
ground velocity determines the load factor and, in a flight without much side force, the bank.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.verification.air import all_gusts, flown_in
from testbed.verification.finding import Finding, compared
from testbed.verification.path_bounds import resolved
from testbed.verification.recorded import Array, Recorded

G_MPS2 = 9.80665
ATTITUDE = ("roll_rad", "pitch_rad", "heading_rad")
# The origin of all runs; the Earth's radii of curvature there, along parallel and meridian (WGS 84).
_LATITUDE_RAD, _EAST_M, _NORTH_M = np.radians(40.0), 6.3870e6, 6.3622e6
AIRSPEED_MPS, ALPHA_RAD, BETA_RAD = 1e-3, 5e-5, 2e-4
# In g, beside what finite differences miss: an error of the load factor (largest seen 0.001), the side force
# (0.1), and what gusts add per m/s of their standard deviation (0.06).
LOAD, SIDE, PER_GUST = 0.02, 0.25, 0.15
UNSEEN_AIR = "the wind over the step before is not recorded"


def telemetry(run: Recorded) -> Iterator[Finding]:
    """One finding per column; none where the columns of an aircraft are not recorded."""
    needed = (*ATTITUDE, "alpha_rad", "beta_rad", "airspeed_mps", "load_factor")
    if not all(name in run.vehicles for name in needed):
        return
    yield from _flow(run)
    if len(run.t) < 4 or not resolved(run):
        why = "velocities are recorded too seldom to tell accelerations"
        for name in ("load_factor", "roll_rad"):
            yield Finding(name, f"{run.vehicles[name].size} values", "unknown", None, None, why)
        return
    yield from _forces(run)


def _flow(run: Recorded) -> Iterator[Finding]:
    """Airspeed and flow angles from attitude, ground velocity and wind."""
    names = ("airspeed_mps", "alpha_rad", "beta_rad")
    air = flown_in(run)
    if air is None:
        for name in names:
            yield Finding(name, f"{run.vehicles[name].size} values", "unknown", None, None, UNSEEN_AIR)
        return
    u, v, w = np.moveaxis(in_body(run, _local(run) - air.velocity), -1, 0)
    speed = np.sqrt(u**2 + v**2 + w**2)
    slip = np.arcsin(np.clip(v / np.maximum(speed, 1e-9), -1.0, 1.0))
    share = air.off / np.maximum(speed, 1.0)
    for name, own, off in zip(
        names,
        (speed, np.arctan2(w, u), slip),
        (AIRSPEED_MPS + air.off, ALPHA_RAD + share, BETA_RAD + share),
        strict=True,
    ):
        yield compared(name, run.vehicles[name], own, off)


def _local(run: Recorded) -> Array:
    """Ground velocity (T, N, 3) along east, north and up where the vehicle is.

    Recorded are its projection on the origin's plane, which is tilted against the ground below the vehicle,
    and the climb rate there. Meridians converge, so that north has turned as well. To the first order.
    """
    x, y = run.position[..., 0] / _EAST_M, run.position[..., 1] / _NORTH_M
    v_x, v_y, climb = np.moveaxis(run.velocity, -1, 0)
    v_x, v_y, turned = v_x - climb * x, v_y - climb * y, x * np.tan(_LATITUDE_RAD)
    return np.stack([v_x + v_y * turned, v_y - v_x * turned, climb], axis=-1)


def _forces(run: Recorded) -> Iterator[Finding]:
    """Load factor and bank from the change of the ground velocity."""
    velocity, dt = run.velocity, np.diff(run.t)[:, None, None]
    change = np.diff(velocity, axis=0) / dt
    before, after = np.concatenate([change[:1], change]), np.concatenate([change, change[-1:]])
    # The two one-sided differences are as far apart as their mean may be off, there or one instant beside.
    # At an end there is only the mean over the interval beside it: what the acceleration changes by within
    # that interval, it changes by between the two or the three intervals beside as well.
    inner = np.linalg.norm(change[1:] - change[:-1], axis=-1) / G_MPS2
    first, last = inner[:2].max(axis=0), inner[-2:].max(axis=0)
    apart = np.concatenate([[first, first], inner, [last, last]])
    apart = np.maximum(np.maximum(apart[:-2], apart[1:-1]), apart[2:])
    force = in_body(run, 0.5 * (before + after) + np.array([0.0, 0.0, G_MPS2])) / G_MPS2
    gusts = PER_GUST * all_gusts(run.scenario)
    # Sideslip is not bounded for a vehicle that has departed from controlled flight.
    side = np.inf if run.ended else SIDE + gusts
    yield compared("load_factor", run.vehicles["load_factor"], -force[..., 2], apart + LOAD + gusts)
    yield compared("roll_rad", np.zeros(apart.shape), force[..., 1], apart + side)


def in_body(run: Recorded, vector: Array) -> Array:
    """Vectors (T, N, 3) east, north, up as forward, right and down of the recorded attitude."""
    roll, pitch, heading = (run.vehicles[name] for name in ATTITUDE)
    east, north, down = vector[..., 0], vector[..., 1], -vector[..., 2]
    # Level axes along the heading, then pitched, then banked.
    ahead = east * np.cos(heading) + north * np.sin(heading)
    right = east * np.sin(heading) - north * np.cos(heading)
    forward = ahead * np.cos(pitch) - down * np.sin(pitch)
    below = ahead * np.sin(pitch) + down * np.cos(pitch)
    return np.stack(
        [forward, right * np.cos(roll) + below * np.sin(roll), below * np.cos(roll) - right * np.sin(roll)],
        axis=-1,
    )
