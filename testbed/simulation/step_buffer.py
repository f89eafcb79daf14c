"""Stores consecutive filter steps as arrays, so that they are judged and recorded many at a time.

A numpy call costs about the same for one step of two vehicles as for fifty, and judging and recording take
more calls than flying does. Nothing here influences the flight.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from filters.barriers.pairs import Barrier, PairValues, all_pairs
from filters.filter import Decision
from filters.model import Array, Command, State
from filters.qp.single import Status

# Numbers of one kind (pairs times FDM periods) in a buffer: more would not fit in the processor's cache.
NUMBERS = 20_000
MOST_STEPS = 256


class StepBuffer:
    """Up to `size` filter steps of N vehicles and their P pairs.

    The first `count` are filled in; those from `seen` on are new, and of `moved` of them the motion is known.
    vehicles, periods        N, and FDM periods per filter step
    i, j                     (P,) vehicles of each pair, from 0
    t, recorded              (S,) s; whether the step is recorded
    truth                    (S, N, 4) x, y, theta, z
    rates, wanted, command   (S, N, 3) v, omega, zeta
    air                      (S, N, 3) the wind, east, north and up
    status, residual, override  (S, N) as in `Decision`
    filter_h, predicted      (S, P) the filter's own h and L_g h u; nan where it has none
    h, grad                  (S, P), (8, S, P) the unmodified barrier at the true state; see `judge_truth`
    declared                 (3, S, P) of the barrier that a user's filter declares, see
                             `declared_barrier.at_one_step`; None without one
    track                    (S periods, N, 3) m, the positions flown through after the new steps
    telemetry                per step {channel: (N,)}, of recorded steps and those that follow one

    near  whether only near pairs are judged: there are none until `take` has been told which
    """

    def __init__(self, vehicles: int, periods: int, declared: bool = False, near: bool = False) -> None:
        self.vehicles, self.periods, self.near = vehicles, periods, near
        self.i, self.j = all_pairs(1 if near else vehicles)
        # As many steps where only near pairs are judged: sums over steps are rounded alike.
        fit = NUMBERS // max(1, vehicles * (vehicles - 1) // 2 * periods)
        pairs, n = self.i.size, 1 + max(1, min(MOST_STEPS, fit))
        self.size = n
        self.count = self.seen = self.moved = 0
        self.t, self.recorded = np.empty(n), np.empty(n, dtype=bool)
        self.truth = np.empty((n, vehicles, 4))
        self.rates, self.wanted, self.command, self.air = np.empty((4, n, vehicles, 3))
        self.status, self.override = np.empty((n, vehicles), dtype=int), np.empty((n, vehicles), dtype=bool)
        self.residual = np.empty((n, vehicles))
        self.filter_h, self.predicted, self.h = np.empty((3, n, pairs))
        self.grad = np.empty((8, n, pairs))
        self.track = np.empty((n * periods, vehicles, 3))
        self.declared = np.empty((3, n, pairs)) if declared else None
        # Who has left; None until somebody has.
        self.gone: NDArray[np.bool_] | None = None
        self.telemetry: list[dict[str, Array]] = []
        self._known = np.empty(n, dtype=bool)  # whether h and grad are filled in
        # Where only near pairs are judged: what the filter has said of the pairs that it looked at.
        self._said: list[tuple[PairValues, Array] | None] = []

    @property
    def full(self) -> bool:
        """Whether no further step fits."""
        return self.count == self.size

    def add(
        self,
        t: float,
        truth: State,
        rates: Command,
        air: Array,
        wanted: Command,
        decision: Decision,
        true: bool,
        recorded: bool,
        telemetry: dict[str, Array],
        declared: Array | None = None,
        gone: NDArray[np.bool_] | None = None,
    ) -> None:
        """Take in one step; `true` says that the decision's pairs are the unmodified barrier at `truth`.

        declared  (3, P), where the filter declares a barrier
        gone      (N,) who has left; None if nobody has
        """
        k = self.count
        self.t[k], self.recorded[k], self._known[k] = t, recorded, true
        now = self.truth[k]
        now[:, 0], now[:, 1], now[:, 2], now[:, 3] = truth.x, truth.y, truth.theta, truth.z
        for into, c in ((self.rates, rates), (self.wanted, wanted), (self.command, decision.command)):
            row = into[k]
            row[:, 0], row[:, 1], row[:, 2] = c.v, c.omega, c.zeta
        self.air[k], self.override[k] = air, decision.override
        self.status[k], self.residual[k] = decision.status, decision.residual
        if self.near:
            self._said.append(None if decision.pairs is None else (decision.pairs, decision.hdot_predicted))
            self._known[k] = False
        elif decision.pairs is None:
            self.filter_h[k] = self.predicted[k] = np.nan
        else:
            self.filter_h[k], self.predicted[k] = decision.pairs.h, decision.hdot_predicted
            if true:
                self.h[k], self.grad[:, k] = decision.pairs.h, decision.pairs.grad.T
        if self.declared is not None and declared is not None:
            self.declared[:, k] = declared
        if gone is not None and self.gone is None:
            self.gone = np.zeros((self.size, self.vehicles), dtype=bool)
        if self.gone is not None:
            self.gone[k] = False if gone is None else gone
        self.telemetry.append(telemetry)
        self.count += 1

    def move(self, track: Array) -> None:
        """Take in the positions (periods, N, 3) flown through after the step added last."""
        self.track[self.moved * self.periods : (self.moved + 1) * self.periods] = track
        self.moved += 1

    def take(self, i: NDArray[np.intp], j: NDArray[np.intp]) -> None:
        """Judge the pairs (i, j) of all steps: h and grad are still to be filled in."""
        self.i, self.j = i, j
        self.filter_h, self.predicted, self.h = np.full((3, self.count, i.size), np.nan)
        self.grad = np.empty((8, self.count, i.size))
        self._known[: self.count] = False
        place = i * self.vehicles + j
        for k, said in enumerate(self._said):
            if said is not None:
                pairs, hdot = said
                at = np.searchsorted(place, pairs.i * self.vehicles + pairs.j)
                there = at < place.size
                there[there] = place[at[there]] == pairs.i[there] * self.vehicles + pairs.j[there]
                self.filter_h[k, at[there]], self.predicted[k, at[there]] = pairs.h[there], hdot[there]

    def fill_in(self, lie: Array) -> None:
        """Of pairs that the filter did not look at its h would have been the true one: see `near_pairs`.

        lie  as `lie()` gives it
        """
        for k, said in enumerate(self._said):
            if said is not None:
                u_i, u_j = (self.command[k].T.take(vehicle, axis=1) for vehicle in (self.i, self.j))
                x, y, z = lie[0][:, k] * u_i + lie[1][:, k] * u_j
                missing = np.isnan(self.filter_h[k])
                self.filter_h[k, missing] = self.h[k, missing]
                self.predicted[k, missing] = (x + y + z)[missing]

    def judge_truth(self, barrier: Barrier) -> None:
        """Fill in h and grad where the filter's are not those of the true state."""
        steps = np.flatnonzero(~self._known[: self.count])
        if steps.size and self.i.size:
            at = np.repeat(steps, self.i.size)
            i, j = np.tile(self.i, steps.size), np.tile(self.j, steps.size)
            values = barrier.values(State.of(self.truth[: self.count]), (at, i), (at, j))
            self.h[steps] = values.h.reshape(steps.size, -1)
            self.grad[:, steps] = values.grad.T.reshape(8, steps.size, -1)
            self._known[steps] = True

    def let_go(self) -> None:
        """Take out of new steps what is said of who has left: h of their pairs is inf, no QP was solved."""
        if self.gone is None:
            return
        new = slice(self.seen, self.count)
        gone, apart = self.gone[new], self.apart()[new]
        self.status[new][gone], self.override[new][gone] = int(Status.NONE), False
        self.residual[new][gone] = 0.0
        self.h[new][apart] = np.inf
        self.filter_h[new][apart] = self.predicted[new][apart] = np.nan
        if self.declared is not None:
            self.declared[:, new][:, apart] = np.inf

    def apart(self) -> NDArray[np.bool_]:
        """(S, P) pairs of which one has left."""
        assert self.gone is not None
        gone = self.gone[: self.count]
        return np.asarray(gone[:, self.i] | gone[:, self.j])

    def lie(self) -> Array:
        """L_g h of the true state over (v, omega, zeta): [vehicle i or j, entry, step, pair]."""
        n = self.count
        # As if the vehicles of all steps stood in one row.
        first = self.vehicles * np.arange(n)[:, None]
        i, j = (first + self.i).ravel(), (first + self.j).ravel()
        grad = self.grad[:, :n].reshape(8, -1).T
        values = PairValues(i, j, self.h[:n].ravel(), grad)
        lie = values.lie(State.of(self.truth[:n].reshape(-1, 4)))
        return np.stack([side.T.reshape(3, n, -1) for side in lie])

    def keep_last(self) -> None:
        """Drop all steps but the last one, whose motion is not known yet."""
        last = self.count - 1
        for a in (self.t, self.recorded, self.truth, self.rates, self.wanted, self.command, self.air):
            a[0] = a[last]
        for a in (self.status, self.override, self.residual):
            a[0] = a[last]
        self._said = self._said[last:]
        if self.declared is not None:
            self.declared[:, 0] = self.declared[:, last]
        if self.gone is not None:
            self.gone[0] = self.gone[last]
        for a in () if self.near else (self.filter_h, self.predicted, self.h, self.grad.swapaxes(0, 1)):
            a[0] = a[last]
        self._known[0] = self._known[last]
        self.telemetry = self.telemetry[last:]
        self.count, self.seen, self.moved = 1, 1, 0


def keep_freed_memory() -> None:
    """Keep memory that one step frees for the next; otherwise every large array is mapped again."""
    # glibc keeps blocks up to the size of the largest mapped one ever freed, 32 MiB at most. With 100
    # vehicles that halves the barrier's time; elsewhere it does nothing.
    np.empty(31 << 20, dtype=np.uint8)
