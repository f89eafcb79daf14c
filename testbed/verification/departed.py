"""Works out from the positions who has left and when, and takes it out of what is judged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from testbed.verification.finding import Finding
from testbed.verification.future import Flown
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import goals, seeking

# h [m] of a pair that has left: larger than any, so that it is never the least.
FAR = 1e9
ROUNDING = 1e-9


def leaves(run: Recorded) -> bool:
    """Whether vehicles of the run leave on arrival."""
    return bool((run.scenario.get("goal") or {}).get("on_arrival") == "leave")


def marked(run: Recorded) -> Recorded:
    """The run with the time at which each vehicle left.

    Where every filter step is recorded the positions alone tell; elsewhere `left_s`, which `left` checks.
    """
    if not leaves(run):
        return run
    there = np.linalg.norm(run.position - goals(run.scenario), axis=-1) <= run.scenario["goal_radius_m"]
    there &= seeking(run.scenario)
    first = np.where(there.any(axis=0), run.t[np.argmax(there, axis=0)], np.inf)
    return replace(run, left_s=first if run.complete else np.minimum(first, _said(run)))


def _said(run: Recorded) -> Array:
    """(N,) s when each is said to have left; inf for never."""
    told = run.manifest.get("left_s")
    if not isinstance(told, list) or len(told) != run.scenario["vehicles"]:
        return np.full(run.scenario["vehicles"], np.inf)
    return np.array([np.inf if t is None else float(t) for t in told])


def left(run: Recorded) -> Finding | None:
    """Times, the column, and which numbers of pairs are missing: those of vehicles that have left."""
    column, told = run.vehicles.get("left"), run.manifest.get("left_s")
    if run.left_s is None:
        extra = [name for name, x in (("the column left", column), ("left_s", told)) if x is not None]
        why = " and ".join(extra)
        return Finding("left", "somebody", "nobody leaves", False, None, why) if extra else None
    said, own, gone, wrong = _said(run), run.left_s, run.gone(run.t), []
    if not isinstance(told, list) or len(told) != len(own):
        wrong.append("left_s is no list of a time per vehicle")
    for v in range(len(own)):
        if run.complete and not (said[v] == own[v] or abs(said[v] - own[v]) <= 1e-6):
            wrong.append(f"vehicle {v + 1} left at {own[v]:g} s, not {said[v]:g} s")
        if not run.complete and np.isfinite(min(said[v], own[v])):
            wrong += _between(run, v, float(said[v]), float(own[v]))
    if column is None or not np.array_equal(np.asarray(column, dtype=bool), gone):
        wrong.append("the column left is another")
    if run.i.size:
        bare = np.isnan(run.pairs["distance_m"])
        hidden = int((bare & ~run.apart()).sum())
        shown = int((~bare & run.apart()).sum())
        wrong += [f"{hidden} rows of pairs are hidden though both are there"] if hidden else []
        wrong += [f"{shown} rows of pairs are shown though one has left"] if shown else []
    count = int(gone.any(axis=0).sum())
    return Finding(
        "left", f"{np.isfinite(said).sum()} left", f"{count} left", not wrong, 1e-6, "; ".join(wrong)
    )


def _between(run: Recorded, v: int, said: float, own: float) -> list[str]:
    """What is wrong with a time between recorded instants."""
    at = run.t[run.t < said - ROUNDING]
    radius = run.scenario["goal_radius_m"]
    distance = np.linalg.norm(run.position[:, v] - goals(run.scenario)[v], axis=-1)
    if not np.isfinite(said):
        return [f"vehicle {v + 1} is within its goal radius at {own:g} s and is not said to leave"]
    if (distance[: len(at)] <= radius).any() or not seeking(run.scenario)[v]:
        return [f"vehicle {v + 1} left before {said:g} s"]
    k = int(np.argmin(np.abs(run.t - said)))
    fastest = 1.5 * float(np.linalg.norm(run.velocity[:, v], axis=-1).max()) + 1.0
    if distance[k] - fastest * abs(run.t[k] - said) > radius:
        return [f"vehicle {v + 1} cannot be within its goal radius at {said:g} s"]
    return []


def without(run: Recorded, flown: Flown | None) -> Flown | None:
    """The result of flying on with pairs taken out of which one has left: far, and answering to nothing."""
    if flown is None or run.left_s is None or not run.i.size:
        return flown
    apart = run.apart()
    return Flown(
        np.where(apart, FAR, flown.h),
        np.where(apart, 0.0, flown.lie),
        np.where(apart, 0.0, flown.off),
        np.where(apart, 0.0, flown.lie_off),
        flown.harmonic,
    )


def told(run: Recorded, said: Array, own: Array, ahead: bool = False) -> Array:
    """What is said of pairs (T', P) at the first T' instants, and ours where one of the two has left.

    ahead  also where one has left a filter period later
    """
    if run.left_s is None:
        return said
    apart = run.apart(run.scenario["rates"]["filter_dt_s"] if ahead else 0.0)
    return np.where(apart[: len(said)], own, said)


def filled(run: Recorded) -> Recorded:
    """The run in which what a user's filter declares of pairs that have left is far away."""
    if run.left_s is None or not run.declared:
        return run
    far = {
        name: np.where(run.apart(), FAR, column) if name.endswith("_declared") else column
        for name, column in run.pairs.items()
    }
    return replace(run, pairs=far)
