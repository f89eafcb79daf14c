"""Checks the flow filter's claims F1 to F3: flies the lagging vehicles on in steps of 5 ms.

Every channel is stepped by the law of a first-order lag after a delay with a bounded rate, each step split
where a new command is heard; positions are summed over the steps. Once all channels have settled, what is
left is two circles flown in step.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from testbed.verification import fleet
from testbed.verification.filter_view import airframe_folder, lags
from testbed.verification.finding import Finding, Judge, Values
from testbed.verification.future import manoeuvre
from testbed.verification.monitor_claims import follows
from testbed.verification.recorded import Array, Recorded
from testbed.verification.rows import Rows

CLEAR, STEP, WIND = "monitor-flow_clear", "monitor-flow_step", "monitor-flow_wind"
BOUNDS = {CLEAR: 0.0, STEP: -2e-3}
SPARE_MPS = 1.0

STEP_S = 0.005
# What stands for no lag [s], and for rates of change without a limit.
NO_LAG_S, NO_LIMIT = 1e-9, 1e9
# Time constants after which nothing is left of a lag.
TAIL = 14.0
# What steps of 5 ms may have done to a distance along the flow [m].
OFF_M = 0.02
MOST = 60_000  # vehicles times instants flown on at once


@dataclass(frozen=True)
class Lagging:
    """Channels (N, 3): time constants and delays [s], and largest falls and rises, both positive."""

    constant: Array
    delay: Array
    fall: Array
    rise: Array

    @classmethod
    def of(cls, known: Array) -> Lagging:
        """From (N, 3, 4), see `filter_view.lags`."""
        constant, delay, fall, rise = np.moveaxis(known, -1, 0)
        fall, rise = np.minimum(fall, NO_LIMIT), np.minimum(rise, NO_LIMIT)
        return cls(np.maximum(constant, NO_LAG_S), delay, fall, rise)

    def under(self, slew: Array) -> Lagging:
        """Of commands that change by `slew` (3,) a second at most: a lag lets a ramp through, later."""
        some = slew < np.inf
        return Lagging(
            np.where(some, NO_LAG_S, self.constant),
            self.delay + np.where(some, self.constant, 0.0),
            np.where(some, slew, self.fall),
            np.where(some, slew, self.rise),
        )

    def stepped(self, y: Array, told: Array, long: Array | float) -> Array:
        """The channels (..., N, 3) after `long` [s] under commands `told`."""
        free = (told - y) * -np.expm1(-long / self.constant)
        return y + np.clip(free, -self.fall * long, self.rise * long)


def flow_claims(rows: Rows) -> Iterator[Finding]:
    """The findings of F1, F2 and F3."""
    run = rows.run
    if WIND in run.guarantees:
        yield _wind(run, Judge(run, run.guarantees[WIND]))
    names = [id for id in BOUNDS if id in run.guarantees]
    if not names:
        return
    why = rows.untold
    known = model_lags(rows.s)
    if not why and known is None:
        why = "the lags of the model are not to be found"
    slew = slews(rows.s)
    most = slew * rows.s["rates"]["filter_dt_s"] + 1e-9
    if not why and (np.abs(np.diff(run.command, axis=0)) > most).any():
        why = "commands change faster than the filter says that they may"
    least = None if why or known is None else _clearances(run, Lagging.of(known).under(slew))
    for id in names:
        judge = Judge(run, run.guarantees[id])
        follows(judge, BOUNDS[id])
        if least is None:
            yield judge.done("unknown", None, True, why)
        else:
            yield _judged(run, judge, least)


def model_lags(s: dict[str, Any]) -> Array | None:
    """Of the filter's model; on a unicycle there are none, unless a table says some."""
    if s["plant"] == "unicycle" and s["lags"]["source"] == "airframe":
        return np.tile([0.0, 0.0, np.inf, np.inf], (s["vehicles"], 3, 1))
    return lags(s)


