"""Updates statistics and writes rows during a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from filters.barriers.class_k import OddPolynomial
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.pairs import Barrier
from filters.constraints import dot
from filters.model import Array, Command, Limits, State
from filters.qp.single import Status
from testbed.measures import hdot_ledger
from testbed.measures.fence_statistics import FenceStatistics
from testbed.measures.run_statistics import RunStatistics
from testbed.records.run import DECLARED_COLUMNS, REALISED_COLUMNS, WIND_COLUMNS, Columns, RowWriter
from testbed.scenario import near_pairs
from testbed.simulation.near_pairs import NearPairs
from testbed.simulation.step_buffer import StepBuffer

STATUS_NAMES = np.array([s.name.lower() for s in Status])


class Recorder:
    """Counts and records the steps in `buffer`, many steps at a time.

    barrier  the unmodified one
    alpha    h -> m/s
    dt       s, filter period;  fdm_dt  s, the plant's
    windy    whether the air moves, and its motion is recorded
    near     chooses the pairs that are judged; None: all are, and all are recorded
    """

    def __init__(
        self,
        buffer: StepBuffer,
        statistics: RunStatistics,
        rows: RowWriter,
        barrier: Barrier,
        alpha: OddPolynomial,
        limits: Limits,
        dt: float,
        fdm_dt: float,
        windy: bool,
        leaving: bool = False,
        near: NearPairs | None = None,
    ) -> None:
        self.buffer, self.statistics, self.rows = buffer, statistics, rows
        self.barrier, self.alpha, self.limits = barrier, alpha, limits
        self.dt, self.windy, self.leaving, self.near = dt, windy, leaving, near
        self._offsets = fdm_dt * np.arange(1, buffer.periods + 1)

    def said(self) -> dict[str, Any]:
        """What the manifest says of the tables: which pairs are recorded, where not all are."""
        return (
            {} if self.near is None else {"near_pairs": {"above": near_pairs.ABOVE, "h_m": self.near.record}}
        )

    def look(self) -> None:
        """Count and record the buffer's new steps, and make room for further ones."""
        s = self.buffer
        if s.count == s.seen:
            return
        new = slice(s.seen, s.count)
        if self.near is not None:
            pairs = self.near.of(s, self.statistics)
            s.take(*pairs)
            self.statistics.take(*pairs)
        s.judge_truth(self.barrier)
        s.let_go()
        gone = None if s.gone is None else s.gone[new]
        flown = s.command[new], s.wanted[new], s.rates[new], s.override[new]
        self.statistics.decided(s.t[new], self.dt, *flown, self.limits, gone)
        safe, who = s.h[new] >= 0.0, self.statistics.roles
        inside = np.asarray((safe if who is None else safe[:, who.judged]).all(axis=-1))
        if self.statistics.fences is not None:
            inside &= self._look_at_fences(self.statistics.fences, new)
        self.statistics.solved(s.t[new], s.status[new], s.residual[new], inside)
        if self.statistics.tracks is not None:
            self.statistics.tracks.update(s.t[new], s.truth[new])
        if s.i.size:
            self._look_at_pairs(new)
        self._record_vehicles(s.seen + np.flatnonzero(s.recorded[new]))
        if s.moved:
            moved = slice(s.seen, s.seen + s.moved)
            t = s.t[moved, None] + self._offsets
            motion = State.of(s.truth[moved]), Command.of(s.command[moved])
            gone = None if s.gone is None else s.gone[moved]
            self.statistics.positions(t.ravel(), s.track[: t.size], s.periods, motion, gone)
            if self.statistics.fences is not None:
                self.statistics.fences.positions(t.ravel(), s.track[: t.size], motion[1], gone)
        s.keep_last()

    def close(self) -> None:
        """The run is over: the motion after its last step is unknown; without steps tables are empty."""
        self.look()
        s = self.buffer
        if self.near is not None and s.count:
            s.take(s.i, s.j)
            s.judge_truth(self.barrier)
            s.fill_in(s.lie())
        if not s.count:
            self.rows.add("vehicles", self._vehicle_rows(np.zeros(0, dtype=int)))
            if self.statistics.fences is not None:
                self._look_at_fences(self.statistics.fences, slice(0, 0))
            last, lie = np.zeros(0, dtype=int), np.zeros((2, 3, 0, s.i.size))
        elif s.recorded[0]:
            last, lie = np.zeros(1, dtype=int), s.lie()
        else:
            return
        if s.i.size:
            unknown = dict.fromkeys(REALISED_COLUMNS, np.full(last.size * s.i.size, np.nan))
            self._add_pairs(self._pair_rows(last, lie) | unknown)

    def _look_at_pairs(self, new: slice) -> None:
        s, statistics = self.buffer, self.statistics
        h, lie = s.h[: s.count], s.lie()
        if self.near is not None:
            s.fill_in(lie)
        alpha_h = self.alpha(h) if s.gone is None else np.where(s.apart(), np.inf, self.alpha(h))
        statistics.barrier(s.t[new], h[new], lie[:, :, new], alpha_h[new], self.limits)
        if isinstance(self.barrier, TurnBarrier):
            statistics.phasor(s.t[new], *self._phasors(self.barrier, new))
        statistics.see(statistics.rows, s.t[new], self._solved_rows(new))
        if statistics.foreign:
            u_i, u_j = (s.command[new][:, vehicle].transpose(2, 0, 1) for vehicle in (s.i, s.j))
            hdot = (lie[0][:, new] * u_i + lie[1][:, new] * u_j).sum(axis=0)
            statistics.true_rows.update(s.t[new], hdot + alpha_h[new])
        if statistics.own is not None and s.declared is not None:
            statistics.own.update(s.t[: s.count], s.declared[:, : s.count], s.seen, self.dt)
        if s.count == 1:
            return
        if s.gone is None:
            realised = np.diff(h, axis=0) / self.dt
            statistics.see(statistics.condition, s.t[: s.count - 1], realised + alpha_h[:-1])
        else:
            left = s.apart()[1:]  # by the end of the period
            realised = np.where(left, np.nan, np.diff(np.where(np.isposinf(h), 0.0, h), axis=0) / self.dt)
            statistics.condition.update(s.t[: s.count - 1], np.where(left, np.inf, realised + alpha_h[:-1]))
        led = np.flatnonzero(s.recorded[: s.count - 1])
        if led.size:
            residuals = {"hdot_realised_mps": realised[led].ravel()} | self._residuals(led, lie)
            if s.gone is not None:
                left = s.apart()[1:][led].ravel()
                residuals = {name: np.where(left, np.nan, values) for name, values in residuals.items()}
            self._add_pairs(self._pair_rows(led, lie) | residuals)

    def _add_pairs(self, columns: Columns) -> None:
        """Write rows of `pairs`: where only near ones are judged, of those whose h is small enough."""
        if self.near is not None:
            here = columns["h_m"] <= self.near.record
            columns = {name: values[here] for name, values in columns.items()}
        self.rows.add("pairs", columns)

    def _phasors(self, barrier: TurnBarrier, new: slice) -> tuple[Array, Array | None]:
        """The phasors of new steps (S, P); and of the step before, where those pairs were not looked at."""
        truth = self.buffer.truth
        if self.near is None:
            return barrier.phasor(State.of(truth[new])), None
        pairs = self.buffer.i, self.buffer.j
        first = max(0, new.start - 1)
        z = barrier.phasor(State.of(truth[first : new.stop]), *pairs)
        return z[new.start - first :], None if new.start == 0 else z[0]

    def _look_at_fences(self, fences: FenceStatistics, new: slice) -> np.ndarray:
        """Count and record h and clearance of fences at new steps; whether (S,) all h >= 0."""
        s = self.buffer
        gone = None if s.gone is None else s.gone[new]
        h = fences.state(s.t[new], State.of(s.truth[new]), gone)
        recorded = np.flatnonzero(s.recorded[new])
        if recorded.size or not s.count:
            position, of = s.truth[new][recorded][..., [0, 1, 3]], fences.fences
            clear, least = of.clearance(position), h[recorded]
            if gone is not None:
                clear, least = (np.where(np.isposinf(least), np.nan, x) for x in (clear, least))
            self.rows.add(
                "fences",
                {
                    "t_s": np.repeat(s.t[new][recorded], of.fence.size),
                    "fence": np.tile((of.fence + 1).astype(np.int32), recorded.size),
                    "vehicle": np.tile((of.vehicle + 1).astype(np.int32), recorded.size),
                    "clearance_m": clear.ravel(),
                    "h_m": least.ravel(),
                },
            )
        return np.asarray((h >= 0.0).all(axis=-1))

    def _solved_rows(self, new: slice) -> Array:
        """L_g h u + alpha(h) of the filter's own rows (S, P); inf where one of the QPs was not solved."""
        s = self.buffer
        solved, who = s.status[new] == Status.SOLVED, self.statistics.roles
        if who is not None:  # a row beside an intruder is the other vehicle's; of two intruders there is none
            solved[:, list(who.intruders)] = True
        known = solved[:, s.i] & solved[:, s.j] & ~np.isnan(s.filter_h[new])
        if who is not None:
            known &= who.judged
        return np.where(known, s.predicted[new] + self.alpha(s.filter_h[new]), np.inf)

    def _record_vehicles(self, steps: np.ndarray) -> None:
        """Write rows of `vehicles` at these steps, and count saturation."""
        s, n = self.buffer, self.buffer.vehicles
        if not steps.size:
            return
        telemetry = {
            name: np.concatenate([s.telemetry[k][name] for k in steps]) for name in s.telemetry[steps[0]]
        }
        seen = {name: x.reshape(-1, n) for name, x in telemetry.items()}
        if s.gone is not None:
            seen = {name: np.where(s.gone[steps], np.nan, x) for name, x in seen.items()}
        self.statistics.saturation.update(seen)
        wind = s.air[steps].reshape(-1, 3).T if self.windy else ()
        columns = self._vehicle_rows(steps) | telemetry | dict(zip(WIND_COLUMNS, wind, strict=False))
        self.rows.add("vehicles", columns)

    def _vehicle_rows(self, steps: np.ndarray) -> Columns:
        """Rows of `vehicles` at these steps, without telemetry and wind."""
        s, n = self.buffer, self.buffer.vehicles
        columns: Columns = {
            "t_s": np.repeat(s.t[steps], n),
            "vehicle": np.tile(np.arange(1, n + 1, dtype=np.int32), steps.size),
        }
        for k, name in enumerate(("x_m", "y_m", "z_m", "theta_rad")):
            columns[name] = s.truth[steps, :, (0, 1, 3, 2)[k]].ravel()
        for suffix, values in (("", s.rates), ("_nominal", s.wanted), ("_command", s.command)):
            for k, name in enumerate((f"v{suffix}_mps", f"omega{suffix}_radps", f"zeta{suffix}_mps")):
                columns[name] = values[steps, :, k].ravel()
        columns["override"] = s.override[steps].ravel()
        columns["qp_status"] = STATUS_NAMES[s.status[steps].ravel()]
        if self.leaving:
            columns["left"] = (np.zeros((steps.size, n), bool) if s.gone is None else s.gone[steps]).ravel()
        return columns

    def _pair_rows(self, steps: np.ndarray, lie: Array) -> Columns:
        """Rows of `pairs` at these steps, what the instant itself tells; `lie` as in `StepBuffer.lie`."""
        s = self.buffer
        position = s.truth[steps][:, :, [0, 1, 3]]
        apart = position[:, s.i] - position[:, s.j]
        i, j = self._in_one_row(steps.size)
        u = s.command[steps].reshape(-1, 3)
        lie_i, lie_j = self._sides(steps, lie)
        declared = () if s.declared is None else s.declared[:2, steps].reshape(2, -1)
        rows = {
            "t_s": np.repeat(s.t[steps], s.i.size),
            "i": np.tile((s.i + 1).astype(np.int32), steps.size),
            "j": np.tile((s.j + 1).astype(np.int32), steps.size),
            "distance_m": np.linalg.norm(apart, axis=-1).ravel(),
            "h_m": s.h[steps].ravel(),
            "h_filter_m": s.filter_h[steps].ravel(),
            "hdot_predicted_mps": dot(lie_i, u[i]) + dot(lie_j, u[j]),
            **dict(zip(DECLARED_COLUMNS, declared, strict=False)),
        }
        if s.gone is not None:
            apart = s.apart()[steps].ravel()
            for name in rows.keys() - {"t_s", "i", "j"}:
                rows[name] = np.where(apart, np.nan, rows[name])
        return rows

    def _residuals(self, steps: np.ndarray, lie: Array) -> Columns:
        """Realised minus predicted hdot after these steps, by channel."""
        s = self.buffer
        drift = np.zeros(steps.size * s.vehicles)
        before, after = ([s.telemetry[k].get("heading_rad") for k in at] for at in (steps, steps + 1))
        if all(heading is not None for heading in before + after):
            turned = np.concatenate(after) - np.concatenate(before)
            heading_rate = (np.remainder(turned + np.pi, 2 * np.pi) - np.pi) / self.dt
            drift = (0.5 * (s.rates[steps, :, 1] + s.rates[steps + 1, :, 1])).ravel() - heading_rate
        flown, start, end = (
            Command.of(a.reshape(-1, 3)) for a in (s.command[steps], s.rates[steps], s.rates[steps + 1])
        )
        i, j = self._in_one_row(steps.size)
        return hdot_ledger.residuals(self._sides(steps, lie), i, j, flown, start, end, drift)

    def _in_one_row(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """Vehicle numbers of the pairs of so many steps, (steps P,), with all steps' vehicles in one row."""
        first = self.buffer.vehicles * np.arange(steps)[:, None]
        return (first + self.buffer.i).ravel(), (first + self.buffer.j).ravel()

    def _sides(self, steps: np.ndarray, lie: Array) -> tuple[Array, Array]:
        """L_g h of vehicles i and of j at these steps, (steps P, 3) each."""
        lie_i, lie_j = lie[:, :, steps].reshape(2, 3, steps.size * self.buffer.i.size)
        return lie_i.T, lie_j.T
