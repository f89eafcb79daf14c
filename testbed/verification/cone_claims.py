"""Checks the collision-cone filter's claims R1 and R2: velocities against the cones of collision.

h here is |p| |w| times the difference of two cosines: of the cone's half angle, and of the angle between the
relative velocity and the line to the vehicle.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.monitor_claims import follows
from testbed.verification.recorded import Array, Recorded
from testbed.verification.rows import Rows

START, KEPT = "monitor-cone_start", "monitor-cone_kept"
BOUNDS = {START: 0.0, KEPT: -1.0}
# Of the distance to keep, the shortest tangent.
SHORTEST = 0.1
# What rounding may do to h, relative to |p| |w|.
ROUNDING = 1e-10


def cone_claims(rows: Rows) -> Iterator[Finding]:
    """The findings of R1 and R2."""
    run = rows.run
    names = [id for id in BOUNDS if id in run.guarantees]
    if not names:
        return
    why = _unknown(rows)
    found = None if why else _cones(run)
    for id in names:
        judge = Judge(run, run.guarantees[id])
        follows(judge, BOUNDS[id], premise=id == START)
        if found is None:
            yield judge.done("unknown", None, True, why)
        else:
            yield _judged(run, judge, *found)


def _unknown(rows: Rows) -> str:
    """Why h cannot be told from the record; empty if it can."""
    network = rows.s["network"]
    late = network["latency_s"] or network["loss"]
    return rows.untold or ("each vehicle saw late poses of the others" if late else "")


def _cones(run: Recorded) -> tuple[Array, Array, list[list[int]]]:
    """h (T, R) m^2/s of ordered pairs, nan out of range; its rounding; and the vehicles, from 1."""
    s, n = run.scenario, run.scenario["vehicles"]
    keep = s["d_safe_m"] + s["remedy"]["ds_buffer_m"]
    course, v, _, climb = run.vehicles["theta_rad"], *np.moveaxis(run.rates, -1, 0)
    moving = np.stack([v * np.cos(course), v * np.sin(course), climb], axis=-1)
    own, other = np.nonzero(~np.eye(n, dtype=bool))
    p = run.position[:, other] - run.position[:, own]
    w = moving[:, other] - moving[:, own]
    far, fast = np.linalg.norm(p, axis=-1), np.linalg.norm(w, axis=-1)
    size = far * fast
    with np.errstate(divide="ignore", invalid="ignore"):
        towards = np.where(size > 0, -(p * w).sum(axis=-1) / size, 0.0)
        half = np.maximum(far**2 - keep**2, (SHORTEST * keep) ** 2) ** 0.5 / far
    h = np.where(size > 0, size * (half - towards), 0.0)
    h = np.where(far <= s["filter"]["range_m"], h, np.nan)
    who = [[int(a) + 1, int(b) + 1] for a, b in zip(own, other, strict=True)]
    return h, ROUNDING * (size + 1.0), who


def _judged(run: Recorded, judge: Judge, h: Array, off: Array, who: list[list[int]]) -> Finding:
    before = np.vstack([np.full((1, h.shape[1]), np.nan), h[:-1]])
    if judge.entry["id"] == START:
        counts, doubtful = np.isnan(before) & ~np.isnan(h), np.zeros(h.shape, dtype=bool)
    else:
        counts = (before >= 0) & ~np.isnan(h)
        doubtful = (np.abs(before) <= off) & ~np.isnan(h)
    seen = Values.of(run.t, np.where(np.isnan(h), np.inf, h), off, who, counts | doubtful, doubtful)
    low, high = seen.range()
    said = judge.entry["value"]
    if said is None:
        if high < np.inf:
            judge.wrong.append(f"no value, should be {high:.6g}")
    elif not low <= said <= high:
        judge.wrong.append(f"value is {said:.6g}, should be {low:.6g} to {high:.6g}")
    return judge.done(f"{seen.least():.6g}" if high < np.inf else "never met", float(off.max()))
