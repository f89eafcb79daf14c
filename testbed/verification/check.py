"""Every claim of a run that its recorded positions and commands can decide, decided again.

Where everything was recorded, values must agree to rounding. Where recording was thinned, the recorded
instants bound a value from one side and interpolated flight, with its own error, from the other.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from testbed.verification.future import barrier
from testbed.verification.recorded import Array, Recorded, read

ROUNDING = 1e-6
# As the verdicts allow: round-off of h, and curvature within a filter period [m/s].
H_ALLOWED, RATE_ALLOWED = 1e-9, 1e-3
HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"


@dataclass(frozen=True)
class Finding:
    """One thing looked into: what the run says, what we find, whether they agree (None: cannot be told)."""

    what: str
    said: str
    own: str
    agrees: bool | None


def verify(folder: Path) -> list[Finding]:
    """Look into the run in `folder`; UserError if it cannot be read or lacks rows."""
    run = read(folder)
    h = None
    if run.i.size:
        h = barrier(run.scenario, run.position, run.vehicles["theta_rad"], run.i, run.j)
    findings = [Finding("files", "as written", ", ".join(run.changed) or "as written", not run.changed)]
    findings += _columns(run, h) + _motion(run)
    for name, own in _values(run, h).items():
        if name in run.guarantees:
            findings.append(_compare(run, name, own, h))
    return findings


def _columns(run: Recorded, h: Array | None) -> list[Finding]:
    """Distance and h of every pair and instant."""
    if not run.i.size:
        return []
    distance = np.linalg.norm(run.position[:, run.i] - run.position[:, run.j], axis=-1)
    found = [_column("distance_m", run.pairs["distance_m"], distance)]
    if h is None:
        return [
            *found,
            Finding("h_m", f"{run.pairs['h_m'].min():.6f}", "manoeuvre not of a kind we fly", None),
        ]
    return [*found, _column("h_m", run.pairs["h_m"], h)]


def _column(name: str, said: Array, own: Array) -> Finding:
    worst = float(np.nanmax(np.abs(said - own)))
    agrees = bool(np.isfinite(said).all()) and worst <= ROUNDING * max(1.0, float(np.abs(own).max()) / 1e3)
    return Finding(name, f"{said.size} values", f"differ by up to {worst:.2g}", agrees)


def _motion(run: Recorded) -> list[Finding]:
    """Do positions follow from speeds, courses and climb rates?"""
    if len(run.t) < 2:
        return []
    dt = np.diff(run.t)[:, None, None]
    moved, velocity = np.diff(run.position, axis=0), run.velocity
    off = np.linalg.norm(moved - 0.5 * dt * (velocity[:-1] + velocity[1:]), axis=-1)
    allowed = _slack(run)
    return [
        Finding(
            "motion",
            "continuous",
            f"off by up to {off.max():.3g} m, {allowed:.3g} allowed",
            bool(off.max() <= allowed),
        )
    ]


def _slack(run: Recorded) -> float:
    """What flight between two recorded instants may depart from a chord by [m]: speeds change at once on a
    unicycle, by the whole range; a turn at the highest rate seen bends the path."""
    period = run.scenario["rates"]["record_dt_s"]
    box, v = run.scenario["limits"], run.vehicles
    change = max(box["v_max_mps"] - box["v_min_mps"], float(np.ptp(v["v_mps"])))
    climb = 2.0 * max(box["zeta_max_mps"], float(np.abs(v["zeta_mps"]).max()))
    rate = max(radians(box["omega_max_degps"]), float(np.abs(v["omega_radps"]).max()))
    return (change + climb) * period + v["v_mps"].max() * rate * period**2 + ROUNDING


@dataclass(frozen=True)
class Own:
    """Our value: `value`, and how far below (`less`) and above (`more`) it the run's may lie."""

    value: float
    less: float = ROUNDING
    more: float = ROUNDING


