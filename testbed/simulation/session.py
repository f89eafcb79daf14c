"""Session: a run that is stepped one filter period at a time, and judged when it is over."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from filters.cbf.intruders import released
from filters.filter import Decision
from filters.model import Command
from testbed.components import catalogue
from testbed.components.border.contract import Breach
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.components.provenance import Origin
from testbed.records.run import MemorySink, RowWriter, Run, Sink
from testbed.scenario import capacity
from testbed.scenario.scenario import Scenario
from testbed.simulation import termination
from testbed.simulation.assembly import Assembled, Setting, put_together, set_up
from testbed.simulation.counting import counted
from testbed.simulation.judgement import judge
from testbed.simulation.leaving import leaving
from testbed.simulation.near_pairs import near_pairs, with_near_filter
from testbed.simulation.recorder import Recorder
from testbed.simulation.step import Step, advance, given, unfiltered
from testbed.simulation.step_buffer import StepBuffer, keep_freed_memory


def assemble(
    scenario: Scenario, parts: Parts | None = None, *, force: bool = False, sink: Sink | None = None
) -> Session:
    """A session of `scenario`, to be `reset`.

    parts   plant, filter, guidance or environment of your own; None is the scenario's
    force   fly even from a start outside the safe set
    sink    where the tables go; None keeps them in memory. A session with a sink can be reset once
    Raises  UserError if the tables would not fit in memory
    """
    if sink is None:
        capacity.check_in_memory(scenario)
    return Session(scenario, parts or Parts(), force, sink)


class Session:
    """A run in steps: `reset`, `step` until a step is done, `judge`; or `for step in session`, then `judge`.

    See `assemble`. Iterating resets the session and steps it to its end by the scenario's own guidance.
    """

    def __init__(self, scenario: Scenario, parts: Parts, force: bool, sink: Sink | None) -> None:
        self.scenario = scenario
        self._parts, self._force, self._sink = effective(scenario, parts), force, sink
        self._own = self._parts.own()
        self._setting: Setting | None = None
        self._made: Assembled | None = None
        self._open = False
        self._run: Run | None = None

    def reset(self) -> Step:
        """Make all parts anew and start at t = 0; the step has no decision yet.

        Raises  UserError for a start outside the safe set, two vehicles at one place, or no steady flight;
                RuntimeError if a session with a sink of its own is reset again
        """
        if self._setting is not None and self._sink is not None:
            raise RuntimeError("this session has written to its sink; assemble another one")
        self.close()
        self._began = time.perf_counter()
        keep_freed_memory()
        s, self._run = self.scenario, None
        self._end: str | None = None
        setting = self._setting = set_up(s, self._force)
        try:
            self._made = put_together(setting, self._parts, self._own)
        except Breach as breach:
            self._end = termination.ended(termination.raised("", breach, 0), 0.0)
        made = self._made
        near = near_pairs(setting, self._own) if made else None
        if made:
            self._made = made = with_near_filter(made, near)
        self._statistics = counted(setting, made, self._own, near)
        self._memory = MemorySink() if self._sink is None else None
        self._rows = RowWriter(self._sink or self._memory)  # type: ignore[arg-type]
        own = self._statistics.own is not None
        self._buffer = StepBuffer(s.vehicles, s.rates.fdm_steps, own, near is not None)
        self._recorder = Recorder(
            self._buffer,
            self._statistics,
            self._rows,
            setting.barrier,
            catalogue.alpha(s),
            setting.limits,
            s.rates.filter_dt_s,
            s.rates.fdm_dt_s,
            made is not None and made.air is not None,
            s.goal.on_arrival == "leave",
            near,
        )
        self._leaving = leaving(s, setting.goal)
        self._still = np.zeros((s.vehicles, 3))
        self._waiting = deque([Command.of(np.zeros((s.vehicles, 3)))] * s.guidance.delay_steps)
        self._count, self._recorded, self._commanded, self._unfiltered = 0, False, False, False
        self._nominal: Command | None = None
        self._decision: Decision | None = None
        self._open = True
        if made is None:
            rates = np.zeros((s.vehicles, 3))
            self._now = Step(0.0, setting.start, Command.of(rates), None, None, None, None, True, self._end)
            return self._now
        return self._arrive(None, None, True)

    @property
    def setting(self) -> Setting:
        """What the scenario alone decides: start, goals, limits, barrier. RuntimeError before `reset`."""
        if self._setting is None:
            raise RuntimeError("nothing is set up yet: reset() does it")
        return self._setting

    def step(
        self, commands: Command | None = None, *, of: NDArray[np.bool_] | None = None, filtered: bool = True
    ) -> Step:
        """Fly one filter period, and return where it led.

        commands  (N,) wanted instead of what guidance wants, at once and without its delay; the filter alters
                  it. None asks guidance. At the run's last instant nothing is flown any more: what was given
                  for the last period is recorded there too
        of        (N,) bool: whose commands are given; the others are asked of guidance. None: everybody's
        filtered  False flies what is wanted as it is, past the filter and unclipped
        Raises    RuntimeError if the session was not reset, or its run is over; ValueError if `commands` are
                  not finite, or not one per vehicle
        """
        if not self._open or self._made is None or self._now.done:
            raise RuntimeError("no run to step: reset() starts one")
        if commands is not None:
            self._check(commands, of)
        t, dt, n = self._now.t, self.scenario.rates.filter_dt_s, self.scenario.rates.fdm_steps
        if not self._decide(commands, of, filtered):
            return self._stopped()
        assert self._decision is not None
        try:
            plant, environment = self._made.plant, self._made.environment
            track = advance(plant, environment, self._decision.command, t, self._now.air, n)
            faults = plant.faults()
            fault = termination.lost(faults if self._leaving is None else self._leaving.well(faults), track)
        except Exception as error:
            fault = termination.raised("flying", error, self._count)
        if fault is not None:
            self._end = termination.ended(fault, t + dt)
            return self._stopped()
        self._buffer.move(track)
        self._count += 1
        return self._arrive(commands, of, filtered)

    def judge(self) -> Run:
        """The run and its verdicts. Before the run is done this ends it early, and nothing holds.

        Raises  RuntimeError if the session was not reset
        """
        if self._run is not None:
            return self._run
        if self._setting is None or not self._open:
            raise RuntimeError("no run to judge: reset() starts one")
        if not self._now.done:
            self._end = termination.ended("judged before its end", self._now.t)
        self._recorder.close()
        self._rows.close()
        handed = {"nominal": Origin("commands given step by step")} if self._commanded else {}
        handed |= {"filter": Origin("passed by on request")} if self._unfiltered else {}
        own = self._own | handed
        left = self._leaving
        self._run = judge(self._setting, self._made, self._statistics, own, self._end, left)
        self._run.manifest |= self._recorder.said()
        self._run.timing = {"wall_s": time.perf_counter() - self._began}
        if self._memory is not None:
            self._run.tables = self._memory.tables()
        self.close()
        return self._run

    def close(self) -> None:
        """Close the plant; a run that was not judged is lost. May be called twice."""
        self._open = False
        if self._made is not None:
            self._made.plant.close()
            self._made = None

    def __iter__(self) -> Iterator[Step]:
        step = self.reset()
        yield step
        while not step.done:
            step = self.step()
            yield step

    def _arrive(self, commands: Command | None, of: NDArray[np.bool_] | None, filtered: bool) -> Step:
        """Read the vehicles' states; at the last instant decide once more, for the record."""
        assert self._made is not None
        t = self._count * self.scenario.rates.filter_dt_s
        plant, environment = self._made.plant, self._made.environment
        truth, rates = plant.state(), plant.achieved()
        last = self._count == self.scenario.filter_steps
        view, air = None, None
        try:
            air, view = environment.wind(t, truth), environment.observe(t, truth, rates)
            if self._leaving is not None:
                self._leaving.look(t, truth)
                view = self._leaving.unseen(view)
        except Exception as error:
            self._end = termination.ended(termination.raised("deciding", error, self._count), t)
        flown = self._nominal, self._decision
        self._now = Step(t, truth, rates, view, air, *flown, last or self._end is not None, self._end)
        if last and self._end is None and not self._decide(commands, of, filtered):
            self._now = Step(t, truth, rates, view, air, *flown, True, self._end)
        return self._now

    def _decide(self, commands: Command | None, of: NDArray[np.bool_] | None, filtered: bool) -> bool:
        """Take the decision for now and put the step into the buffer; False if a part failed."""
        assert self._made is not None and self._setting is not None
        now, made, step = self._now, self._made, self._count
        assert now.view is not None
        try:
            if commands is None or of is not None:
                self._waiting.append(made.guidance(now.t, now.view.own()))
                wanted = self._waiting.popleft()
            if commands is not None:
                wanted, self._commanded = commands if of is None else given(wanted, commands, of), True
            if filtered:
                decision = made.filter(now.view, wanted, self._setting.limits)
                if self._setting.roles is not None:
                    who = self._setting.roles.intruders
                    decision = released(decision, wanted, self._setting.limits, who)
            else:
                decision, self._unfiltered = unfiltered(wanted), True
            if filtered and made.refused:
                self._statistics.refused(now.t, decision.command.array(), self._setting.limits)
                raise made.refused
            declared = self._statistics.declared
            if declared is not None and filtered:
                declared.update(now.t, made.rows(now.view), decision.command.array())
            own = None
            if self._statistics.own is not None:
                own = made.declared(now.state, decision.command if filtered else None)
            # A recorded step is complete only with the state that followed it.
            recorded, before = step % self.scenario.rates.record_steps == 0, self._recorded
            telemetry = made.plant.telemetry() if recorded or before else {}
        except Exception as error:
            self._end = termination.ended(termination.raised("deciding", error, step), now.t)
            return False
        self._nominal, self._decision, self._recorded = wanted, decision, recorded
        # The filter's own barrier values are the true ones only without disturbances and remedies.
        seen = now.view.state is now.state and now.view.known is None
        true = filtered and seen and made.valued is self._setting.barrier
        if self._buffer.full:
            self._recorder.look()
        air = self._still if now.air is None else now.air
        here = now.t, now.state, now.rates, air, wanted, decision
        gone = self._leaving.gone if self._leaving is not None and self._leaving.gone.any() else None
        self._buffer.add(*here, true, recorded, telemetry, own, gone)
        return True

    def _stopped(self) -> Step:
        """The step at which a run ends early: where the vehicles were last."""
        n = self._now
        self._now = Step(n.t, n.state, n.rates, n.view, n.air, self._nominal, self._decision, True, self._end)
        return self._now

    def _check(self, commands: Command, of: NDArray[np.bool_] | None) -> None:
        if commands.shape != (self.scenario.vehicles,):
            raise ValueError(
                f"commands are one per vehicle, ({self.scenario.vehicles},), got {commands.shape}"
            )
        if not commands.isfinite().all():
            raise ValueError(f"commands must be finite, got {commands}")
        if of is not None and (np.shape(of) != commands.shape or np.asarray(of).dtype != bool):
            raise ValueError(f"`of` is one truth value per vehicle, {commands.shape}, got {of!r}")
