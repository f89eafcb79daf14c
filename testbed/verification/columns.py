"""Checks the recorded columns against each other and the scenario: start, motion, nominal input, pairs."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from testbed.verification import fleet
from testbed.verification.air import all_gusts, wind
from testbed.verification.finding import Finding, compared
from testbed.verification.future import Pose
from testbed.verification.guidance_columns import guidance
from testbed.verification.near import told
from testbed.verification.optimality import minimal
from testbed.verification.pair_claims import Pairs, unicycle
from testbed.verification.path_bounds import PathBounds, resolved
from testbed.verification.recorded import Array, Recorded
from testbed.verification.rows import Rows
from testbed.verification.settings import CENTRAL, arc, box, knows_itself, start
from testbed.verification.telemetry import telemetry

ROUNDING = 1e-6
OVERRIDE = 1e-6
# What the mean of two velocities may be off: of the second difference beside it, and of the sum of both, by
# which an acceleration jumps in the step between. One velocity that is forged has half the sum of its own.
BEND, JUMP = 0.2, 0.4
# Of turn rates, beside what their changes around allow: an aircraft's shakes, more so in gusts [rad/s].
TURN_RADPS = {False: 2e-3, True: 0.03}
PER_GUST_RADPS = 0.03
# Of a start: to rounding, and on an aircraft, whose place on the earth is an angle, a tenth of a millimetre.
START = {False: 1e-9, True: 1e-4}


def columns(run: Recorded, paths: PathBounds, pairs: Pairs | None, rows: Rows) -> Iterator[Finding]:
    yield _numbers(run)
    yield ending(run)
    if "plant" not in run.parts:
        yield from _start(run)
    if len(run.t) > 1:
        yield _motion(run, paths)
        yield _course(run)
        if "plant" not in run.parts:
            yield _plant(run)
    yield from guidance(run)
    yield from _override(run)
    if fleet.strangers(run.scenario):
        yield _intruders(run)
    yield minimal(rows)
    yield from wind(run)
    yield from telemetry(run)
    if run.i.size:
        yield from _pairs(run, pairs, rows)


def _numbers(run: Recorded) -> Finding:
    """Numbers are recorded where numbers are due: what is not comparable would agree with anything."""
    channels = [run.channels(suffix) for suffix in ("", "_nominal", "_command")]
    due = {"poses": [run.position, run.vehicles["theta_rad"]], "rates and commands": channels}
    if run.i.size:
        there = ~run.apart() if run.near is None else run.near
        due["distances and h"] = [run.pairs[name][there] for name in ("distance_m", "h_m")]
    bad = [name for name, arrays in due.items() if not all(np.isfinite(a).all() for a in arrays)]
    said = ", ".join(bad)
    return Finding(
        "numbers", "all finite", said or "all finite", not bad, None, said and f"not finite: {said}"
    )


def ending(run: Recorded) -> Finding:
    """The run ended when the manifest says, after as many filter steps."""
    s, dt = run.scenario, run.scenario["rates"]["filter_dt_s"]
    record, steps = s["rates"]["record_dt_s"], run.manifest.get("filter_steps")
    said = "early" if run.ended else f"{s['duration_s']:g} s"
    due = round(s["duration_s"] / dt) + 1
    wrong = []
    if run.ended:
        told = re.search(r"(?:at|by) ([\d.]+) s(?:; run stopped|, the run ended there)", run.ended)
        if told is None:
            wrong.append("no time of the end is given")
        else:
            due = round(float(told.group(1)) / dt)
    rows = (due - 1) // round(record / dt) + 1
    if len(run.t) != rows:
        wrong.append(f"{len(run.t)} instants are recorded, should be {rows}")
    if steps != due:
        wrong.append(f"filter_steps is {steps}, should be {due}")
    own = f"{run.t[-1]:g} s recorded" if len(run.t) else "nothing recorded"
    return Finding("end", said, own, not wrong, None, "; ".join(wrong))


def _start(run: Recorded) -> Iterator[Finding]:
    """Where the vehicles begin, and how fast those fly that do not follow the first command at once."""
    due = start(run.scenario)
    position, theta = run.position[0], run.vehicles["theta_rad"][0]
    turned = np.abs(np.angle(np.exp(1j * (theta - due.theta))))
    off = np.maximum(np.linalg.norm(position - due.position, axis=-1), turned)
    aircraft = run.scenario["plant"] == "jsbsim"
    yield compared("start", np.zeros_like(off), off, START[aircraft])
    if run.scenario["plant"] != "unicycle":
        speed = fleet.said(run.scenario, "speed_mps", run.scenario["start"]["speed_mps"])
        yield compared("start-speed", run.vehicles["v_mps"][0], speed, START[aircraft] * 10)


def _motion(run: Recorded, paths: PathBounds) -> Finding:
    """Positions follow from commands on a unicycle; from speeds, courses and climb rates on any plant."""
    position, theta = run.position, run.vehicles["theta_rad"]
    dt = np.diff(run.t)[:, None]
    if unicycle(run) and run.complete:
        then = arc(Pose(position[:-1], theta[:-1]), run.command[:-1], dt)
        off = np.linalg.norm(position[1:] - then.position, axis=-1) + np.abs(theta[1:] - then.theta)
        off = off + np.abs(run.rates[1:] - run.command[:-1]).max(axis=-1)
        return compared("motion", np.zeros_like(off), off, 1e-9 * (1.0 + np.abs(position[1:]).max()))
    velocity = run.velocity
    off = np.linalg.norm(
        np.diff(position, axis=0) - 0.5 * dt[..., None] * (velocity[:-1] + velocity[1:]), axis=-1
    )
    return compared("motion", np.zeros_like(off), off, _strays(run, paths, velocity, dt))


def _strays(run: Recorded, paths: PathBounds, velocity: Array, dt: Array) -> Array:
    """How far the mean of two velocities may be from the flight between them (T - 1, N) [m].

    An aircraft's velocity bends by a twelfth of its second difference (a tenth at most in runs of both
    airframes), or by a third of the jump of acceleration that a command makes; where gusts and noise shake
    it, by what it changes around. Else it may be all that is allowed.
    """
    s, change = run.scenario, np.linalg.norm(np.diff(velocity, axis=0), axis=-1)
    if not resolved(run):
        return np.asarray(2.0 * paths.stray[: len(change)] + change * dt + ROUNDING)
    gusts = s["gusts"]
    shaken = gusts["intensity"] != "none" or gusts["jsbsim_turbulence"] != "none" or gusts["sigma_mps"]
    if shaken or s["plant"] != "jsbsim" or not knows_itself(s) or len(velocity) < 3:
        return np.asarray((paths.changing + 1e-3) * dt)
    second = np.diff(velocity, 2, axis=0)
    before, after = np.concatenate([second[:1], second]), np.concatenate([second, second[-1:]])
    around = np.maximum(np.linalg.norm(before, axis=-1), np.linalg.norm(after, axis=-1))
    jump = np.linalg.norm(before + after, axis=-1)
    return np.asarray((np.maximum(BEND * around, JUMP * jump) + 2e-3) * dt)


def _override(run: Recorded) -> Iterator[Finding]:
    """The flag says whether the filter changed the command beyond what the limits force."""
    change = np.abs(run.command - np.clip(run.channels("_nominal"), *box(run.scenario))).max(axis=-1)
    change = np.where(run.present, change, 0.0)
    said = run.vehicles["override"].astype(bool)
    wrong = (said != (change > OVERRIDE)) & (np.abs(change - OVERRIDE) > 1e-9)
    note = f"{int(wrong.sum())} flags differ" if wrong.any() else ""
    altered = f"{int((change > OVERRIDE).sum())} altered"
    yield Finding("override", f"{int(said.sum())} flags", altered, not note, None, note)
    if run.complete:
        shares = np.asarray(run.manifest["override_share"], dtype=float)
        yield compared("override_share", shares, said.mean(axis=0), 1e-9)


def _intruders(run: Recorded) -> Finding:
    """Intruders fly what they want inside their limits, and no QP stands behind it."""
    who = ~fleet.under(run.scenario)
    off = np.abs(run.command - np.clip(run.channels("_nominal"), *box(run.scenario))).max(axis=-1)[:, who]
    odd = int((run.vehicles["qp_status"][:, who] != "none").sum())
    wrong = [f"{int((off > 0.0).sum())} commands are altered"] if off.max(initial=0.0) > 0.0 else []
    wrong += [f"{odd} have a QP status"] if odd else []
    return Finding("intruders", f"{int(who.sum())} vehicles", "as wanted", not wrong, None, "; ".join(wrong))


def _course(run: Recorded) -> Finding:
    """Turn rates are the rates at which courses turn, as far as both are resolved."""
    theta, omega, dt = run.vehicles["theta_rad"], run.vehicles["omega_radps"], np.diff(run.t)[:, None]
    turned = np.diff(theta, axis=0) / dt
    if unicycle(run):
        if run.complete:
            return compared("course", omega[1:], turned, 1e-9 / dt + 1e-9 * np.abs(turned))
        off = np.ptp(np.stack(box(run.scenario))[..., 1]) + np.zeros_like(turned)
        return compared("course", 0.5 * (omega[1:] + omega[:-1]), turned, off)
    change = np.abs(np.diff(omega, axis=0))
    padded = np.concatenate([change[:1], change, change[-1:]])
    around = np.maximum(np.maximum(padded[:-2], padded[1:-1]), padded[2:])
    if not resolved(run):
        around = around + np.ptp(np.stack(box(run.scenario))[..., 1])
    within = TURN_RADPS[run.scenario["plant"] == "jsbsim"] + PER_GUST_RADPS * all_gusts(run.scenario)
    return compared("course", 0.5 * (omega[1:] + omega[:-1]), turned, around + within)


def _plant(run: Recorded) -> Finding:
    """A plant that is said to lag does not fly its commands at once."""
    lagged = run.scenario["plant"] == "lagged"
    exact = run.complete and bool(np.array_equal(run.rates[1:], run.command[:-1]))
    steady = not np.any(np.diff(run.command, axis=0))
    lags = run.scenario["lags"]
    none = lags["source"] == "table" and not any(
        lags[f"{c}_time_constant_s"] is None or lags[f"{c}_time_constant_s"] or lags[f"{c}_delay_s"]
        for c in ("v", "omega", "zeta")
    )
    wrong = lagged and exact and not steady and not none
    why = "commands are flown at once" if wrong else ""
    return Finding("plant", run.scenario["plant"], "at once" if exact else "late", not wrong, None, why)


def _pairs(run: Recorded, pairs: Pairs | None, rows: Rows) -> Iterator[Finding]:
    table = run.pairs
    distance = np.linalg.norm(run.position[:, run.i] - run.position[:, run.j], axis=-1)
    yield compared("distance_m", told(run, table["distance_m"], distance), distance, ROUNDING)
    if pairs is None:
        yield Finding(
            "h_m",
            f"{table['h_m'].size} values",
            "unknown",
            None,
            None,
            "verification does not cover this manoeuvre",
        )
        return
    now = pairs.now
    yield compared("h_m", told(run, table["h_m"], now.h), now.h, now.off + 1e-9)
    u_i, u_j = run.command[:, run.i], run.command[:, run.j]
    predicted, off = now.hdot(u_i, u_j)
    # A kink's gradient is any of many.
    said = told(run, table["hdot_predicted_mps"], predicted)
    yield compared("hdot_predicted", said, predicted, off + 1e-9 * (1.0 + np.abs(predicted)))
    yield _realised(run, pairs)
    yield from _residuals(run, pairs)
    yield _filters(run, rows)


def _filters(run: Recorded, rows: Rows) -> Finding:
    """h as the filter saw it; nan of a filter that has none."""
    said = run.pairs["h_filter_m"]
    if run.scenario["filter"]["kind"] not in (*CENTRAL, "limited") or "filter" in run.parts:
        bare = bool(np.isnan(said).all()) or "filter" in run.parts
        return Finding("h_filter_m", "no h" if bare else f"{said.size} values", "no h", bare)
    if rows.own is None:
        why = rows.seen if isinstance(rows.seen, str) else "verification does not cover this manoeuvre"
        return Finding("h_filter_m", f"{said.size} values", "unknown", None, None, why)
    said = told(run, said, rows.own.h)
    if rows.apart is None:
        return compared("h_filter_m", said, rows.own.h, rows.own.off + 1e-9)
    # Of pairs that did not know of each other the filter had no h.
    apart = rows.apart & ~run.apart()
    odd = int((np.isnan(said) != apart).sum())
    if odd:
        words = f"{odd} values are there, or missing, of pairs whose range says otherwise"
        return Finding("h_filter_m", f"{said.size} values", "by range", False, None, words)
    off = np.where(apart, np.inf, rows.own.off + 1e-9)
    return compared("h_filter_m", np.where(apart, rows.own.h, said), rows.own.h, off)


def _realised(run: Recorded, pairs: Pairs) -> Finding:
    """Change of h over the filter period that follows; unknown after the last step."""
    said = run.pairs["hdot_realised_mps"]
    then, some, _ = pairs.after
    if then is None:
        why = "the steps that follow recorded instants are not recorded"
        return Finding("hdot_realised", f"{said.size} values", "unknown", None, None, why)
    dt = run.scenario["rates"]["filter_dt_s"]
    own, off = (then.h - pairs.now.h[some]) / dt, (then.off + pairs.now.off[some] + 1e-9) / dt
    return compared("hdot_realised", told(run, said[some], own, ahead=True), own, off)


def _residuals(run: Recorded, pairs: Pairs) -> Iterator[Finding]:
    """The ledger's channels: what errors of the rates flown made of hdot."""
    if not run.complete or len(run.t) < 2:
        return
    flown, dt = 0.5 * (run.rates[1:] + run.rates[:-1]), run.scenario["rates"]["filter_dt_s"]
    error = flown - run.command[:-1]
    drift = np.zeros(error.shape[:2])
    if "heading_rad" in run.vehicles:
        turned = np.diff(run.vehicles["heading_rad"], axis=0)
        drift = flown[..., 1] - np.angle(np.exp(1j * turned)) / dt
    by = {"v": error[..., 0], "omega": error[..., 1] - drift, "zeta": error[..., 2], "course": drift}
    for name, x in by.items():
        k = {"v": 0, "omega": 1, "zeta": 2, "course": 1}[name]
        own, off = np.zeros(pairs.now.h[:-1].shape), np.zeros(pairs.now.h[:-1].shape)
        for side, vehicle in enumerate((run.i, run.j)):
            own = own + pairs.now.lie[side, k, :-1] * x[:, vehicle]
            off = off + pairs.now.lie_off[side, k, :-1] * np.abs(x[:, vehicle])
        # The heading's change is a difference of recorded angles.
        turn = np.abs(pairs.now.lie[:, k, :-1]).sum(axis=0) * 1e-12 / dt
        said = told(run, run.pairs[f"residual_{name}_mps"][:-1], own, ahead=True)
        yield compared(f"residual_{name}", said, own, off + turn + 1e-9 * (1.0 + np.abs(own)))
