"""Prepares the data of a page's player: runs thinned, rounded and coded as differences."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import (
    BARRIER_CONDITION,
    FENCE_CLEARANCE,
    SAFE_SET,
    SEPARATION,
    SEPARATION_INTRUDERS,
)
from testbed.records.run import Run
from testbed.report import figures
from testbed.report.fences import outlines
from testbed.report.style import styles

# Values in all tracks of one player: about 3 bytes each as JSON, so 2 MB.
VALUES = 600_000
FRAMES = 1001
# Channel -> column of the run, and the step it is rounded to in the unit shown.
CHANNELS: dict[str, tuple[str, float, float]] = {
    "x": ("x_m", 1.0, 0.001),
    "y": ("y_m", 1.0, 0.001),
    "z": ("z_m", 1.0, 0.001),
    "theta": ("theta_rad", 1.0, 1e-4),
    "v": ("v_mps", 1.0, 0.01),
    "v_command": ("v_command_mps", 1.0, 0.01),
    "omega": ("omega_radps", 180.0 / np.pi, 0.01),
    "omega_command": ("omega_command_radps", 180.0 / np.pi, 0.01),
    "zeta": ("zeta_mps", 1.0, 0.01),
    "zeta_command": ("zeta_command_mps", 1.0, 0.01),
    "override": ("override", 1.0, 1.0),
}
TIME_STEP_S, H_STEP = 1e-4, 1e-3
# Verdicts whose worst instant gets a button.
MOMENTS = {
    SEPARATION.id: "least distance",
    SEPARATION_INTRUDERS.id: "least distance to an intruder",
    SAFE_SET.id: "least h",
    BARRIER_CONDITION.id: "least hdot + alpha(h)",
    FENCE_CLEARANCE.id: "nearest a fence",
}


def data(runs: Mapping[str, Run]) -> dict[str, Any]:
    """Everything the player needs, for JSON; runs of one scenario on several plants.

    Tracks are integers, each the difference to the one before, in steps of `steps`; times too. Worst instants
    stay among the frames however far the rest is thinned.
    """
    scenario = next(iter(runs.values())).manifest["scenario"]
    looks = styles(runs)
    each = VALUES // max(1, len(runs) * int(scenario["vehicles"]) * len(CHANNELS))
    return {
        "d_safe": scenario["d_safe_m"],
        "vehicles": scenario["vehicles"],
        "limits": figures.limits_of(scenario, 1),
        "fences": outlines(scenario),
        "unit": "m" if scenario["barrier"]["form"] == "root" else "m²",
        "steps": {name: step for name, (_, _, step) in CHANNELS.items()} | {"t": TIME_STEP_S, "h": H_STEP},
        "plants": [_plant(name, run, max(2, min(FRAMES, each)), looks[name]) for name, run in runs.items()],
    }


def _plant(name: str, run: Run, most: int, look: Mapping[str, Any]) -> dict[str, Any]:
    scenario = run.manifest["scenario"]
    n = scenario["vehicles"]
    t = run.vehicles.t_s.to_numpy()[::n]
    moments = [g for g in run.guarantees if g["t_s"] is not None]
    kept = frames(t, most, [g["t_s"] for g in moments])
    tracks = {}
    for channel, (column, scale, step) in CHANNELS.items():
        values = run.vehicles[column].to_numpy(dtype=float).reshape(-1, n)
        values = np.unwrap(values, axis=0) if channel == "theta" else values
        tracks[channel] = [coded(values[kept, v] * scale, step) for v in range(n)]
    separation = nearest_approach(run)
    return {
        "name": name,
        "color": look["color"],
        "dashed": look["linestyle"] != "-",
        "t": coded(t[kept], TIME_STEP_S),
        "tracks": tracks,
        "pairs": _pairs(run, len(t), kept),
        "gamma": gamma(scenario),
        "critical": separation["vehicles"] if len(separation["vehicles"]) == 2 else None,
        "moments": [
            {
                "label": MOMENTS[g["id"]],
                "t": g["t_s"],
                "vehicles": g["vehicles"],
                "lost": g["verdict"] == "violated",
            }
            for g in moments
            if g["id"] in MOMENTS
        ],
        "ended": run.manifest["ended_early"],
        "left": run.manifest.get("left_s") or [None] * n,
    }


def frames(t: np.ndarray, most: int, wanted: list[float]) -> np.ndarray:
    """Indices into `t`: at most `most` evenly spaced ones and the last, with those nearest to `wanted`."""
    every = max(1, -(-len(t) // most))
    near = [int(np.argmin(np.abs(t - x))) for x in wanted]
    return np.unique([*range(0, len(t), every), len(t) - 1, *near]).astype(int)


def coded(values: np.ndarray, step: float) -> list[int | None]:
    """Multiples of `step`, each as the difference to the one before; what is not finite repeats the last."""
    finite = np.isfinite(values)
    if not finite.all():
        last = np.maximum.accumulate(np.where(finite, np.arange(len(values)), 0))
        values = np.nan_to_num(values[last])
    whole = np.round(values / step).astype(np.int64)
    return np.diff(whole, prepend=0).tolist()


def _pairs(run: Run, times: int, kept: np.ndarray) -> dict[str, Any] | None:
    """The pairs of least distance and of least h at each frame, and h of pairs that were ever worst."""
    table = run.pairs
    if not len(table):
        return None
    i, j = (table[k].to_numpy().reshape(times, -1)[0] for k in ("i", "j"))
    distance = table.distance_m.to_numpy().reshape(times, -1)[kept]
    h = table.h_m.to_numpy().reshape(times, -1)[kept]
    rows = np.arange(len(kept))
    # Pairs of which one has left have no numbers any more.
    closest, lowest = (np.where(np.isnan(x), np.inf, x).argmin(axis=1) for x in (distance, h))
    worst = {tuple(g["vehicles"]) for g in run.guarantees if g["id"] in MOMENTS and len(g["vehicles"]) == 2}
    listed = [p for p in range(len(i)) if (int(i[p]), int(j[p])) in worst]
    return {
        "vehicles": np.stack([i, j], axis=1).tolist(),
        "closest": closest.tolist(),
        "lowest": lowest.tolist(),
        "least_h": coded(h[rows, lowest], H_STEP),
        "h": {f"{i[p]}-{j[p]}": coded(h[:, p], H_STEP) for p in listed},
    }


def gamma(scenario: Mapping[str, Any]) -> dict[str, Any]:
    """The manoeuvre whose closest approach is h: (v, omega, zeta) per vehicle, or per pair where they differ.

    kind "none" where h is a function of the present distance.
    """
    from testbed.components import catalogue
    from testbed.scenario.barrier import PairTurns
    from testbed.scenario.scenario import parse

    # The name of an older run may break today's rules for names; it does not matter here.
    s = parse(dict(scenario) | {"name": "x"}, keep_idle=True)
    if s.barrier.kind == "euclidean":
        return {"kind": "none"}
    if isinstance(s.barrier, PairTurns):
        each = {f"{p.i}-{p.j}": [p.v_mps, np.radians(p.omega_degps), 0.0] for p in s.barrier.pairs}
        return {"kind": "pairs", "pairs": each}
    shared = catalogue.barrier(s).manoeuvre(s.vehicles)
    if shared is None:
        return {"kind": "none"}
    return {"kind": s.barrier.kind, "vehicles": shared.array().tolist()}
