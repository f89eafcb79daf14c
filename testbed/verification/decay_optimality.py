"""Checks that commands of the optimal-decay filter are its optimum, from the conditions of optimality.

A row that asks for more than alpha(h) has the factor w = -hdot / alpha(h) and the price p (w - 1) / alpha(h).
The change of the command is the sum of the rows' L_g h at their prices, and what the limits add.
"""

from __future__ import annotations

import numpy as np

from testbed.verification import fleet
from testbed.verification.recorded import Array
from testbed.verification.rows import Rows
from testbed.verification.settings import alpha, box

# How near the optimum is known [m/s, rad/s], at p = 1; where alpha(h) is smaller than this, prices are not.
SOLVED_TO, LEAST_ALPHA = 1e-5, 0.01
TOUCHED = 1e-6


def unknown(rows: Rows) -> str:
    """Why the choice cannot be told from the record; empty if it can."""
    if rows.own is None:
        return rows.seen if isinstance(rows.seen, str) else "verification does not cover this manoeuvre"
    if fleet.strangers(rows.s):
        return "decay factors beside intruders are not computed again"
    return ""


def told(rows: Rows) -> Array:
    """Instants (T,) at which every price is known."""
    assert rows.own is not None
    return np.asarray((alpha(rows.s, rows.own.h) >= LEAST_ALPHA).all(axis=1))


def within(rows: Rows) -> float:
    """How far a command may be from the optimum."""
    return SOLVED_TO * max(1.0, float(rows.s["filter"]["decay_weight"]))


def off(rows: Rows, k: int) -> float:
    """How far the command at instant k is from what the conditions of optimality say."""
    run, own = rows.run, rows.own
    assert own is not None
    low, high = box(rows.s)
    u, wanted = run.command[k], run.channels("_nominal")[k]
    lie = np.moveaxis(own.lie[:, :, k], 1, 2)  # side, pair, input
    room = alpha(rows.s, own.h[k])
    hdot = sum((lie[side] * u[vehicle]).sum(axis=1) for side, vehicle in enumerate((run.i, run.j)))
    price = rows.s["filter"]["decay_weight"] * np.maximum(-hdot / room - 1.0, 0.0) / room
    pull = np.zeros(u.shape)
    for side, vehicle in enumerate((run.i, run.j)):
        np.add.at(pull, vehicle, price[:, None] * lie[side])
    if rows.s["filter"].get("cost", "raw") == "range":
        pull = pull * np.where(high > low, 0.5 * (high - low), 1.0) ** 2
    left = u - wanted - pull
    # A limit that is touched may push inwards.
    left = np.where((u - low <= TOUCHED) & (left > 0), 0.0, left)
    left = np.where((high - u <= TOUCHED) & (left < 0), 0.0, left)
    return float(np.abs(left).max(initial=0.0))
