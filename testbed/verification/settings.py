"""Reads a scenario from the plain data of a manifest: limits, class-K function, goals, start, nominal."""

from __future__ import annotations

from math import radians
from typing import Any

import numpy as np

from testbed.verification import deconfliction, drawing, fleet, guidance_laws
from testbed.verification.future import Pose
from testbed.verification.recorded import Array

Scenario = dict[str, Any]
CHANNELS = ("v", "omega", "zeta")
# Kinds of filters that solve one QP in one place, which hears of every vehicle over a link.
CENTRAL = ("centralised", "optimal-decay")


def box(s: Scenario) -> tuple[Array, Array]:
    """Least and greatest (v, omega, zeta) that may be commanded of each vehicle, (N, 3) each."""
    corners = []
    for b in fleet.limits(s):
        turn, climb = radians(b["omega_max_degps"]), b["zeta_max_mps"]
        corners.append(((b["v_min_mps"], -turn, -climb), (b["v_max_mps"], turn, climb)))
    low, high = np.array(corners, dtype=float).transpose(1, 0, 2)
    return low, high


def inside(u: Array, low: Array, high: Array) -> Array:
    """How far inside the limits (..., 3) u lies, as a share of their range, (...)."""
    span = np.where(high > low, high - low, 1.0)
    return np.asarray((np.minimum(u - low, high - u) / span).min(axis=-1))


def alpha(s: Scenario, h: Array) -> Array:
    """alpha(h), of h's shape."""
    a = s["alpha"]
    if a["kind"] == "odd-polynomial":
        return np.asarray(sum(c * h ** (2 * k + 1) for k, c in enumerate(a["coefficients"])))
    return np.asarray(a["coefficient"] * h ** {"linear": 1, "cubic": 3}[a["kind"]])


def steepness(s: Scenario, h: Array) -> Array:
    """d alpha/dh, of h's shape."""
    a = s["alpha"]
    if a["kind"] == "odd-polynomial":
        terms = enumerate(a["coefficients"])
        return np.asarray(sum((2 * k + 1) * c * h ** (2 * k) for k, c in terms))
    return np.asarray(a["coefficient"] * {"linear": 1.0 + 0.0 * h, "cubic": 3.0 * h**2}[a["kind"]])


def goals(s: Scenario) -> Array:
    """(N, 3) m: listed, drawn, or the antipodes of a circle whose first vehicle is in the west.

    A vehicle's own goal is its table's, or the last of its waypoints.
    """
    start, n = s["start"], s["vehicles"]
    if start["pattern"] in drawing.PATTERNS:
        made = drawing.places(s)[1].copy()
    elif start["pattern"] == "list":
        made = np.array([[p["goal_x_m"], p["goal_y_m"], p["goal_z_m"]] for p in start["places"]])
    else:
        angle = 2 * np.pi / n * np.arange(n)
        made = np.asarray(start["radius_m"] * np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=-1))
    own = fleet.tables(s)
    made[[("goal_x_m" in v) for v in own], 2] = 0.0
    made = np.stack([_said(own, f"goal_{a}_m", made[:, k]) for k, a in enumerate("xyz")], axis=-1)
    for k, law in enumerate(guidance_laws.tables(s)):
        if law["kind"] == "waypoints" and not law["closed"] and "goal_x_m" not in own[k]:
            made[k] = law["waypoints_m"][-1][:3]
    return made


def _said(own: list[Scenario], name: str, others: Array) -> Array:
    """A number of each vehicle (N,), where its table says it."""
    return np.array([v.get(name, x) for v, x in zip(own, others, strict=True)], dtype=float)


def seeking(s: Scenario) -> Array:
    """(N,) whether each vehicle has a goal: its guidance flies to one, or its table gives one."""
    tables, laws = fleet.tables(s), guidance_laws.tables(s)
    return np.array(
        [guidance_laws.seeks_goal(law) or "goal_x_m" in own for own, law in zip(tables, laws, strict=True)]
    )


