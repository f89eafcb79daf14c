"""The one loop: any plant, any filter, any scenario."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aircraft.airframes.schema import Airframe
from aircraft.plant import Plant
from aircraft.replay import Replay
from filters.barriers.closed_form import Barrier, all_pairs
from filters.filter import Choose, declaration
from filters.model import Array, Command, Limits, State
from testbed.claims import guarantees, judging, manoeuvre
from testbed.claims.flyable import unflyable
from testbed.claims.monitored import monitored
from testbed.claims.premises import premises
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.components.initial_conditions import generators, places
from testbed.environment.disturbance import Disturbance
from testbed.errors import UserError
from testbed.measures.near_misses import NearMisses
from testbed.measures.run_statistics import RunStatistics
from testbed.measures.saturation import Saturation
from testbed.measures.solo_time import solo_time
from testbed.records.run import MemorySink, RowWriter, Run, Sink
from testbed.records.store import RunWriter, load, staged
from testbed.scenario import capacity
from testbed.scenario.scenario import SCHEMA_VERSION, Scenario
from testbed.simulation import termination
from testbed.simulation.recorder import Recorder
from testbed.simulation.step_buffer import StepBuffer

Progress = Callable[[float, float], None]
# Gusts change within a long filter period: the air is asked at least so often [s].
WIND_PERIOD_S = 0.05


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
        capacity.check_in_memory(scenario)
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
        _keep_freed_memory()
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
        near_misses = NearMisses(i.size, s.d_safe_m) if replay else None
        statistics = RunStatistics(s.vehicles, Saturation(aircraft), near_misses)
        statistics.start(_position(start), goal, s.goal_radius_m)
        rows = RowWriter(self.sink)
        buffer = StepBuffer(s.vehicles, s.rates.fdm_steps)
        periods = s.rates.filter_dt_s, s.rates.fdm_dt_s
        alpha, windy = catalogue.alpha(s), disturbance.windy
        recorder = Recorder(buffer, statistics, rows, barrier, alpha, limits, *periods, windy)
        filter_ = self.parts.filter(s, barrier, goal)
        end = self._loop(plant, disturbance, filter_, barrier, limits, goal, recorder)
        rows.close()
        straight = np.linalg.norm(goal - _position(start), axis=-1)
        nominal = self.parts.nominal(s, goal, barrier)
        solo_time_s = solo_time(nominal, limits, _position(start), goal, s.goal_radius_m)
        flown = guarantees.Flown(s, statistics, i, j, started_safe, end, straight, solo_time_s)
        own = self.parts.own()
        # What a plant of one's own can fly steadily, nobody has said: that is no pass.
        unknown = [f"unknown whether {own['plant']} can fly it"] if "plant" in own else []
        verdicts = premises(flown, barrier, limits, unknown or unflyable(s, barrier, aircraft))
        verdicts += guarantees.judge(flown)
        if replay is not None and near_misses is not None and end is None:
            near_misses.close()
            when = manoeuvre.instants(s, near_misses, s.duration_s)
            verdicts.append(manoeuvre.fly(s, replay.branch, disturbance.wind, barrier, limits, when, i, j))
        manifest = _manifest(s, statistics, end, aircraft) | ({"parts": own} if own else {})
        record = declaration(filter_).record
        if record is not None:
            verdicts += monitored(record, s)
            manifest["qp_cost"] = {
                "steps": record.compared,
                "centralised": record.cost,
                "limited": record.cost_limited,
            }
        return Run(manifest, judging.void(verdicts, end), {"wall_s": time.perf_counter() - began})

    def _loop(
        self,
        plant: Plant,
        disturbance: Disturbance,
        filter_: Choose,
        barrier: Barrier,
        limits: Limits,
        goal: Array,
        recorder: Recorder,
    ) -> str | None:
        """Fly to the end; returns why it ended early, or None."""
        s, buffer = self.scenario, recorder.buffer
        nominal = self.parts.nominal(s, goal, barrier)
        waiting = deque([Command.of(np.zeros((s.vehicles, 3)))] * s.nominal.delay_steps)
        steps, dt, n = s.filter_steps, s.rates.filter_dt_s, s.rates.fdm_steps
        recorded, end, own = False, None, declaration(filter_).barrier
        for step in range(steps + 1):
            t = step * dt
            truth, rates = plant.state(), plant.achieved()
            try:
                air, view = disturbance.wind(t, truth), disturbance.observe(t, truth, rates)
                waiting.append(nominal(t, view.own().state))
                wanted = waiting.popleft()
                decision = filter_(view, wanted, limits)
            except Exception as error:
                end = f"{termination.raised('deciding', error)} at {t:.3f} s; run stopped"
                break
            # The step before, if recorded, needs to know what came of it.
            recorded, told = step % s.rates.record_steps == 0, recorded
            telemetry = plant.telemetry() if recorded or told else {}
            # The filter's own barrier values are the true ones only without disturbances and remedies.
            true = view.state is truth and own is barrier
            if buffer.full:
                recorder.look()
            buffer.add(t, truth, rates, air, wanted, decision, true, recorded, telemetry)
            if self.progress is not None:
                self.progress(t, s.duration_s)
            if step == steps:
                break
            try:
                track = _advance(plant, disturbance, decision.command, t, air, n)
                fault = termination.lost(plant.faults(), track)
            except Exception as error:
                fault = termination.raised("flying", error)
            if fault is not None:
                end = f"{fault} at {t + dt:.3f} s; run stopped"
                break
            buffer.move(track)
        recorder.close()
        return end


def _keep_freed_memory() -> None:
    """Let what one step frees serve the next: otherwise every large array is mapped anew, page by page."""
    # glibc keeps blocks up to the size of the largest mapped one ever freed, 32 MiB at most. With 100
    # vehicles that halves the barrier's time; elsewhere it does nothing.
    np.empty(31 << 20, dtype=np.uint8)


def _advance(plant: Plant, disturbance: Disturbance, command: Command, t: float, air: Array, n: int) -> Array:
    """Fly `command` for n periods from time t, where the wind is `air`; positions (n, N, 3) m."""
    most = max(1, int(WIND_PERIOD_S / plant.dt + 1e-9)) if disturbance.windy else n
    if most >= n:
        return plant.step(command, air, n)
    track = [plant.step(command, air, most)]
    for k in range(most, n, most):
        air = disturbance.wind(t + k * plant.dt, plant.state())
        track.append(plant.step(command, air, min(most, n - k)))
    return np.concatenate(track)


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


def _manifest(
    s: Scenario, statistics: RunStatistics, end: str | None, aircraft: Sequence[Airframe]
) -> dict[str, Any]:
    return {
        "schema_version": SCHEMA_VERSION,
        "scenario": s.model_dump(mode="json"),
        "seed_streams": list(generators(s.seed)),
        "versions": catalogue.versions(),
        "airframes": catalogue.airframe_hashes(s, aircraft),
        "ended_early": end,
        "filter_steps": statistics.filter_steps,
        "worst_qp_residual": statistics.worst_residual,
        "override_share": (statistics.override_steps / max(1, statistics.filter_steps)).tolist(),
    }
