"""Checks G9: what h promised where the manoeuvre was flown and, on unicycles, the distances reached."""

from __future__ import annotations

from math import ceil, inf, pi
from typing import Any

import numpy as np

from testbed.records.verdict import Status
from testbed.verification import fleet
from testbed.verification.finding import Finding, Judge
from testbed.verification.future import Pose, manoeuvre
from testbed.verification.pair_claims import H_ALLOWED, Pairs, unicycle
from testbed.verification.recorded import Array
from testbed.verification.settings import arc, box

# How often the plant is stepped while gamma is flown, and for how long where nobody turns [s].
PERIOD_S, STRAIGHT_S = 0.05, 60.0
ROUNDING = 1e-6
FLOWN = "what the aircraft reach is not in the record"


def manoeuvre_keeps(pairs: Pairs | None, judge: Judge) -> Finding:
    """Promises are those of the recorded poses, the verdict is that of the numbers; see the module."""
    run, e = judge.run, judge.entry
    s = run.scenario
    if not run.i.size or s["barrier"].get("pairs") or s["barrier"]["kind"] == "euclidean":
        return judge.nothing("no one manoeuvre")
    if pairs is None:
        return judge.done("unknown", None, True, "verification does not cover this manoeuvre")
    branches: list[dict[str, Any]] = e["detail"].get("branches", [])
    _placed(judge, [b["t_s"] for b in branches])
    unseen = [b for b in branches if not _promise(pairs, judge, b)]
    _verdict(judge, branches)
    own = f"{len(branches) - len(unseen)} of {len(branches)} promises"
    if unseen:
        return judge.done(own, ROUNDING, True)
    if unicycle(run):
        return judge.done(f"{e['value']:.6g}" if e["value"] is not None else "none", ROUNDING)
    return judge.done(own, ROUNDING, True, FLOWN)


