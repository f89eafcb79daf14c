"""The one loop: any plant, any filter, any scenario."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.plant import Plant
from aircraft.replay import Replay
from filters.alpha import OddPolynomial
from filters.barrier import Barrier, PairValues, TurnBarrier, all_pairs
from filters.collision import Decision, Filter
from filters.monitor import Monitor
from filters.qp import Status
from filters.unicycle import Array, Command, Limits, State, View
from testbed import catalogue, guarantees, ledger, manoeuvre
from testbed.approach import Approach
from testbed.disturbance import Disturbance
from testbed.errors import UserError
from testbed.flyable import unflyable
from testbed.parts import Parts
from testbed.premises import premises
from testbed.record import REALISED_COLUMNS, WIND_COLUMNS, Columns, MemorySink, Recorder, Run, Sink
from testbed.saturation import Saturation
from testbed.scenario import SCHEMA_VERSION, Scenario
from testbed.start import generators, places
from testbed.store import RunWriter, load, staged
from testbed.tally import Tally
from testbed.undisturbed import straight_s

Progress = Callable[[float, float], None]
# Gusts change within a long filter period: the air is asked at least so often [s].
WIND_PERIOD_S = 0.05
STATUS_NAMES = np.array([s.name.lower() for s in Status])


def run(
    scenario: Scenario,
    out: Path | None = None,
    *,
    force: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    parts: Parts | None = None,
) -> Run:
    """Fly `scenario` and judge it.

    out        run directory to write; None keeps the tables in memory
    force      fly even from a start outside the safe set
    overwrite  replace a run that stands at `out`
    progress   called with (t, duration) in seconds, at every filter step
    parts      a plant, filter, nominal controller or disturbance of your own; None is the scenario's
    Raises     UserError for a start outside the safe set, two vehicles at one place, or bad files
    """
    if out is None:
        sink = MemorySink()
        finished = _Flight(scenario, sink, force, progress, parts or Parts()).fly()
        finished.tables = sink.tables()
        return finished
    with staged(out, overwrite) as folder:
        writer = RunWriter(folder)
        writer.finish(_Flight(scenario, writer, force, progress, parts or Parts()).fly())
    return load(out)


@dataclass
class _Flight:
    """The pieces of one run, put together and flown once."""

    scenario: Scenario
    sink: Sink
    force: bool
    progress: Progress | None
    parts: Parts

    def fly(self) -> Run:
        began = time.perf_counter()
        s = self.scenario
        rngs = generators(s.seed)
        start, goal = places(s, rngs["start"])
        limits, barrier = catalogue.limits(s), catalogue.barrier(s)
        i, j = all_pairs(s.vehicles)
        started_safe = _check_start(s, barrier, start, i, j, self.force)
        disturbance = self.parts.disturbance(s, rngs)
        air = disturbance.wind(0.0, start)
        # Remembering the flight costs memory that grows with it: only where branches are wanted.
        replay = Replay(lambda: self.parts.plant(s, air)) if s.checks.manoeuvre_instants else None
        plant = replay or self.parts.plant(s, air)
        try:
            plant.reset(start, rngs["plant"])
        except RuntimeError as error:  # no steady flight at the start, in this wind
            raise UserError(f"start: {error}") from None
        aircraft = catalogue.airframes(s) if s.plant == "jsbsim" and "plant" not in self.parts.own() else []
        approach = Approach(i.size, s.d_safe_m) if replay else None
        tally = Tally(s.vehicles, Saturation(aircraft), approach)
        tally.positions(np.zeros(1), _position(start)[None], goal, s.goal_radius_m, i, j)
        recorder = Recorder(self.sink)
        filter_ = self.parts.filter(s, barrier, goal)
        end = self._loop(plant, disturbance, filter_, barrier, limits, goal, tally, recorder)
        recorder.close()
        straight = np.linalg.norm(goal - _position(start), axis=-1)
        nominal = self.parts.nominal(s, goal, barrier)
        alone_s = straight_s(nominal, limits, _position(start), goal, s.goal_radius_m)
        flown = guarantees.Flown(s, tally, i, j, started_safe, end, straight, alone_s)
        own = self.parts.own()
        # What a plant of one's own can fly steadily, nobody has said: that is no pass.
        unknown = [f"nobody said whether {own['plant']} can fly it"] if "plant" in own else []
        verdicts = premises(flown, barrier, limits, unknown or unflyable(s, barrier))
        verdicts += guarantees.judge(flown)
        if replay is not None and approach is not None and end is None:
            approach.close()
            when = manoeuvre.instants(s, approach, s.duration_s)
            verdicts.append(manoeuvre.fly(s, replay.branch, disturbance.wind, barrier, limits, when, i, j))
        manifest = _manifest(s, tally, end) | ({"parts": own} if own else {})
        if isinstance(filter_, Monitor):
            verdicts += guarantees.monitored(filter_.record, s.rates.filter_dt_s)
            manifest["qp_cost"] = {
                "steps": filter_.record.compared,
                "centralised": filter_.record.cost,
                "limited": filter_.record.cost_limited,
            }
        return Run(manifest, verdicts, {"wall_s": time.perf_counter() - began})

    def _loop(
        self,
        plant: Plant,
        disturbance: Disturbance,
        filter_: Filter,
        barrier: Barrier,
        limits: Limits,
        goal: Array,
        tally: Tally,
        recorder: Recorder,
    ) -> str | None:
        """Fly to the end; returns why it ended early, or None."""
        s = self.scenario
        i, j = all_pairs(s.vehicles)
        nominal, alpha = self.parts.nominal(s, goal, barrier), catalogue.alpha(s)
        waiting = deque([Command.of(np.zeros((s.vehicles, 3)))] * s.nominal.delay_steps)
        steps, dt, n = s.filter_steps, s.rates.filter_dt_s, s.rates.fdm_steps
        offsets = s.rates.fdm_dt_s * np.arange(1, n + 1)
        before: _Before | None = None
        open_row: Columns | None = None  # of `pairs`, waiting for what the motion makes of it
        end: str | None = None
        for step in range(steps + 1):
            t = step * dt
            truth, rates = plant.state(), plant.achieved()
            air, view = disturbance.wind(t, truth), disturbance.observe(t, truth, rates)
            waiting.append(nominal(t, view.own().state))
            wanted = waiting.popleft()
            decision = filter_(view, wanted, limits)
            true = _true_pairs(decision, filter_, barrier, view, truth)
            tally.decided(t, dt, decision, wanted, rates, limits)
            tally.failed(t, decision, bool(np.all(true.h >= 0.0)))
            recording = step % s.rates.record_steps == 0
            telemetry = plant.telemetry() if recording or open_row is not None else {}
            if i.size:
                lie, alpha_h = true.lie(truth), alpha(true.h)
                tally.barrier(t, true, lie, alpha_h, limits)
                if isinstance(barrier, TurnBarrier):
                    tally.phasor(t, barrier.phasor(truth))
                if decision.pairs is not None:
                    tally.rows.update(t, _solved_rows(decision, alpha))
                if before is not None:
                    realised = (true.h - before.h) / dt
                    tally.condition.update(t - dt, realised + before.alpha)
                    if open_row is not None:
                        recorder.add("pairs", open_row | before.close(realised, rates, telemetry, dt))
                before = _Before(true, lie, alpha_h, decision.command, rates, telemetry)
                open_row = _pair_rows(t, truth, decision, true, lie) if recording else None
            if recording:
                tally.saturation.update(telemetry)
                further = telemetry | (_wind_columns(air) if disturbance.windy else {})
                recorder.add("vehicles", _vehicle_rows(t, truth, rates, wanted, decision, further))
            if self.progress is not None:
                self.progress(t, s.duration_s)
            if step == steps:
                break
            track = _advance(plant, disturbance, decision.command, t, air, n)
            fault = next((f"vehicle {v + 1}: {what}" for v, what in enumerate(plant.faults()) if what), None)
            if fault is not None:
                end = f"{fault} by {t + dt:.3f} s, the run ended there"
                break
            tally.positions(t + offsets, track, goal, s.goal_radius_m, i, j)
        if open_row is not None:
            unknown = np.full(i.size, np.nan)
            recorder.add("pairs", open_row | dict.fromkeys(REALISED_COLUMNS, unknown))
        return end


@dataclass(frozen=True)
class _Before:
    """What held at the last filter step, kept until the motion that followed is known."""

    pairs: PairValues
    lie: tuple[Array, Array]
    alpha: Array
    command: Command
    rates: Command
    telemetry: dict[str, Array]

    @property
    def h(self) -> Array:
        return self.pairs.h

    def close(self, realised: Array, rates: Command, telemetry: dict[str, Array], dt: float) -> Columns:
        """The columns of `pairs` that only the motion since could tell."""
        drift = np.zeros(len(self.rates))
        if "heading_rad" in telemetry and "heading_rad" in self.telemetry:
            turned = telemetry["heading_rad"] - self.telemetry["heading_rad"]
            heading_rate = (np.remainder(turned + np.pi, 2 * np.pi) - np.pi) / dt
            drift = 0.5 * (self.rates.omega + rates.omega) - heading_rate
        p = self.pairs
        parts = ledger.residuals(self.lie, p.i, p.j, self.command, self.rates, rates, drift)
        return {"hdot_realised_mps": realised} | parts


def _solved_rows(decision: Decision, alpha: OddPolynomial) -> Array:
    """L_g h u + alpha(h) of the filter's own rows (P,); inf where one of the QPs was not solved."""
    p = decision.pairs
    assert p is not None
    solved = decision.status == Status.SOLVED
    return np.where(solved[p.i] & solved[p.j], decision.hdot_predicted + alpha(p.h), np.inf)