def start(s: Scenario) -> Pose:
    """Where the vehicles begin (N,), drawn from the seed's first stream."""
    a, n = s["start"], s["vehicles"]
    if a["pattern"] in drawing.PATTERNS:
        at = drawing.places(s)[0]
        (x, y, z), course = at.position.T, np.degrees(at.theta)
    elif a["pattern"] == "list":
        x, y, z = (np.array([p[key] for p in a["places"]], dtype=float) for key in ("x_m", "y_m", "z_m"))
        course = np.array([p["course_deg"] for p in a["places"]], dtype=float)
    else:
        angle = 2 * np.pi / n * np.arange(n)
        x, y = -a["radius_m"] * np.cos(angle), -a["radius_m"] * np.sin(angle)
        course = np.degrees(angle) + a["course_offset_deg"]
        z = np.resize(np.asarray(a["heights_m"], dtype=float), n)
    own = fleet.tables(s)
    z = _said(own, "z_m", np.where(["x_m" in v for v in own], 0.0, z))
    x, y, course = _said(own, "x_m", x), _said(own, "y_m", y), _said(own, "course_deg", course)
    if a["round_decimals"] is not None:
        x, y, course = (np.round(q, a["round_decimals"]) for q in (x, y, course))
    drawn = np.random.default_rng(np.random.SeedSequence(s["seed"]).spawn(1)[0]).uniform(-1.0, 1.0, (3, n))
    aside, turned, up = (
        share * a[most] + (np.asarray(a[listed]) if a[listed] else 0.0)
        for share, most, listed in zip(
            drawn,
            ("lateral_perturbation_m", "heading_perturbation_deg", "height_perturbation_m"),
            ("lateral_offsets_m", "heading_offsets_deg", "height_offsets_m"),
            strict=True,
        )
    )
    theta = np.radians(course)
    position = np.stack([x - aside * np.sin(theta), y + aside * np.cos(theta), z + up], axis=-1)
    return Pose(position, theta + np.radians(turned))


def arc(pose: Pose, rates: Array, dt: Array | float) -> Pose:
    """Where vehicles at `pose` (...) are after dt of flight at `rates` (..., 3): chords of their arcs."""
    v, omega, zeta = np.moveaxis(rates, -1, 0)
    turned = omega * dt
    chord, towards = v * dt * np.sinc(turned / (2 * np.pi)), pose.theta + 0.5 * turned
    moved = np.stack([chord * np.cos(towards), chord * np.sin(towards), zeta * dt], axis=-1)
    return Pose(pose.position + moved, pose.theta + turned)


def nominal(s: Scenario, t: Array, pose: Pose, gamma: Array, complete: bool) -> Array:
    """What guidance wants (T, N, 3) at times t (T,) and poses (T, N); nan where nothing tells.

    complete  whether these are all filter steps: only then the leg of a vehicle among waypoints is known
    """
    each, to = guidance_laws.tables(s), goals(s)
    circles = (s.get("goal") or {}).get("on_arrival") == "loiter"
    if (
        circles
        or any(table != each[0] for table in each)
        or each[0]["kind"] not in ("near-identity", "manoeuvre")
    ):
        found = np.full((*pose.theta.shape, 3), np.nan)
        for k, table in enumerate(each):
            if table["kind"] in deconfliction.KINDS:
                if complete:
                    east, north, up = pose.position[:, k].T
                    now = east + 1j * north, up, pose.theta[:, k]
                    turn = gamma[k] if gamma.ndim == 2 else gamma
                    begin = start(s).position if table["kind"] == "layers" else to
                    found[:, k] = deconfliction.wanted(s, k, each, t, now, begin, to, turn)
            elif table["kind"] == "manoeuvre":
                found[:, k] = gamma[k] if gamma.ndim == 2 else gamma
            elif complete or table["kind"] != "waypoints":
                place = pose.position[:, k, 0] + 1j * pose.position[:, k, 1]
                now = place, pose.position[:, k, 2], pose.theta[:, k]
                found[:, k] = guidance_laws.wanted(s, k, table, t, now, to[k])
        if circles:
            _circle_goals(s, found, t, pose, gamma, complete)
        return found
    c = each[0]
    if c["kind"] == "manoeuvre":
        return np.broadcast_to(gamma, (*pose.theta.shape, 3))
    to = c["gain_per_s"] * (goals(s) - pose.position)
    ahead = np.exp(1j * pose.theta)
    wanted = (to[..., 0] + 1j * to[..., 1]) / ahead
    return np.stack([wanted.real, wanted.imag / c["lookahead_m"], to[..., 2]], axis=-1)