def slews(s: dict[str, Any]) -> Array:
    """What the filter's commands change by at most (3,) a second."""
    said = (s["filter"].get("speed_slew_mps2"), None, s["filter"].get("climb_slew_mps2"))
    return np.array([np.inf if x is None else x for x in said])


def _wind(run: Recorded, judge: Judge) -> Finding:
    """F3, from the airframes' files."""
    s = run.scenario
    follows(judge, 0.0, premise=True)
    if s["plant"] != "jsbsim":
        return judge.nothing("never met")
    found = []
    for name, v in zip(fleet.airframes(s), manoeuvre(s)[:, 0], strict=True):
        try:
            file = airframe_folder(s, name.partition("@")[0]) / "airframe.toml"
            said = tomllib.loads(file.read_text(encoding="utf-8-sig"))["gains"]["envelope"]
            least = said["airspeed_min_mps"]
        except (OSError, ValueError, KeyError, TypeError):
            return judge.done("unknown", None, True, "the airframe's least airspeed is not to be found")
        found.append(v - s["wind"]["speed_mps"] - least - SPARE_MPS)
    judge.expect_near("value", judge.entry["value"], min(found), 1e-9)
    return judge.done(f"{min(found):.6g}", 1e-9)


def _judged(run: Recorded, judge: Judge, least: Array) -> Finding:
    """Against the least clearances (T, P) m."""
    who = [[int(a) + 1, int(b) + 1] for a, b in zip(run.i, run.j, strict=True)]
    counts, doubtful = np.ones(least.shape, dtype=bool), np.zeros(least.shape, dtype=bool)
    value, off = least, OFF_M
    if judge.entry["id"] == STEP:
        before = np.vstack([np.full(least[:1].shape, -np.inf), least[:-1]])
        counts, doubtful = before >= 0, np.abs(before) < OFF_M
        value, off = least - (1 - run.scenario["filter"]["kappa"]) * np.where(counts, before, 0.0), 2 * OFF_M
    seen = Values.of(run.t, value, off, who, counts, doubtful)
    low, high = seen.range()
    said = judge.entry["value"]
    if said is None:
        if high < np.inf:
            judge.wrong.append(f"no value, should be {high:.6g}")
    elif not low <= said <= high:
        judge.wrong.append(f"value is {said:.6g}, should be {low:.6g} to {high:.6g}")
    else:
        here = seen.at(judge.entry["t_s"], judge.entry["vehicles"])
        if here is None or abs(here[0] - said) > here[1]:
            judge.wrong.append(f"not the value at {judge.entry['t_s']:g} s of {judge.entry['vehicles']}")
    return judge.done(f"{seen.least():.6g}" if high < np.inf else "never met", OFF_M)