def _advance(plant: Plant, disturbance: Disturbance, command: Command, t: float, air: Array, n: int) -> Array:
    """Fly `command` for n periods from time t, where the wind is `air`; positions (n, N, 3) m."""
    most = max(1, int(WIND_PERIOD_S / plant.dt + 1e-9)) if disturbance.windy else n
    track = [plant.step(command, air, min(most, n))]
    for k in range(most, n, most):
        air = disturbance.wind(t + k * plant.dt, plant.state())
        track.append(plant.step(command, air, min(most, n - k)))
    return np.concatenate(track)


def _wind_columns(air: Array) -> Columns:
    return dict(zip(WIND_COLUMNS, air.T.copy(), strict=True))


def _position(state: State) -> Array:
    return np.stack([state.x, state.y, state.z], axis=-1)


def _check_start(
    s: Scenario, barrier: Barrier, start: State, i: np.ndarray, j: np.ndarray, force: bool
) -> bool:
    """Whether h >= 0 for every pair; refused without `force`, and two vehicles at one place always."""
    if not i.size:
        return True
    position = _position(start)
    distance = np.linalg.norm(position[i] - position[j], axis=-1)
    p = int(np.argmin(distance))
    if distance[p] == 0.0:
        raise UserError(f"vehicles {i[p] + 1} and {j[p] + 1} start at one place, {position[i[p]]} m")
    h = barrier.values(start).h
    p = int(np.argmin(h))
    if h[p] >= -guarantees.H_TOLERANCE_M:
        return True
    if not force:
        raise UserError(
            f"the start is outside the safe set: h = {h[p]:.3f} for vehicles {i[p] + 1} and {j[p] + 1},"
            f" {distance[p]:.1f} m apart; --force flies it all the same"
        )
    return False


