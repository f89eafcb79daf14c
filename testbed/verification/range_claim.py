"""Checks P7, the range that is enough, by trying all headings; and says which pairs knew of each other."""

from __future__ import annotations

from math import ceil, hypot, inf, radians

import numpy as np

from testbed.records.verdict import Status
from testbed.verification.finding import Finding, Judge
from testbed.verification.future import manoeuvre
from testbed.verification.pair_claims import SOLVING
from testbed.verification.recorded import Array, Recorded
from testbed.verification.settings import Scenario, box, filters_own

# Headings tried, and instants of the integral; the largest is then refined between its neighbours.
HEADINGS, INSTANTS = 721, 400
AGREES_M = 1e-4


def age_steps(s: Scenario) -> int:
    """Filter periods by which it is late who knows of whom."""
    late = s["sensing"]["delay_s"] + s["network"]["latency_s"]
    return ceil(late / s["rates"]["filter_dt_s"] - 1e-9)


def apart(run: Recorded) -> Array | str | None:
    """Pairs (T, P) that did not know of each other; None without a limit; or why that is unknown."""
    limit = run.scenario["sensing"].get("range_m")
    if limit is None:
        return None
    steps = age_steps(run.scenario)
    if steps and not run.complete:
        return "who knew of whom rests on instants that are not recorded"
    far = np.linalg.norm(run.position[:, run.i] - run.position[:, run.j], axis=-1) > limit
    return far[np.maximum(np.arange(len(far)) - steps, 0)]


def enough(judge: Judge) -> Finding:
    """The finding of P7."""
    run, e = judge.run, judge.entry
    s = run.scenario
    if "filter" in run.parts or s["filter"]["kind"] not in SOLVING or not run.i.size:
        return judge.nothing("not judged")
    due, limit = _largest(run), s["sensing"]["range_m"]
    if due == inf:
        return judge.nothing("no range", Status.PREMISE_NOT_MET)
    judge.expect("value", e["value"], float(limit))
    judge.expect_near("bound", e["bound"], due, AGREES_M)
    if e["value"] is not None and e["bound"] is not None:
        judge.expect("margin", e["margin"], e["value"] - e["bound"])
        holds = e["margin"] >= 0.0 and not s["network"]["loss"]
        judge.expect("verdict", e["verdict"], judge.verdict(holds, Status.PREMISE_NOT_MET))
    return judge.done(f"{due:.6g}", AGREES_M)


def _largest(run: Recorded) -> float:
    """The range that the pair which needs most needs [m]."""
    s = run.scenario
    own = filters_own(s)
    b, unseen = own["barrier"], (1 + age_steps(s)) * s["rates"]["filter_dt_s"]
    high = np.broadcast_to(box(s)[1], (s["vehicles"], 3))
    if b.get("pairs"):
        each = np.array([[p["v_mps"], radians(p["omega_degps"]), 0.0] for p in b["pairs"]])
        pairs = [(k, gamma, gamma) for k, gamma in enumerate(each)]
    else:
        gamma = np.broadcast_to(manoeuvre(own), (s["vehicles"], 3))
        pairs = [(k, gamma[a], gamma[c]) for k, (a, c) in enumerate(zip(run.i, run.j, strict=True))]
    known: dict[tuple[float, ...], float] = {}
    found = []
    for k, one, other in pairs:
        i, j = high[run.i[k]], high[run.j[k]]
        key = (*one, *other, *i, *j)
        if key not in known:
            known[key] = _of_pair(own, one, other, i, j, unseen)
        found.append(known[key])
    return max(found)


def _of_pair(own: Scenario, one: Array, other: Array, i: Array, j: Array, unseen: float) -> float:
    b, d_safe = own["barrier"], own["d_safe_m"]
    climbed = (i[2] + j[2]) * unseen
    if b["kind"] == "euclidean":
        return float(d_safe + hypot((i[0] + j[0]) * unseen, climbed))
    if np.abs(one[1:] - other[1:]).max() > 1e-9 or one[1] == 0.0:
        return inf
    reach = (one[0] + other[0]) / abs(one[1])
    inward = reach + _inward(one[0] / abs(one[1]), i, unseen) + _inward(other[0] / abs(one[1]), j, unseen)
    swing = 2.0 * reach**2
    delta, eps = b.get("delta_m2", 0.0), b.get("smoothing_m2", 0.0)
    clear = d_safe**2 + (2.0 + 2.0**0.5) * delta + (hypot(swing, eps) - swing)
    return float(hypot(inward, climbed) + clear**0.5)


def _inward(radius: float, most: Array, unseen: float) -> float:
    """What a vehicle's circle and its flight bring the pair together by, the worst of all headings."""
    v, omega = most[0], most[1]
    t, weight = np.polynomial.legendre.leggauss(INSTANTS)
    t, weight = 0.5 * unseen * (t + 1.0), 0.5 * unseen * weight

    def of(heading: Array) -> Array:
        turned = np.minimum(heading[:, None] + omega * t, 0.5 * np.pi)
        return np.asarray(radius * np.cos(heading) + v * (np.sin(turned) @ weight))

    low, high = 0.0, 0.5 * np.pi
    best = 0.0
    for _ in range(3):
        tried = np.linspace(low, high, HEADINGS)
        values = of(tried)
        k = int(np.argmax(values))
        best = float(values[k])
        low, high = tried[max(k - 1, 0)], tried[min(k + 1, HEADINGS - 1)]
    return best