def _placed(judge: Judge, when: list[float]) -> None:
    """As many instants as asked for, a third of them evenly along the run, fewer only if none is left."""
    s = judge.run.scenario
    dt, n = s["rates"]["filter_dt_s"], s["checks"]["manoeuvre_instants"]
    steps = [round(t / dt) for t in when]
    even = max(1, n // 3)
    missing = {round(k * s["duration_s"] / even / dt) for k in range(even)} - set(steps)
    if missing:
        judge.wrong.append(f"not flown from {min(missing) * dt:g} s")
    if steps != sorted(set(steps)) or len(steps) > n:
        judge.wrong.append(f"{len(steps)} instants, not {n} in order")
    if len(steps) < n:
        reached = [b.get("least_m", inf) for b in judge.entry["detail"].get("branches", [])]
        k = int(np.argmin(reached)) if reached else 0
        near = [steps[m + 1] - steps[m] for m in (k - 1, k) if 0 <= m < len(steps) - 1]
        if any(gap > 1 for gap in near):
            judge.wrong.append(f"{len(steps)} instants flown, {n} asked for")


def _promise(pairs: Pairs, judge: Judge, branch: dict[str, Any]) -> bool:
    """Compare a branch with the pairs where it began; False if that is no recorded instant."""
    run, t = judge.run, branch["t_s"]
    k = int(np.argmin(np.abs(run.t - t)))
    at = f"at {t:g} s "
    if abs(run.t[k] - t) > 1e-6:
        _shortfall(judge, branch, at)
        _drifted(pairs, judge, branch, k, at)
        return False
    h, off = pairs.now.h[k], pairs.now.off[k] + H_ALLOWED
    fewest, most = int((h >= off).sum()), int((h >= -off).sum())
    if not fewest <= branch["safe_pairs"] <= most:
        judge.wrong.append(f"{at}{most} pairs are safe")
    if not branch["safe_pairs"]:
        return True
    if branch["vehicles"] not in pairs.who:
        judge.wrong.append(f"{at}there is no pair {branch['vehicles']}")
        return True
    p = pairs.who.index(branch["vehicles"])
    judge.expect_near(f"{at}h", branch["h"], float(h[p]), float(off[p]))
    judge.expect_near(f"{at}promise", branch["promised_m"], float(_promised(run.scenario, h)[p]), ROUNDING)
    apart = np.linalg.norm(run.position[k][run.i] - run.position[k][run.j], axis=-1)
    if not branch["least_m"] <= float(np.where(h >= -off, apart, inf).min()) + ROUNDING:
        judge.wrong.append(f"{at}a pair was nearer before it began")
    _shortfall(judge, branch, at)
    if unicycle(run):
        _reached(pairs, judge, branch, k, h >= 0.0, at)
    return True


def _drifted(pairs: Pairs, judge: Judge, branch: dict[str, Any], k: int, at: str) -> None:
    """From the nearest recorded instant h can have come no further than its pace allows."""
    if not branch["safe_pairs"] or branch["vehicles"] not in pairs.who:
        return
    p, s = pairs.who.index(branch["vehicles"]), judge.run.scenario
    most = 1.2 * float(pairs.pace[k, p]) * abs(float(judge.run.t[k]) - branch["t_s"])
    judge.expect_near(f"{at}h", branch["h"], float(pairs.now.h[k, p]), most + ROUNDING)
    promise = float(_promised(s, np.asarray(branch["h"])))
    judge.expect_near(f"{at}promise", branch["promised_m"], promise, ROUNDING)


def _promised(s: dict[str, Any], h: Array) -> Array:
    """The distance [m] that h promises."""
    if s["barrier"]["form"] == "root":
        return h + s["d_safe_m"]
    return np.sqrt(np.maximum(h + s["d_safe_m"] ** 2, 0.0))


def _shortfall(judge: Judge, branch: dict[str, Any], at: str) -> None:
    """The worst pair fell short by no more than any did."""
    if branch["safe_pairs"] and not branch["promised_m"] - branch["least_m"] <= branch["short_m"] + ROUNDING:
        judge.wrong.append(f"{at}it fell short by {branch['promised_m'] - branch['least_m']:.6g} m")


def _reached(pairs: Pairs, judge: Judge, branch: dict[str, Any], k: int, safe: Array, at: str) -> None:
    """Unicycles fly gamma exactly: where they come to, step by step, for a whole turn."""
    run = judge.run
    s = run.scenario
    gamma = np.clip(manoeuvre(s), *box(s))
    dt = s["rates"]["fdm_dt_s"]
    turning = gamma[fleet.under(s), 1]
    turning = np.abs(turning[np.abs(turning) > 1e-9])
    horizon = 2 * pi / float(turning.min()) if turning.size else STRAIGHT_S
    stride = max(1, round(PERIOD_S / dt))
    steps = stride * ceil(horizon / (stride * dt))
    start = Pose(run.position[k], run.vehicles["theta_rad"][k])
    least = np.full(run.i.size, inf)
    for first in range(0, steps + 1, 500):
        t = dt * np.arange(first, min(first + 500, steps + 1))[:, None]
        track = arc(start, gamma, t).position
        distance = np.linalg.norm(track[:, run.i] - track[:, run.j], axis=-1)
        least = np.minimum(least, distance.min(axis=0))
    least = np.where(safe, least, inf)
    if branch["possible_m"] > float(least.min()) + ROUNDING:
        judge.wrong.append(
            f"{at}pairs came within {least.min():.6g} m, possible_m is {branch['possible_m']:.6g}"
        )
    if branch["least_m"] < s["d_safe_m"] <= float(least.min()):  # only between steps
        least = _between(pairs, start, gamma, least, steps * dt, dt)
    judge.expect_near(f"{at}least distance", branch["least_m"], float(least.min()), ROUNDING)
    if abs(least[pairs.who.index(branch["vehicles"])] - least.min()) > ROUNDING:
        judge.wrong.append(f"{at}pair {pairs.who[int(np.argmin(least))]} comes nearest")
    short = float((_promised(s, pairs.now.h[k]) - least)[safe].max())
    judge.expect_near(f"{at}shortfall", branch["short_m"], short, ROUNDING)


def _between(pairs: Pairs, start: Pose, gamma: Array, least: Array, horizon: float, dt: float) -> Array:
    """The pairs' least distances (P,), between steps of the flight dynamics as well."""
    run, found = pairs.run, least.copy()
    for p in np.flatnonzero(np.isfinite(least)):
        t, width = np.arange(0.0, horizon, dt), dt
        for _ in range(3):
            a, b = (
                arc(Pose(start.position[v], start.theta[v]), gamma[v], t).position
                for v in (run.i[p], run.j[p])
            )
            apart = np.linalg.norm(a - b, axis=-1)
            m = int(np.argmin(apart))
            found[p] = min(found[p], float(apart[m]))
            t = np.clip(np.linspace(t[m] - width, t[m] + width, 401), 0.0, horizon)
            width /= 200.0
    return found


def _verdict(judge: Judge, branches: list[dict[str, Any]]) -> None:
    """Value, place and verdict are the worst branch's."""
    e, d_safe = judge.entry, judge.run.scenario["d_safe_m"]
    safe = [b for b in branches if b["safe_pairs"]]
    if not safe:
        judge.nothing("none", Status.PREMISE_NOT_MET)
        return
    worst = min(safe, key=lambda b: b["least_m"])
    lost, low = any(b["fault"] for b in safe), d_safe - H_ALLOWED
    if lost and worst["least_m"] >= low:  # it is unknown how near they would have come
        judge.nothing("none", Status.VIOLATED)
        return
    judge.expect("value", e["value"], worst["least_m"])
    judge.expect("bound", e["bound"], low)
    judge.expect("margin", e["margin"], worst["least_m"] - low)
    judge.expect("t_s", e["t_s"], worst["t_s"])
    judge.expect("vehicles", e["vehicles"], worst["vehicles"])
    if any(b["possible_m"] > b["least_m"] + ROUNDING for b in safe):
        judge.wrong.append("possible_m is above the least distance")
    sure, kept = min(b["possible_m"] for b in safe) >= low, worst["least_m"] >= low and not lost
    fails = Status.OPEN if kept else Status.VIOLATED
    judge.expect("verdict", e["verdict"], judge.verdict(sure and kept, fails))