def _values(run: Recorded, h: Array | None) -> dict[str, Own]:
    """Guarantee -> what the recording says of its value."""
    s, rates = run.scenario, run.scenario["rates"]
    all_steps = abs(rates["record_dt_s"] / rates["fdm_dt_s"] - 1.0) < 1e-6
    all_filtered = abs(rates["record_dt_s"] / rates["filter_dt_s"] - 1.0) < 1e-6
    between = 0.0 if all_steps else 2.0 * _slack(run)
    own = {}
    if run.i.size:
        distance = np.linalg.norm(run.position[:, run.i] - run.position[:, run.j], axis=-1)
        own["separation"] = Own(float(distance.min()), ROUNDING + between)
    if h is not None:
        jump = 0.0 if all_filtered or len(h) < 2 else 2.0 * float(np.abs(np.diff(h, axis=0)).max())
        own["safe-set"] = Own(float(h.min()), ROUNDING + jump)
        if all_filtered and len(h) > 1:
            dt = rates["filter_dt_s"]
            along = np.diff(h, axis=0) / dt + _alpha(s, h[:-1])
            size = max(1.0, float(np.abs(h).max()) / 1e3)
            own["barrier-condition"] = Own(float(along.min()), ROUNDING * size / dt, ROUNDING * size / dt)
    nearest = np.linalg.norm(run.position - _goals(s), axis=-1).min(axis=0).max()
    own["goal"] = Own(float(nearest), ROUNDING + between)
    own["command-limits"] = Own(_inside(run), ROUNDING if all_filtered else np.inf)
    if s["filter"]["kind"] in ("centralised", "limited"):
        failed = np.isin(run.vehicles["qp_status"], ("infeasible", "iteration_limit")).sum()
        own["qp-feasibility"] = Own(float(failed), 0.0, 0.0 if all_filtered else np.inf)
    return own


def _compare(run: Recorded, name: str, own: Own, h: Array | None) -> Finding:
    entry = run.guarantees[name]
    said, verdict = entry["value"], entry["verdict"]
    if said is None:
        return Finding(name, verdict, "no value", verdict == OTHER or run.ended is not None)
    near = own.value - own.less <= said <= own.value + own.more
    due = _verdict(run, name, entry, h)
    return Finding(name, f"{said:.6g}, {verdict}", f"{own.value:.6g}, {due}", near and verdict == due)


def _verdict(run: Recorded, name: str, entry: dict[str, Any], h: Array | None) -> str:
    """What follows from the value said, which was compared with ours."""
    s, value = run.scenario, entry["value"]
    if name == "separation":
        between = entry["detail"].get("between_steps_m")
        holds = value >= s["d_safe_m"] and (between is None or between >= s["d_safe_m"])
    elif name == "safe-set":
        if h is not None and h[0].min() < -H_ALLOWED:
            return PREMISE
        holds = value >= -H_ALLOWED
    elif name == "barrier-condition":
        holds = value >= -RATE_ALLOWED
    elif name == "goal":
        holds = value <= s["goal_radius_m"]
    elif name == "command-limits":
        holds = value >= 0.0
    else:
        holds = value == 0
    return (PREMISE if run.ended else HOLDS) if holds else VIOLATED


def _alpha(s: dict[str, Any], h: Array) -> Array:
    a = s["alpha"]
    if a["kind"] == "odd-polynomial":
        return sum(c * h ** (2 * k + 1) for k, c in enumerate(a["coefficients"]))
    return a["coefficient"] * h ** {"linear": 1, "cubic": 3}[a["kind"]]


def _goals(s: dict[str, Any]) -> Array:
    """(N, 3) m: listed, or the antipodes of a circle whose first vehicle stands in the west."""
    start, n = s["start"], s["vehicles"]
    if start["pattern"] == "list":
        return np.array([[p["goal_x_m"], p["goal_y_m"], p["goal_z_m"]] for p in start["places"]])
    angle = 2 * np.pi / n * np.arange(n)
    return start["radius_m"] * np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=-1)


def _inside(run: Recorded) -> float:
    """Least distance of a recorded command inside the limits, as a share of their range."""
    box = run.scenario["limits"]
    turn = radians(box["omega_max_degps"])
    ranges = {
        "v_command_mps": (box["v_min_mps"], box["v_max_mps"]),
        "omega_command_radps": (-turn, turn),
        "zeta_command_mps": (-box["zeta_max_mps"], box["zeta_max_mps"]),
    }
    shares = []
    for column, (low, high) in ranges.items():
        u = run.vehicles[column]
        shares.append(float(np.minimum(u - low, high - u).min()) / (high - low if high > low else 1.0))
    return min(shares)
