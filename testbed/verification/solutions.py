"""Checks recorded QP statuses: a solved QP satisfies its rows, an infeasible one has no solution."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from testbed.claims import promises
from testbed.verification import fleet
from testbed.verification.filter_claims import FAILED, ROW_ALLOWED
from testbed.verification.finding import Finding
from testbed.verification.future import manoeuvre
from testbed.verification.recorded import Array
from testbed.verification.rows import Rows
from testbed.verification.settings import alpha, box, filters_own, margin

# Kinds of filters whose vehicles fly the evading manoeuvre where their QP has no solution.
EVADING = (*promises.ALWAYS_SOLVING, "flow")
# Of many QPs without a solution, so many are looked into.
LOOKED = 100


def solutions(rows: Rows) -> Iterator[Finding]:
    yield _statuses(rows)
    if not rows.solves or rows.own is None:
        return
    s = rows.s
    if s["filter"]["kind"] == "limited" and (s["network"]["latency_s"] or s["network"]["loss"]):
        late = "each vehicle saw late poses of the others"
        yield Finding("solutions", f"{int(rows.solved.sum())} solved", "no rows", None, None, late)
        return
    yield _solved(rows)
    if (rows.run.vehicles["qp_status"] == "infeasible").any():
        yield _unsolvable(rows)


def _statuses(rows: Rows) -> Finding:
    """Every QP has a known status; vehicles whose QP had no solution flew the evading manoeuvre."""
    run, s = rows.run, filters_own(rows.s)
    status = run.vehicles["qp_status"]
    kind = s["filter"]["kind"]
    solving = rows.solves or kind in (*promises.ALWAYS_SOLVING, *promises.SOLVING_AT_BEST)
    known = ["solved", *FAILED] if solving else ["none"]
    known += ["none"] if "filter" in run.parts else []
    odd = int((~np.isin(status, known) & run.present)[:, fleet.under(s)].sum())
    odd += int(((status != "none") & ~run.present).sum())
    failed, lost = np.isin(status, FAILED), 0
    evading = kind in EVADING and not (s["barrier"].get("pairs") or run.parts or s["remedy"]["air_mass"])
    if failed.any() and evading:
        gamma = np.clip(manoeuvre(s), *box(s))
        lost = int((failed & (np.abs(run.command - gamma).max(axis=-1) > 1e-9)).sum())
    words = [f"{odd} are not {' or '.join(known)}"] if odd else []
    words += [f"{lost} without a solution do not fly gamma"] if lost else []
    own = f"{int(failed.sum())} without a solution"
    return Finding("qp_status", f"{status.size} words", own, not words, None, "; ".join(words))


def _solved(rows: Rows) -> Finding:
    """The rows of everyone said to have a solution, raised by the remedies' margins, satisfied.

    Centralised: those of pairs that both have one. Limited: a vehicle's own half of each.
    """
    run, own, at = rows.run, rows.own, rows.solved
    assert own is not None
    _, off = rows.left
    if rows.s["filter"]["kind"] == "centralised":
        both = rows.answered[:, run.i] & rows.answered[:, run.j] & fleet.which(run, "judged")
        short = np.where(both, _joint(rows), -np.inf)
    else:
        halves = [_half(rows, side) for side in range(2)]
        short = np.maximum(
            *(np.where(at[:, v], x, -np.inf) for v, x in zip((run.i, run.j), halves, strict=True))
        )
    worst = max(float((short - off).max(initial=-np.inf)), _fences_short(rows))
    good = worst <= ROW_ALLOWED
    why = "" if good else f"a row is short by {worst:.3g} where a solution is claimed"
    tight = float(off.max(initial=0.0))
    return Finding(
        "solutions", f"{int(at.sum())} solved", f"short by {max(worst, 0.0):.2g}", good, tight, why
    )


def _fences_short(rows: Rows) -> float:
    """By how much the commands of vehicles with a solution leave rows of fences short, at most."""
    made = rows.fenced
    if made is None:
        return -np.inf
    asked, off = rows.fences_asked
    short = asked - made.hdot(rows.run.command) - off
    return float(np.where(rows.solved[:, made.vehicle], short, -np.inf).max(initial=-np.inf))


def _joint(rows: Rows) -> Array:
    """By how much the commands leave the pairs' rows short (T, P)."""
    left, _ = rows.left
    return np.asarray(margins(rows) - left)


def margins(rows: Rows) -> Array:
    """What the remedies raise the pairs' rows by (T, P): the sides under the filter."""
    own, under = rows.own, fleet.under(rows.s)
    assert own is not None
    of = ((own.lie[k], v) for k, v in enumerate((rows.run.i, rows.run.j)))
    return np.asarray(sum(np.where(under[v], margin(rows.s, lie), 0.0) for lie, v in of))


def _half(rows: Rows, side: int) -> Array:
    """By how much the commands leave one side's limited rows short (T, P); the other is taken to evade."""
    own, run = rows.own, rows.run
    assert own is not None
    vehicle = (run.i, run.j)[side]
    u = run.command[:, vehicle]
    return np.asarray(_asked(rows, side) - sum(own.lie[side, k] * u[..., k] for k in range(3)))


def _asked(rows: Rows, side: int) -> Array:
    """The right-hand side (T, P) of one side's limited rows."""
    own, run = rows.own, rows.run
    assert own is not None
    mine, other = (run.i, run.j)[side], (run.i, run.j)[1 - side]
    beside = ~fleet.under(rows.s)[other]
    gamma, others = _gamma(rows, mine), _gamma(rows, other)
    rest = -0.5 * alpha(rows.s, own.h) + margin(rows.s, own.lie[side])
    for k in range(3):
        rest = rest + 0.5 * (own.lie[side, k] * gamma[..., k] - own.lie[1 - side, k] * others[..., k])
    if beside.any():  # the row is all of this side's
        whole = margin(rows.s, own.lie[side]) - alpha(rows.s, own.h) - rows.assumed(1 - side)
        rest = np.where(beside, whole, rest)
    return np.asarray(rest)


