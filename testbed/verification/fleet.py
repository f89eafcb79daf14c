"""Reads from a scenario's plain data what each vehicle has of its own: limits, manoeuvre, airframe, role."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from testbed.verification.recorded import Array, Recorded

Scenario = dict[str, Any]


def tables(s: Scenario) -> list[Scenario]:
    """A table for each vehicle, empty where it has nothing of its own."""
    return list(s.get("vehicle") or [{}] * s["vehicles"])


def said(s: Scenario, name: str, common: float) -> Array:
    """A number of each vehicle (N,): its own, or what all others have."""
    return np.array([v.get(name, common) for v in tables(s)], dtype=float)


def limits(s: Scenario) -> list[Scenario]:
    """The input set of each vehicle, as [limits] says it."""
    return [s["limits"] | v.get("limits", {}) for v in tables(s)]


def airframes(s: Scenario) -> list[str]:
    """The airframe of each vehicle."""
    common = s["airframes"]
    return [v.get("airframe", common[k % len(common)]) for k, v in enumerate(tables(s))]


def under(s: Scenario) -> Array:
    """(N,) whether each vehicle is under the filter; the others are intruders."""
    return np.array([v.get("filter", True) for v in tables(s)], dtype=bool)


def strangers(s: Scenario) -> bool:
    """Whether there are intruders."""
    return not bool(under(s).all())


def which(run: Recorded, kind: str) -> Array:
    """(P,) pairs of a kind: "ours", under the filter; "beside" an intruder; "judged", either."""
    a, b = under(run.scenario)[run.i], under(run.scenario)[run.j]
    return np.asarray({"ours": a & b, "beside": a ^ b, "judged": a | b}[kind])


def among(run: Recorded, some: Array) -> Recorded:
    """The run with `some` (P,) of its pairs alone."""
    columns = {name: column[:, some] for name, column in run.pairs.items()}
    near = None if run.near is None else run.near[:, some]
    return replace(run, i=run.i[some], j=run.j[some], pairs=columns, near=near)


def lowered(s: Scenario) -> Scenario:
    """The scenario with a [barrier] table that lists the manoeuvres that vehicles have of their own."""
    own = [v.get("manoeuvre") for v in tables(s)]
    if not any(own):
        return s
    b = s["barrier"]
    listed = [m or _common(b, k) for k, m in enumerate(own)]
    made = {name: b[name] for name in ("form", "gradient", "gradient_step")}
    without = [{name: x for name, x in v.items() if name != "manoeuvre"} for v in tables(s)]
    filled = [{"omega_degps": 0.0, "zeta_mps": 0.0} | m for m in listed]
    return s | {"vehicle": without, "barrier": made | {"kind": "rollout", "manoeuvres": filled}}


def _common(b: Mapping[str, Any], k: int) -> dict[str, float]:
    """The manoeuvre that a [barrier] table has for vehicle k."""
    if b["kind"] == "rollout":
        return dict(b["manoeuvres"][k if len(b["manoeuvres"]) > 1 else 0])
    if b["kind"] == "straight":
        climb = np.atleast_1d(b["zeta_mps"])
        return {"v_mps": b["v_mps"] * (1.0 + b["speed_step"] * (k + 1)), "zeta_mps": climb[k % len(climb)]}
    ratio = np.atleast_1d(b["sigma"])
    return {"v_mps": b["v_mps"] * ratio[k % len(ratio)], "omega_degps": b["omega_degps"]}
