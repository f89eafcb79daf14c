"""Reads a table of near pairs only: up to an h that the manifest's `near_pairs` says.

A turn for ever is a circle, and two circles come no nearer than the distance of their centres less both
radii. So pairs whose h may be below a number are found by their centres; all others are proved to be above.
"""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from testbed.errors import UserError

Array = np.ndarray
Scenario = dict[str, Any]

# Rows of a table of all pairs up to which all are looked at.
ALL = 2_000_000


def recorded_below(manifest: dict[str, Any]) -> float | None:
    """The h [m] up to which pairs are recorded; None if all are. Raises KeyError or ValueError."""
    told = manifest.get("near_pairs")
    return None if told is None else float(told["h_m"])


def centres(s: Scenario, position: Array, theta: Array) -> tuple[Array, float]:
    """Of the circles (..., N, 2) m that vehicles fly, and the largest radius [m]."""
    b = s["barrier"]
    radius = b["v_mps"] * np.atleast_1d(b["sigma"]) / radians(b["omega_degps"])
    radius = np.resize(radius, theta.shape[-1])
    east, north = position[..., 0] - radius * np.sin(theta), position[..., 1] + radius * np.cos(theta)
    return np.stack([east, north], axis=-1), float(np.abs(radius).max())


def candidates(s: Scenario, position: Array, theta: Array, h: float) -> Array:
    """Numbers i N + j, sorted, of the pairs whose h may be `h` [m] or less at some instant; and the nearest.

    position, theta  (T, N, 3) m, (T, N) rad
    """
    from scipy.spatial import cKDTree

    b, n = s["barrier"], theta.shape[-1]
    where, radius = centres(s, position, theta)
    lost = 4.0 * b["delta_m2"] + b["smoothing_m2"]
    apart = 2.0 * radius + float(np.sqrt((max(h, 0.0) + s["d_safe_m"]) ** 2 + lost)) + 1.0
    found = []
    for now, place in zip(where, position, strict=True):
        near = cKDTree(now).query_pairs(apart, output_type="ndarray")
        distance, who = cKDTree(place).query(place, k=2)
        k = int(np.argmin(distance[:, 1]))
        near = np.concatenate([near, np.sort([[k, who[k, 1]]], axis=1)])
        found.append(np.unique(near[:, 0] * n + near[:, 1]))
    return np.unique(np.concatenate(found))


def spread(
    flat: dict[str, Array], s: Scenario, h: float, vehicles: dict[str, Array], folder: Path
) -> tuple[Array, Array, dict[str, Array], Array]:
    """Pairs (i, j), their columns (T, U), nan where a pair is not recorded, and whether it is (T, U).

    flat  the table's columns as they are recorded, row by row
    Taken are all pairs of a small run, else those recorded and those that may matter.
    Raises UserError for rows that are doubled or out of place.
    """
    t, n = vehicles["t_s"][:, 0], s["vehicles"]
    i, j = (flat[c].astype(int) - 1 for c in "ij")
    step = np.searchsorted(t, flat["t_s"] - 1e-7)
    if (
        (i < 0).any()
        or (i >= j).any()
        or (j >= n).any()
        or (step >= len(t)).any()
        or np.abs(t[step] - flat["t_s"]).max(initial=0.0) > 1e-7
        or (np.diff((step * n + i) * n + j) <= 0).any()
    ):
        raise UserError(f"{folder}: pairs.parquet has rows that are doubled or out of place")
    if len(t) * n * (n - 1) // 2 <= ALL:
        first, second = np.triu_indices(n, 1)
        taken = first * n + second
    else:
        position = np.stack([vehicles[c] for c in ("x_m", "y_m", "z_m")], axis=-1)
        taken = np.union1d(i * n + j, candidates(s, position, vehicles["theta_rad"], h))
    place, there = np.searchsorted(taken, i * n + j), np.zeros((len(t), taken.size), dtype=bool)
    there[step, place] = True
    columns = {}
    for name, values in flat.items():
        columns[name] = np.full(there.shape, np.nan)
        columns[name][step, place] = values
    columns["t_s"] = np.repeat(t[:, None], taken.size, axis=1)
    return taken // n, taken % n, columns, there