def _true_pairs(
    decision: Decision, filter_: Filter, barrier: Barrier, view: View, truth: State
) -> PairValues:
    """The unmodified barrier at the true state; the filter's own values where they are just that."""
    same = view.state is truth and getattr(filter_, "barrier", None) is barrier
    if decision.pairs is not None and same:
        return decision.pairs
    return barrier.values(truth)


def _vehicle_rows(
    t: float, truth: State, rates: Command, wanted: Command, decision: Decision, further: Columns
) -> Columns:
    n = len(truth)
    columns = {"t_s": np.full(n, t), "vehicle": np.arange(1, n + 1, dtype=np.int32)}
    columns |= {"x_m": truth.x, "y_m": truth.y, "z_m": truth.z, "theta_rad": truth.theta}
    for suffix, c in (("", rates), ("_nominal", wanted), ("_command", decision.command)):
        columns |= {f"v{suffix}_mps": c.v, f"omega{suffix}_radps": c.omega, f"zeta{suffix}_mps": c.zeta}
    columns |= {"override": decision.override, "qp_status": STATUS_NAMES[decision.status]}
    return columns | further


def _pair_rows(
    t: float, truth: State, decision: Decision, true: PairValues, lie: tuple[Array, Array]
) -> dict[str, np.ndarray]:
    position = _position(truth)
    u = decision.command.array()
    predicted = np.sum(lie[0] * u[true.i], axis=-1) + np.sum(lie[1] * u[true.j], axis=-1)
    size = true.h.size
    return {
        "t_s": np.full(size, t),
        "i": (true.i + 1).astype(np.int32),
        "j": (true.j + 1).astype(np.int32),
        "distance_m": np.linalg.norm(position[true.i] - position[true.j], axis=-1),
        "h_m": true.h,
        "h_filter_m": decision.pairs.h if decision.pairs is not None else np.full(size, np.nan),
        "hdot_predicted_mps": predicted,
    }


def _manifest(s: Scenario, tally: Tally, end: str | None) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": s.model_dump(mode="json"),
        "seed_streams": list(generators(s.seed)),
        "versions": catalogue.versions(),
        "airframes": catalogue.airframe_hashes(s),
        "ended_early": end,
        "filter_steps": tally.filter_steps,
        "worst_qp_residual": tally.worst_residual,
        "override_share": (tally.override_steps / max(1, tally.filter_steps)).tolist(),
    }