def _clearances(run: Recorded, lagging: Lagging) -> Array:
    """The least clearance (T, P) m of every pair along the flow of gamma from every recorded instant."""
    s, dt = run.scenario, run.scenario["rates"]["filter_dt_s"]
    depth = int(np.ceil(lagging.delay.max() / dt + 1e-9)) + 1
    # Before the start all were told what they flew then.
    told = np.concatenate([np.repeat(run.rates[:1], depth, axis=0), run.command])
    rates = believed(run.rates, told, lagging, dt, s["filter"].get("trust", 1.0))
    level = s["d_safe_m"] + margin(run)
    every = max(1, MOST // s["vehicles"])
    parts = []
    for k in range(0, len(run.t), every):
        here = slice(k, k + every)
        # What has been told by then: depth commands, the latest last; this step's own is still to come.
        late = np.stack([told[k + m : k + m + every][: len(run.t[here])] for m in range(depth)])
        parts.append(_flown_on(run, here, rates[here], late, lagging, dt))
    return np.concatenate(parts) - level


def margin(run: Recorded) -> float:
    """m [m]: the scenario's, or what the run says that it was identified as."""
    said = run.scenario["filter"]["margin_m"]
    return float(run.manifest["flow"]["margin_m"] if isinstance(said, str) else said)


def believed(seen: Array, told: Array, lagging: Lagging, dt: float, trust: float) -> Array:
    """The rates (T, N, 3) that the filter starts from: the model's, drawn a share towards those seen."""
    depth, found = len(told) - len(seen), seen.copy()
    for k in range(1, len(seen)):
        # From instant k - 1 to k, with what had been told up to k - 1.
        late = told[k : k + depth][:, None]
        modelled, _ = period(found[k - 1][None], late, lagging, dt, 0)
        found[k] = modelled[0] + trust * (seen[k] - modelled[0])
    return found


def period(y: Array, told: Array, lagging: Lagging, dt: float, ahead: int) -> tuple[Array, Array]:
    """Channels (..., N, 3) one period later, and their values (K + 1, ..., N, 3) in steps of it.

    told   (D, ..., N, 3), one command a period, the last begins with the period numbered 0
    ahead  the number of this period
    """
    steps = max(2, round(dt / STEP_S))
    long, values = dt / steps, [y]
    for m in range(steps):
        # In periods from the one numbered 0, when what is heard was said.
        begin = (ahead * dt + m * long - lagging.delay) / dt
        old = np.floor(begin + 1e-9)
        rest = np.clip((old + 1 - begin) * dt, 0.0, long)  # until the next one is heard
        first, then = (_said(told, old + shift) for shift in (0, 1))
        y = lagging.stepped(lagging.stepped(y, first, rest), then, long - rest)
        values.append(y)
    return y, np.stack(values)


def _said(told: Array, period: Array) -> Array:
    """What channels were told in a period (N, 3) counted from the last one's; the last goes on for ever."""
    at = np.clip(period.astype(int) + len(told) - 1, 0, len(told) - 1)
    found = np.empty(told.shape[1:])
    for v, c in np.ndindex(at.shape):
        found[..., v, c] = told[at[v, c], ..., v, c]
    return found


def _flown_on(run: Recorded, here: slice, rates: Array, late: Array, lagging: Lagging, dt: float) -> Array:
    """Least distances (S, P) m from the instants `here` on."""
    gamma = manoeuvre(run.scenario)
    told = np.concatenate([late, np.broadcast_to(gamma, (1, *late.shape[1:]))])
    place = run.position[here][..., 0] + 1j * run.position[here][..., 1]
    height, theta = run.position[here][..., 2].copy(), run.vehicles["theta_rad"][here].copy()
    y, i, j = rates, run.i, run.j
    least = np.full((len(place), i.size), np.inf)
    gap = np.abs(rates - gamma).max(axis=0, initial=0.0)
    slowest = np.minimum(lagging.fall, lagging.rise)
    # Without a lag the whole of a step has its last value.
    at_once = (lagging.constant <= NO_LAG_S) & (slowest >= NO_LIMIT)
    settled = 2 * lagging.delay + dt + 2 * gap / slowest + TAIL * lagging.constant
    for ahead in range(int(np.ceil(settled.max() / dt)) + 1):
        y, values = period(y, told, lagging, dt, ahead)
        long = dt / (len(values) - 1)
        for a, b in pairwise(values):
            mean = np.where(at_once, b, 0.5 * (a + b))
            turned = theta + 0.5 * mean[..., 1] * long
            place = place + mean[..., 0] * long * np.exp(1j * turned)
            theta, height = theta + mean[..., 1] * long, height + mean[..., 2] * long
        apart = np.abs(place[:, i] - place[:, j]) ** 2 + (height[:, i] - height[:, j]) ** 2
        least = np.minimum(least, apart)
    arm = -1j * gamma[:, 0] / gamma[:, 1] * np.exp(1j * theta)
    centre = place - arm
    level = np.abs(np.abs(centre[:, i] - centre[:, j]) - np.abs(arm[:, i] - arm[:, j]))
    least = np.minimum(least, level**2 + (height[:, i] - height[:, j]) ** 2)
    return np.asarray(np.sqrt(least))
