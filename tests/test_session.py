"""A session: stepped by hand it is the run, and commands may come from outside."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import testbed
from aircraft.kinematic import KinematicFleet
from filters.model import Array, Command
from testbed.records.run import Run
from testbed.records.verdict import Kind
from testbed.scenario.scenario import Scenario

BRIEF = ["duration_s=1", "start.radius_m=40", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=2"]
KINDS = {
    "turn": [],
    "disturbed": [
        "plant=lagged",
        "wind.speed_mps=3",
        "sensing.position_noise_m=0.5",
        "guidance.delay_steps=2",
    ],
    "aircraft": ["plant=jsbsim", "lookahead_m=10", "manoeuvre_instants=0", "start.radius_m=60"],
    "alone": ["vehicles=1"],
    "no time": ["duration_s=0"],
}


def scenario(*overrides: str) -> Scenario:
    return testbed.load_scenario("paper-2-turn", [*BRIEF, *overrides])


def same(one: Run, other: Run) -> None:
    """Every table, verdict and setting is the same, bit for bit."""
    assert one.manifest == other.manifest
    assert repr(one.guarantees) == repr(other.guarantees)
    assert one.vehicles.equals(other.vehicles) and one.pairs.equals(other.pairs)


@pytest.mark.parametrize("kind", KINDS)
def test_a_session_stepped_by_hand_is_the_run(kind: str) -> None:
    s = scenario(*KINDS[kind])
    session = testbed.assemble(s, force=True)
    step, times = session.reset(), [0.0]
    assert step.nominal is None or step.done
    while not step.done:
        step = session.step()
        times.append(step.t)
        assert step.decision is not None and step.nominal is not None and step.view is not None
    assert times == pytest.approx(np.arange(s.filter_steps + 1) * 0.05)
    assert step.fault is None and step.t == pytest.approx(s.duration_s)
    same(session.judge(), testbed.run(s, force=True))


def test_reset_starts_the_same_run_anew() -> None:
    session = testbed.assemble(scenario("sensing.position_noise_m=0.5"), force=True)
    session.reset()
    for _ in range(5):
        session.step()
    for _ in session:
        pass
    first = session.judge()
    for _ in session:
        pass
    same(session.judge(), first)


def test_commands_from_outside_are_what_the_filter_alters() -> None:
    session = testbed.assemble(scenario("guidance.delay_steps=3"), force=True)
    step, straight = session.reset(), Command([20.0, 20.0], [0.0, 0.0], [0.0, 0.0])
    while not step.done:
        step = session.step(straight)
        assert step.nominal is straight
    run = session.judge()
    assert (run.vehicles.v_nominal_mps == 20.0).all() and (run.vehicles.omega_nominal_radps == 0.0).all()
    assert run.vehicles.override.any(), "40 m apart and head-on the filter has to turn them"
    assert run.part("nominal") == "commands given step by step"


def test_guidance_given_by_hand_flies_the_run() -> None:
    """The scenario's own guidance, asked from outside, gives the tables of the run."""
    from testbed.components import catalogue
    from testbed.components.initial_conditions import generators, places

    s = scenario()
    _, goal = places(s, generators(s.seed)["start"])
    guidance = catalogue.guidance(s, goal, catalogue.barrier(s))
    session = testbed.assemble(s, force=True)
    step = session.reset()
    while not step.done:
        assert step.view is not None
        step = session.step(guidance(step.t, step.view.own()))
    whole, given = testbed.run(s, force=True), session.judge()
    flown = ["x_m", "y_m", "theta_rad", "v_command_mps", "omega_command_radps"]
    until = s.filter_steps * 2  # at the last instant the command before stays
    assert whole.vehicles[flown][:until].equals(given.vehicles[flown][:until])


def test_commands_for_one_vehicle_leave_the_others_to_their_guidance() -> None:
    """Guidance keeps its delay meanwhile: the others want what they want in a run that nobody touches."""
    s = scenario("guidance.delay_steps=3", "start.radius_m=190", "vehicles=3")
    session = testbed.assemble(s, force=True)
    step, of = session.reset(), np.array([False, True, False])
    while not step.done:
        step = session.step(Command([0.0, 18.0, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, 0.0]), of=of)
    given, whole = session.judge().vehicles, testbed.run(s, force=True).vehicles
    of_second = given.vehicle == 2
    wanted = ["v_nominal_mps", "omega_nominal_radps", "zeta_nominal_mps"]
    assert given[of_second][wanted].eq([18.0, 0.1, 0.0]).all(axis=None)
    # 190 m apart the filter changes nobody's way.
    assert given[~of_second][wanted].equals(whole[whole.vehicle != 2][wanted])


@pytest.mark.parametrize("of", [np.array([True]), np.array([0, 1]), [1]])
def test_whose_commands_are_given_is_said_by_a_truth_value_each(of: object) -> None:
    session = testbed.assemble(scenario(), force=True)
    session.reset()
    with pytest.raises(ValueError, match="`of` is one truth value per vehicle"):
        session.step(Command([20.0, 20.0], [0.0, 0.0], [0.0, 0.0]), of=of)  # type: ignore[arg-type]