def _circle_goals(s: Scenario, found: Array, t: Array, pose: Pose, gamma: Array, complete: bool) -> None:
    """Put into `found` what vehicles want that circle their goal, from the step at which they are there."""
    to, due, (low, high) = goals(s), seeking(s), box(s)
    if not complete:
        found[:, due] = np.nan
        return
    there = np.linalg.norm(pose.position - to, axis=-1) <= s["goal_radius_m"]
    none = bool(s["barrier"].get("pairs"))
    for k in np.flatnonzero(due & there.any(axis=0)):
        first = int(np.argmax(there[:, k]))
        v, turn = (low[k, 0], 0.0) if none else np.clip(gamma[k], low[k], high[k])[:2]
        turn = turn if abs(turn) > 1e-9 else max(high[k, 1], 1e-6) / 2.0
        table = guidance_laws.COMMON | {
            "kind": "loiter", "centre_m": list(to[k, :2]), "radius_m": v / abs(turn), "speed_mps": v,
            "sense": "left" if turn > 0 else "right", "height_m": to[k, 2], "approach_m": None,
        }  # fmt: skip
        place = pose.position[first:, k, 0] + 1j * pose.position[first:, k, 1]
        now = place, pose.position[first:, k, 2], pose.theta[first:, k]
        found[first:, k] = guidance_laws.wanted(s, int(k), table, t[first:], now, to[k])


def filters_own(s: Scenario) -> Scenario:
    """The scenario whose barrier the filter uses: its Ds and manoeuvre changed by the remedies."""
    r, b = s["remedy"], s["barrier"]

    def derated(m: Scenario) -> Scenario:
        share = {"v_mps": r["derate_speed"], "omega_degps": r["derate"]}
        return m | {name: m[name] * of for name, of in share.items() if name in m}

    b = derated(b) | {name: [derated(m) for m in b[name]] for name in ("pairs", "manoeuvres") if name in b}
    if r["smoothing_m2"]:
        b |= {"smoothing_m2": r["smoothing_m2"], "delta_m2": 0.0}
    return s | {"barrier": b, "d_safe_m": s["d_safe_m"] + r["ds_buffer_m"]}


def margin(s: Scenario, lie: Array) -> Array:
    """What the remedies raise one side's row by, of its L_g h (3, ...)."""
    r = s["remedy"]
    bounds = (r["robust_v_mps"], radians(r["robust_omega_degps"]), r["robust_zeta_mps"])
    raised = sum(bound * np.abs(x) for bound, x in zip(bounds, lie, strict=True))
    if r["issf_epsilon"] is not None:
        scale = (r["issf_v_mps"], radians(r["issf_omega_degps"]), r["issf_zeta_mps"])
        raised = raised + sum((w * x) ** 2 for w, x in zip(scale, lie, strict=True)) / r["issf_epsilon"]
    return np.asarray(raised)


def errs(measured: Scenario) -> bool:
    """Whether the table [sensing] has an error other than 0; its range is none."""
    sizes = {name: value for name, value in measured.items() if name != "range_m"}
    return any(value for name, value in sizes.items() if name.endswith(("_m", "_deg", "_mps", "_degps")))


def knows_itself(s: Scenario) -> bool:
    """Whether every vehicle knows its own pose as it is."""
    m, link = s["sensing"], s["network"]
    exact = not errs(m)
    central = s["filter"]["kind"] in CENTRAL
    return exact and not m["delay_s"] and not (central and (link["latency_s"] or link["loss"]))