def _gamma(rows: Rows, vehicle: Array) -> Array:
    """gamma (P, 3) of one side of every pair."""
    made = filters_own(rows.s)
    if not made["barrier"].get("pairs"):
        return manoeuvre(made)[vehicle]
    return np.array([[p["v_mps"], np.radians(p["omega_degps"]), 0.0] for p in made["barrier"]["pairs"]])


def _unsolvable(rows: Rows) -> Finding:
    """Where no solution is claimed, the largest common margin of the rows within the limits is below zero."""
    status = rows.run.vehicles["qp_status"] == "infeasible"
    if rows.s["filter"]["kind"] == "centralised":
        cases = [(int(k), np.flatnonzero(status[k])) for k in np.flatnonzero(status.any(axis=1))]
        room = [_room_of_all(rows, k, vehicles) for k, vehicles in cases[:LOOKED]]
    else:
        cases = [(int(k), np.array([v])) for k, v in np.argwhere(status)]
        room = [_room_of_one(rows, k, int(v[0])) for k, v in cases[:LOOKED]]
    most = max(room)
    good = most <= ROW_ALLOWED
    why = "" if good else f"inputs leave every row {most:.3g} of room where no solution is claimed"
    said = f"{len(cases)} QPs" if len(cases) <= LOOKED else f"first {LOOKED} of {len(cases)} QPs"
    return Finding("no-solutions", said, f"room {most:.3g} at most", good, ROW_ALLOWED, why)


def _room_of_all(rows: Rows, k: int, vehicles: Array) -> float:
    """Of the rows among vehicles (M,) at instant k, solved together."""
    own, run = rows.own, rows.run
    assert own is not None
    beside = ~fleet.under(rows.s)
    here = np.isin(np.arange(beside.size), vehicles)
    met = (here | beside)[run.i] & (here | beside)[run.j] & (here[run.i] | here[run.j])
    use = np.flatnonzero(met)
    matrix, asked = np.zeros((use.size, vehicles.size, 3)), (margins(rows) - alpha(rows.s, own.h))[k, use]
    for side, vehicle in enumerate((run.i, run.j)):
        mine = here[vehicle[use]]
        place = np.searchsorted(vehicles, vehicle[use][mine])
        matrix[np.flatnonzero(mine), place] = own.lie[side][:, k, use[mine]].T
        if not mine.all():
            asked = asked - np.where(mine, 0.0, rows.assumed(side)[k, use])
    more, due, _ = rows_of_fences(rows, k, vehicles)
    matrix = np.concatenate([matrix.reshape(use.size, 3 * vehicles.size), more])
    return _room(rows, vehicles, matrix, np.concatenate([asked, due]))


def _room_of_one(rows: Rows, k: int, vehicle: int) -> float:
    """Of one vehicle's own halves at instant k."""
    matrix, asked, _ = asked_of_one(rows, k, vehicle)
    return _room(rows, np.array([vehicle]), matrix, asked)


def asked_of_one(rows: Rows, k: int, vehicle: int) -> tuple[Array, Array, Array]:
    """A vehicle's limited rows at instant k: matrix (R, 3), right-hand sides and their errors (R,)."""
    own, run = rows.own, rows.run
    assert own is not None
    _, off = rows.left
    matrix, asked, wrong = [], [], []
    for side, of in enumerate((run.i, run.j)):
        use = np.flatnonzero(of == vehicle)
        matrix.append(own.lie[side][:, k, use].T)
        asked.append(_asked(rows, side)[k, use])
        wrong.append(off[k, use])
    more = rows_of_fences(rows, k, np.array([vehicle]))
    for listed, of_fences in zip((matrix, asked, wrong), more, strict=True):
        listed.append(of_fences)
    return np.concatenate(matrix), np.concatenate(asked), np.concatenate(wrong)


def rows_of_fences(rows: Rows, k: int, vehicles: Array) -> tuple[Array, Array, Array]:
    """The rows of fences over `vehicles` (M,) at instant k: matrix (R, 3 M), right-hand sides and errors."""
    made = rows.fenced
    if made is None:
        return np.zeros((0, 3 * vehicles.size)), np.zeros(0), np.zeros(0)
    asked, off = rows.fences_asked
    use = np.flatnonzero(np.isin(made.vehicle, vehicles))
    matrix = np.zeros((use.size, vehicles.size, 3))
    matrix[np.arange(use.size), np.searchsorted(vehicles, made.vehicle[use])] = made.lie[:, k, use].T
    return matrix.reshape(use.size, -1), asked[k, use], off[k, use]


def _room(rows: Rows, vehicles: Array, matrix: Array, asked: Array) -> float:
    """The largest t with matrix u >= asked + t for some u of the vehicles (M,) within their limits."""
    from scipy.optimize import linprog

    low, high = (corner[vehicles].ravel() for corner in box(rows.s))
    cost = np.zeros(matrix.shape[1] + 1)
    cost[-1] = -1.0
    bounds = [*zip(low, high, strict=True), (None, 1.0)]
    above = np.concatenate([-matrix, np.ones((len(asked), 1))], axis=1)
    # Rows are as large as levers and alpha make them: brought to one size, no input is lost.
    size = np.maximum(1.0, np.abs(above).max(axis=1, initial=1.0))[:, None]
    found = linprog(cost, above / size, -asked / size[:, 0], bounds=bounds)
    return float(found.x[-1]) if found.status == 0 else np.inf