def test_a_session_tells_goals_and_limits_once_it_is_set_up() -> None:
    session = testbed.assemble(scenario(), force=True)
    with pytest.raises(RuntimeError, match=r"reset\(\) does it"):
        _ = session.setting
    session.reset()
    assert session.setting.goal == pytest.approx(np.array([[40.0, 0, 0], [-40.0, 0, 0]]))
    assert len(session.setting.limits) == 2


def test_past_the_filter_commands_are_flown_unclipped_and_judged() -> None:
    session = testbed.assemble(scenario(), force=True)
    step, fast = session.reset(), Command([40.0, 40.0], [0.5, 0.5], [0.0, 0.0])
    while not step.done:
        step = session.step(fast, filtered=False)
    run = session.judge()
    assert (run.vehicles.v_mps[run.vehicles.t_s > 0] == 40.0).all()
    assert run.guarantee("command-limits")["verdict"] == "violated"
    assert run.part("filter") == "passed by on request"
    assert run.guarantee("qp-feasibility")["verdict"] == "not applicable"


@pytest.mark.parametrize(
    ("commands", "said"),
    [
        (Command([20.0], [0.0], [0.0]), r"one per vehicle, \(2,\), got \(1,\)"),
        (Command([20.0, np.nan], [0.0, 0.0], [0.0, 0.0]), "must be finite"),
    ],
)
def test_commands_that_cannot_be_flown_are_refused_and_the_run_goes_on(commands: Command, said: str) -> None:
    session = testbed.assemble(scenario(), force=True)
    session.reset()
    with pytest.raises(ValueError, match=said):
        session.step(commands)
    assert session.step().t == pytest.approx(0.05)


def test_judged_in_the_middle_a_run_ended_early(tmp_path: Path) -> None:
    session = testbed.assemble(scenario(), force=True)
    session.reset()
    for _ in range(7):
        session.step()
    run = session.judge()
    assert run.manifest["ended_early"] == "judged before its end at 0.350 s; run stopped"
    verdicts = {g["id"]: g["verdict"] for g in run.guarantees if g.kind is Kind.GUARANTEE}
    assert "holds" not in verdicts.values() and verdicts["separation"] == "premise not met"
    assert run.manifest["filter_steps"] == 7 and len(run.vehicles) == 14
    assert session.judge() is run


def test_a_session_is_used_in_order_and_closed_twice() -> None:
    session = testbed.assemble(scenario(), force=True)
    for use in (session.step, session.judge):
        with pytest.raises(RuntimeError, match=r"reset\(\) starts one"):
            use()
    session.reset()
    session.close()
    session.close()
    with pytest.raises(RuntimeError, match=r"reset\(\) starts one"):
        session.step()
    for _ in session:
        pass
    with pytest.raises(RuntimeError, match=r"reset\(\) starts one"):
        session.step()


def test_a_plant_is_closed_when_its_run_is_judged() -> None:
    closed = []

    class Closing(KinematicFleet):
        def close(self) -> None:
            closed.append(self)

    parts = testbed.Parts(plant=lambda s, wind: Closing(s.vehicles, s.rates.fdm_dt_s))
    testbed.run(scenario("manoeuvre_instants=0"), parts=parts, force=True)
    assert len(closed) == 1


class OldPlant:
    """A plant as plants were before: reset without wind and speed, and no close."""

    def __init__(self, s: Scenario, wind: Array) -> None:
        self.fleet = KinematicFleet(s.vehicles, s.rates.fdm_dt_s)
        self.dt = self.fleet.dt
        self.step, self.state, self.achieved = self.fleet.step, self.fleet.state, self.fleet.achieved
        self.telemetry, self.faults = self.fleet.telemetry, self.fleet.faults

    def reset(self, state, rng):  # type: ignore[no-untyped-def]
        self.fleet.reset(state, rng)


class SpeedOnly(OldPlant):
    def reset(self, state, rng, speed):  # type: ignore[no-untyped-def]
        self.fleet.reset(state, rng, speed=speed)


@pytest.mark.parametrize("plant", [OldPlant, SpeedOnly])
def test_a_plant_is_given_only_what_its_reset_takes(plant: type) -> None:
    own = testbed.run(scenario(), parts=testbed.Parts(plant=plant), force=True)
    assert own.manifest["ended_early"] is None
    assert own.vehicles.equals(testbed.run(scenario(), force=True).vehicles)


def test_guidance_of_ones_own_is_asked_with_the_view_or_with_the_state() -> None:
    seen = {}

    def by_view(s, goal, barrier):  # type: ignore[no-untyped-def]
        def law(t, view):  # type: ignore[no-untyped-def]
            seen["view"] = view
            return Command(view.rates.v, 0 * view.state.x, 0 * view.state.x)

        return law

    class ByState:
        def __init__(self, s, goal, barrier):  # type: ignore[no-untyped-def]
            pass

        def __call__(self, t, where):  # type: ignore[no-untyped-def]
            seen["state"] = where
            return Command(20.0 + 0 * where.x, 0 * where.x, 0 * where.x)

    s = scenario("filter.kind=none")
    runs = [testbed.run(s, parts=testbed.Parts(nominal=law), force=True) for law in (by_view, ByState)]
    assert runs[0].vehicles.v_nominal_mps.eq(20.0).all() and runs[0].vehicles.equals(runs[1].vehicles)
    assert type(seen["view"]).__name__ == "View" and type(seen["state"]).__name__ == "State"
