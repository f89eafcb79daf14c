"""h by flying the evading manoeuvre on from recorded states: no closed form, no code of the filter's.

Two vehicles that turn at one rate come back after a period, and along it the safety function is a constant
and one harmonic: its least value follows from a few instants of the rollout. Two that fly straight are
closest where their range stops shrinking.
"""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np

from testbed.verification.recorded import Array

INSTANTS = 12  # of a turn's period; three would do
# Below this share of Ds the root of the paper's safety function is carried on as a straight line.
LINEAR_SHARE = 0.1


def barrier(s: dict[str, Any], position: Array, theta: Array, i: Array, j: Array) -> Array | None:
    """h (T, P) of pairs at positions (T, N, 3) and courses (T, N); None for a manoeuvre of another kind."""
    b = s["barrier"]
    kind = b["kind"]
    if kind == "euclidean":
        least = np.sum((position[:, i] - position[:, j]) ** 2, axis=-1)
    elif kind == "turn":
        least = _turns(b, position, theta, i, j)
    elif kind == "straight":
        n = s["vehicles"]
        speed = b["v_mps"] * (1.0 + b["speed_step"] * np.arange(1, n + 1))
        climb = np.resize(np.asarray(b["zeta_mps"], dtype=float), n)
        least = _straight(speed, climb, position, theta, i, j)
    else:
        return None
    d_safe = s["d_safe_m"]
    if b["form"] == "squared":
        return least - d_safe**2
    edge = LINEAR_SHARE * d_safe
    line = edge + (least - edge**2) / (2.0 * edge)
    return np.where(least >= edge**2, np.sqrt(np.maximum(least, 0.0)), line) - d_safe


def _turns(b: dict[str, Any], position: Array, theta: Array, i: Array, j: Array) -> Array:
    """Least safety function (T, P) [m^2] of each pair over a period of its turn."""
    n = position.shape[1]
    ratio = np.resize(np.asarray(b["sigma"], dtype=float), n)
    if b["pairs"]:
        speed = np.array([p["v_mps"] for p in b["pairs"]])
        rate = np.radians([p["omega_degps"] for p in b["pairs"]])
        speeds = speed, speed
        smoothing = 0.0
    else:
        rate = np.full(i.size, radians(b["omega_degps"]))
        speeds = b["v_mps"] * ratio[i], b["v_mps"] * ratio[j]
        smoothing = b["smoothing_m2"]
    delta = b["delta_m2"]
    total = first = 0.0
    for k in range(INSTANTS):
        turned = 2 * np.pi * k / INSTANTS * np.sign(rate)
        apart = position[:, i] - position[:, j]
        for sign, speed, vehicle in ((1.0, speeds[0], i), (-1.0, speeds[1], j)):
            before, after = theta[:, vehicle], theta[:, vehicle] + turned
            apart[..., 0] += sign * speed / rate * (np.sin(after) - np.sin(before))
            apart[..., 1] -= sign * speed / rate * (np.cos(after) - np.cos(before))
        course = theta[:, i] + turned
        # The paper's safety function, its rounding of the kink included
        rho = np.sum(apart**2, axis=-1) - delta * (2.0 + np.cos(course) - np.sin(course))
        total = total + rho / INSTANTS
        first = first + 2.0 / INSTANTS * rho * np.exp(-1j * turned)
    return total - np.hypot(np.abs(first), smoothing)


def _straight(speed: Array, climb: Array, position: Array, theta: Array, i: Array, j: Array) -> Array:
    """Least squared range (T, P) [m^2] of each pair that flies straight on."""
    east, north = speed * np.cos(theta), speed * np.sin(theta)
    flown = np.stack([east, north, np.broadcast_to(climb, theta.shape)], axis=-1)
    apart, closing = position[:, i] - position[:, j], flown[:, i] - flown[:, j]
    when = -np.sum(apart * closing, axis=-1) / np.sum(closing**2, axis=-1)
    closest = apart + np.maximum(when, 0.0)[..., None] * closing
    return np.sum(closest**2, axis=-1)
