"""Checks that recorded commands are the nearest to the nominal input that the filter's rows and limits allow.

Karush-Kuhn-Tucker conditions: the change of the command is a sum, with factors not below zero, of the normals
of the rows and limits that it touches. Where it touches none, the command is the nominal input.
"""

from __future__ import annotations

import numpy as np

from testbed.verification import decay_optimality, fleet
from testbed.verification.finding import Finding
from testbed.verification.recorded import Array
from testbed.verification.rows import Rows
from testbed.verification.settings import alpha, box
from testbed.verification.solutions import asked_of_one, margins, rows_of_fences

# Of many altered commands so many are looked into, evenly along the run.
LOOKED = 2000
# A change that is the filter's doing; how near a solution is known, largest seen 2e-11 [m/s, rad/s].
OVERRIDE, SOLVED_TO = 1e-6, 1e-6
FLOW = "the flow of the model is not computed again"
# filter.kind -> why its choice is not computed again.
ANEW = {
    "navigation": "the navigation function is not computed again",
    "flow": "the flow of the model is not computed again",
    **dict.fromkeys(
        ("backup", "gatekeeper", "receding-horizon"), "the flow of the model is not computed again"
    ),
    "collision-cone": "the collision cones' QPs are not solved again",
    "velocity-obstacles": "the velocity obstacles are not computed again",
}
# Slack of a row divided by its norm below which it is touched [m/s].
TOUCHED = 1e-6


def minimal(rows: Rows) -> Finding:
    """The finding of all recorded commands."""
    run, s = rows.run, rows.s
    low, high = box(s)
    wanted = run.channels("_nominal")
    change = np.where(run.present, np.abs(run.command - np.clip(wanted, low, high)).max(axis=-1), 0.0)
    said = f"{int((change > OVERRIDE).sum())} altered"
    if "filter" in run.parts:
        return Finding("minimal", said, "unknown", None, None, "the filter was not the scenario's")
    if why := ANEW.get(s["filter"]["kind"]):
        return Finding("minimal", said, "unknown", None, None, why)
    altered = change > OVERRIDE
    if s["filter"]["kind"] == "optimal-decay":
        return _with_decay(rows, altered, said)
    if not rows.solves or not (run.i.size or run.fences):
        count = int(altered.sum())
        return _finding(said, [f"{count} commands are altered without a filter"] if count else [])
    if rows.own is None:
        why = rows.seen if isinstance(rows.seen, str) else "verification does not cover this manoeuvre"
        return Finding("minimal", said, "unknown", None, None, why)
    central = s["filter"]["kind"] == "centralised"
    if not central and (s["network"]["latency_s"] or s["network"]["loss"]):
        why = "each vehicle saw late poses of the others"
        return Finding("minimal", said, "unknown", None, None, why)
    cases = _central(rows, altered) if central else _limited(rows, altered)
    step = max(1, -(-len(cases) // LOOKED))
    off = np.array([_off(rows, k, vehicles) for k, vehicles in cases[::step]])
    bad = int((~(off <= SOLVED_TO)).sum())
    wrong = [f"{bad} of {len(off)} altered commands are not the nearest allowed"] if bad else []
    return _finding(said, wrong, f"off by {off.max(initial=0.0):.2g}")


def _with_decay(rows: Rows, altered: Array, said: str) -> Finding:
    """The finding where every row has a decay factor."""
    if why := decay_optimality.unknown(rows):
        return Finding("minimal", said, "unknown", None, None, why)
    some = altered.any(axis=1) & rows.answered.all(axis=1) & decay_optimality.told(rows)
    cases, within = np.flatnonzero(some), decay_optimality.within(rows)
    off = np.array([decay_optimality.off(rows, int(k)) for k in cases[:: max(1, -(-len(cases) // LOOKED))]])
    bad = int((~(off <= within)).sum())
    wrong = f"{bad} of {len(off)} altered instants are not the optimum" if bad else ""
    return Finding("minimal", said, f"off by {off.max(initial=0.0):.2g}", not bad, within, wrong)


def _finding(said: str, wrong: list[str], own: str = "as wanted") -> Finding:
    return Finding("minimal", said, own, not wrong, SOLVED_TO, "; ".join(wrong))


def _central(rows: Rows, altered: Array) -> list[tuple[int, Array]]:
    """Instants with an altered command whose QPs were all solved, with all vehicles."""
    some = altered.any(axis=1) & rows.answered.all(axis=1)
    return [(int(k), np.arange(rows.s["vehicles"])) for k in np.flatnonzero(some)]


def _limited(rows: Rows, altered: Array) -> list[tuple[int, Array]]:
    """Instants and vehicles with an altered command whose QP was solved."""
    return [(int(k), np.array([v])) for k, v in np.argwhere(altered & rows.solved)]


def _off(rows: Rows, k: int, vehicles: Array) -> float:
    """How far the change of the command at instant k is from a sum of normals touched."""
    from scipy.optimize import nnls

    run = rows.run
    low, high = (corner[vehicles].ravel() for corner in box(rows.s))
    u = run.command[k, vehicles].ravel()
    change = u - run.channels("_nominal")[k, vehicles].ravel()
    if vehicles.size > 1:
        matrix, due, off = _joint_rows(rows, k)
    else:
        matrix, due, off = asked_of_one(rows, k, int(vehicles[0]))
    # What each input is divided by in the cost: then the change is a sum of normals in the same inputs.
    scale = np.ones(u.size)
    if rows.s["filter"].get("cost", "raw") == "range":
        scale = np.where(high > low, 0.5 * (high - low), 1.0)
    size = np.linalg.norm(matrix, axis=1)
    normals = matrix[np.abs(matrix @ u - due) <= TOUCHED * np.maximum(size, 1.0) + off]
    unit = np.eye(u.size)
    normals = np.concatenate([normals, unit[u - low <= TOUCHED], -unit[high - u <= TOUCHED]])
    if not normals.size:
        return float(np.abs(change).max())
    normals = normals * scale
    length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    _, rest = nnls((normals / length).T, change / scale)
    return float(rest) * float(scale.max())


def _joint_rows(rows: Rows, k: int) -> tuple[Array, Array, Array]:
    """The centralised QP's rows at instant k: matrix (P, 3 N), right-hand sides and their errors (P,)."""
    own, run = rows.own, rows.run
    assert own is not None
    pairs = np.arange(run.i.size)
    matrix = np.zeros((pairs.size, rows.s["vehicles"], 3))
    due, under = margins(rows)[k] - alpha(rows.s, own.h[k]), fleet.under(rows.s)
    for side, vehicle in enumerate((run.i, run.j)):
        matrix[pairs, vehicle] = own.lie[side][:, k].T * under[vehicle][:, None]
        if not under.all():
            due = due - np.where(under[vehicle], 0.0, rows.assumed(side)[k])
    _, off = rows.left
    more, asked, wrong = rows_of_fences(rows, k, np.arange(rows.s["vehicles"]))
    return (
        np.concatenate([matrix.reshape(pairs.size, -1), more]),
        np.concatenate([due, asked]),
        np.concatenate([off[k], wrong]),
    )
