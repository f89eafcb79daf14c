"""The border: what a part is given is its own, what it returns is checked, and a breach is named."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import testbed
from filters.barriers.pairs import PairValues
from filters.cbf.collision import CollisionFilter, Passthrough
from filters.constraints import Constraints
from filters.filter import Decision, Declaration
from filters.model import Array, Command, State, View
from testbed.components import catalogue
from testbed.environment.environment import build
from testbed.errors import UserError
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario
from tests.fuzzing.parts import Honest

BRIEF = [
    "duration_s=0.2",
    "filter_dt_s=0.02",
    "record_dt_s=0.04",
    "manoeuvre_instants=0",
    "start.radius_m=40",
]


def flown(*overrides: str, **parts: Any) -> Run:
    return testbed.run(
        testbed.load_scenario("paper-2-turn", [*BRIEF, *overrides]), parts=testbed.Parts(**parts), force=True
    )


def ended(run: Run) -> str:
    """Why it ended; nothing holds but premises."""
    end = run.manifest["ended_early"]
    assert end is not None
    held = {g["id"] for g in run.guarantees if g["verdict"] == "holds" and not g["number"].startswith("P")}
    assert not held
    return str(end)


# A plant that is honest but for one method.


def plant(**methods: Callable[..., Any]) -> Callable[..., Any]:
    return type("Own", (Honest,), methods)


def aside(self: Honest) -> State:
    return State(self.now.x, self.now.y + 30.0 * bool(self.commands), self.now.theta, self.now.z)


def late(self: Honest) -> State:
    return State.of(self.states[-2] if len(self.states) > 1 else self.states[0])


def nan_course(self: Honest) -> State:
    x = self.now.array()
    x[0, 2] = np.nan if len(self.commands) == 3 else x[0, 2]
    return State.of(x)


def last_only(self: Honest, command: Command, wind: Array, n: int) -> Array:
    return Honest.step(self, command, wind, n)[-1:]


def elsewhere(self: Honest, state: State, rng: Any) -> None:
    Honest.reset(self, State(state.x + 1.0, state.y, state.theta, state.z), rng)


def raising(*_: Any) -> Any:
    raise RuntimeError("the engine\nfell off")


PLANTS: dict[str, tuple[Callable[..., Any], str]] = {
    "state away from the track": (plant(state=aside), "state() is 30 m away from the end of the track"),
    "late state": (plant(state=late), "m away from the end of the track of step(), in step 0 at 0.020 s"),
    "NaN in a course": (plant(state=nan_course), "state().theta is not finite: nan, vehicle 1, in step 2"),
    "track of one period": (plant(step=last_only), "the track of step() has shape (1, 2, 3), not (4, 2, 3)"),
    "no track": (plant(step=lambda *_: None), "the track of step() is None, not an array of real numbers"),
    "track of words": (plant(step=lambda *_: np.array(["a"])), "dtype <U1, not an array of real numbers"),
    "track beyond sense": (
        plant(step=lambda self, c, w, n: np.full((n, 2, 3), 1e300)), "is 1e+300, beyond 1e+09, vehicle 1"
    ),
    "start elsewhere": (plant(reset=elsewhere), "state() after reset() is 1 m and 0 rad away from the start"),
    "no State": (plant(state=lambda self: self.now.array()), "state() is a ndarray, not a State"),
    "rates of another count": (
        plant(achieved=lambda self: Command([1.0], [0.0], [0.0])), "achieved().v has shape (1,), not (2,)"
    ),
    "telemetry that is recorded": (
        plant(telemetry=lambda self: {"x_m": np.zeros(2)}), "a channel x_m, which the testbed itself records"
    ),
    "telemetry of another count": (
        plant(telemetry=lambda self: {"flap": np.zeros(3)}), "telemetry()['flap'] has shape (3,), not (2,)"
    ),
    "telemetry that changes": (
        plant(telemetry=lambda self: {f"c{len(self.commands)}": np.zeros(2)}), "other channels than before"
    ),
    "telemetry without a name": (plant(telemetry=lambda self: {3: np.zeros(2)}), "a channel 3, which is no"),
    "faults of another count": (plant(faults=lambda self: [""]), "faults() is not a list of 2 strings"),
    "faults that are numbers": (plant(faults=lambda self: [0, 0]), "faults() has a int in it, not strings"),
    "another period": (
        plant(reset=lambda self, s, r: setattr(self, "dt", 1.0) or Honest.reset(self, s, r)),
        "its dt is 1 s, the scenario's rates.fdm_dt_s is 0.005 s",
    ),
    "a method that raises": (plant(achieved=raising), "achieved() raised RuntimeError: the engine fell off"),
    "no method": (plant(faults=None), "it has no method faults()"),
    "a maker that raises": (raising, "making it raised RuntimeError: the engine fell off"),
    "a maker of nothing": (lambda s, wind: None, "it has no method reset()"),
}  # fmt: skip


@pytest.mark.parametrize("clause", PLANTS)
def test_a_plant_that_breaks_a_clause_ends_the_run(clause: str) -> None:
    maker, said = PLANTS[clause]
    end = ended(flown(plant=maker))
    assert end.startswith("plant ") and said in end and re.search(r", in step \d+ at [\d.]+ s; run", end), end


def changed(**fields: Callable[[Decision], Any]) -> Callable[..., Any]:
    """The scenario's filter, with these fields of every decision changed."""

    def make(s: Scenario, barrier: Any, goal: Array) -> Callable[..., Decision]:
        made = catalogue.filter_(s, barrier, goal)

        def choose(view: View, nominal: Command, limits: Any) -> Decision:
            d = made(view, nominal, limits)
            return replace(d, **{name: change(d) for name, change in fields.items()})

        return choose

    return make


FILTERS: dict[str, tuple[Callable[..., Any], str]] = {
    "raises at once": (lambda *_: raising, "the call raised RuntimeError: the engine fell off"),
    "makes nothing": (lambda *_: None, "it is a NoneType, which cannot be called"),
    "decides nothing": (lambda *_: lambda *_: None, "it returned a NoneType, not a Decision"),
    "commands one": (changed(command=lambda d: d.command[:1]), "command.v has shape (1,), not (2,)"),
    "status unknown": (changed(status=lambda d: d.status + 9), "a value that filters.qp.Status has not"),
    "status of floats": (changed(status=lambda d: d.status * 1.0), "dtype float64, not an array of whole"),
    "residual NaN": (changed(residual=lambda d: d.residual * np.nan), "residual is not finite: nan, vehicle"),
    "override of numbers": (changed(override=lambda d: np.zeros(2)), "override is a ndarray of dtype float"),
    "h of words": (changed(pairs=lambda d: replace(d.pairs, h=["a"])), "pairs.h is a list, not an array"),
    "other pairs": (
        changed(pairs=lambda d: replace(d.pairs, i=np.array([1]), j=np.array([0]))), "pairs.i are not those"
    ),
    "no hdot": (changed(hdot_predicted=lambda d: np.zeros(0)), "hdot_predicted has shape (0,), not (1,)"),
}  # fmt: skip


@pytest.mark.parametrize("clause", FILTERS)
def test_a_filter_that_breaks_a_clause_ends_the_run(clause: str) -> None:
    maker, said = FILTERS[clause]
    end = ended(flown(filter=maker))
    assert (
        end.startswith("filter ") and said in end and end.endswith(", in step 0 at 0.000 s; run stopped")
    ), end


@pytest.mark.parametrize("number", [np.nan, np.inf, 1e300])
def test_a_command_that_is_no_number_violates_the_limits_at_that_step(number: float) -> None:
    calls = []

    def bad(d: Decision) -> Command:
        calls.append(d)
        v = d.command.v.copy()
        v[1] = number if len(calls) == 4 else v[1]
        return Command(v, d.command.omega, d.command.zeta)

    run = flown(filter=changed(command=bad))
    limits = run.guarantee("command-limits")
    assert (limits["verdict"], limits["t_s"], limits["vehicles"]) == ("violated", pytest.approx(0.06), [2])
    assert "command.v is" in ended(run) and ", vehicle 2, in step 3 at 0.060 s" in ended(run)


def environment(wind: Callable[..., Any] | None = None, observe: Callable[..., Any] | None = None) -> Any:
    class Own:
        def __init__(self, s: Scenario, rngs: Any) -> None:
            self.usual = build(s, rngs)

        def wind(self, t: float, state: State) -> Any:
            return self.usual.wind(t, state) if wind is None else wind(t, state)

        def observe(self, t: float, truth: State, rates: Command) -> Any:
            return self.usual.observe(t, truth, rates) if observe is None else observe(t, truth, rates)

    return Own


OTHERS: dict[str, tuple[dict[str, Any], str]] = {
    "guidance of one": (
        {"nominal": lambda *_: lambda t, state: Command([1.0], [0.0], [0.0])},
        "guidance .*: its command.v has shape \\(1,\\), not \\(2,\\)",
    ),
    "guidance of nothing": ({"nominal": lambda *_: lambda t, state: None}, "guidance .*: its command is"),
    "wind of one": (
        {"disturbance": environment(lambda t, s: np.zeros(3))}, "environment .*: wind\\(\\) has shape"
    ),
    "wind NaN": (
        {"disturbance": environment(lambda t, s: np.full((2, 3), np.nan))}, "wind\\(\\) is not finite: nan"
    ),
    "wind at times": (
        {"disturbance": environment(lambda t, s: None if t < 0.1 else np.zeros((2, 3)))},
        "wind\\(\\) is None at some times only",
    ),
    "no view": ({"disturbance": environment(None, lambda *_: 3)}, "observe\\(\\) is a int, not a View"),
    "view of mixed shapes": (
        {"disturbance": environment(None, lambda t, s, r: View(State.of(np.zeros((2, 2, 4))), r))},
        "observe\\(\\).rates.v has shape \\(2,\\), not \\(2, 2\\)",
    ),
    "view NaN": (
        {"disturbance": environment(None, lambda t, s, r: View(State.of(s.array() * np.nan), r))},
        "observe\\(\\).state.x is not finite",
    ),
    "no observation": ({"disturbance": lambda *_: object()}, "environment .*: it has no method wind"),
}  # fmt: skip


@pytest.mark.parametrize("clause", OTHERS)
def test_guidance_or_an_environment_that_breaks_a_clause_ends_the_run(clause: str) -> None:
    parts, said = OTHERS[clause]
    assert re.search(said, ended(flown(**parts)))


def shove(*things: Any) -> None:
    """Write into arrays even where they say that they are read-only."""
    for array in things:
        for target in (array.base, array):
            if target is not None:
                target.flags.writeable = True
        array += 50.0


class Shoving:
    """A filter that moves all it is given."""

    def __init__(self, s: Scenario, barrier: Any, goal: Array) -> None:
        self.filter = Passthrough()
        shove(goal)
        object.__setattr__(barrier, "d_safe", 0.1)
        s.__dict__["d_safe_m"] = 0.1
        s.limits.__dict__["v_max_mps"] = 500.0

    def __call__(self, view: View, nominal: Command, limits: Any) -> Decision:
        decision = self.filter(view, nominal, limits)
        shove(view.state.x, view.rates.v, nominal.omega, limits.v_max)
        return decision


def test_what_a_part_writes_reaches_nobody() -> None:
    honest = flown(filter=lambda s, b, goal: Passthrough())
    shoved = flown(filter=Shoving)
    assert shoved.manifest["ended_early"] is None and shoved.vehicles.equals(honest.vehicles)
    assert shoved.manifest["scenario"] == honest.manifest["scenario"]
    assert [g["value"] for g in shoved.guarantees] == [g["value"] for g in honest.guarantees]


def test_writing_into_what_it_is_given_is_refused_where_it_is_plain() -> None:
    def writes(s: Scenario, barrier: Any, goal: Array) -> Callable[..., Any]:
        def choose(view: View, nominal: Command, limits: Any) -> Any:
            view.state.y[:] += 50.0

        return choose

    assert re.search("the call raised ValueError: .*read-only", ended(flown(filter=writes)))


def test_a_track_changed_after_it_was_returned_changes_nothing() -> None:
    class Keeping(Honest):
        def step(self, command: Command, wind: Array, n: int) -> Array:
            for kept in self.__dict__.setdefault("kept", []):
                kept += 100.0
            track = super().step(command, wind, n)
            self.kept.append(track)
            return track

    assert repr(flown(plant=Keeping).guarantees[6:12]) == repr(flown(plant=Honest).guarantees[6:12])


# G4 and G6 of a filter of one's own.


class Bolder:
    """The paper's filter for 3 m less, that says of itself what it likes."""

    declares: Any = None

    def __init__(self, s: Scenario, barrier: Any, goal: Array) -> None:
        self.filter = CollisionFilter(replace(barrier, d_safe=barrier.d_safe - 3.0), catalogue.alpha(s))
        self.barrier = barrier

    def __call__(self, view: View, nominal: Command, limits: Any) -> Decision:
        d = self.filter(view, nominal, limits)
        fine = PairValues(*np.triu_indices(2, 1), np.full(1, 100.0), np.zeros((1, 8)))
        return replace(d, pairs=fine, hdot_predicted=np.full(1, 1e3))

    @property
    def declaration(self) -> Declaration:
        rows = self.filter.declaration.constraints if self.declares is None else self.declares
        return Declaration(barrier=self.barrier, constraints=rows, solves_qp=True, paper=True)


@pytest.mark.slow
def test_a_bolder_filter_is_judged_by_the_scenarios_barrier() -> None:
    s = testbed.load_scenario("paper-2-turn", ["manoeuvre_instants=0"])
    run = testbed.run(s, parts=testbed.Parts(filter=Bolder))
    said = {name: run.guarantee(name)["verdict"] for name in ("separation", "safe-set", "barrier-condition")}
    assert set(said.values()) == {"violated"}
    for name in ("qp-feasibility", "rows-satisfied"):
        found = run.guarantee(name)
        assert found["verdict"] == "premise not met" and "those of the scenario's barrier" in found["why"]


def test_a_filter_that_declares_nothing_is_not_judged_by_its_word() -> None:
    run = flown(filter=changed())
    for name in ("qp-feasibility", "rows-satisfied"):
        found = run.guarantee(name)
        assert found["verdict"] == "not applicable" and "declares no constraints" in found["why"]


class Declaring(Bolder):
    """The paper's filter itself, wrapped and declared."""

    def __init__(self, s: Scenario, barrier: Any, goal: Array) -> None:
        self.filter = CollisionFilter(barrier, catalogue.alpha(s))
        self.barrier = barrier


def test_declared_rows_that_are_the_scenarios_are_judged_as_the_papers() -> None:
    far = ["start.radius_m=150"]
    own, papers = flown(*far, filter=Declaring), flown(*far)
    for name in ("qp-feasibility", "rows-satisfied"):
        assert own.guarantee(name)["verdict"] == papers.guarantee(name)["verdict"] == "holds"
    assert own.guarantee("rows-satisfied")["value"] == pytest.approx(
        papers.guarantee("rows-satisfied")["value"]
    )


def one_row(vehicle: int, lie: list[float], rhs: float) -> Callable[[View], tuple[Constraints, ...]]:
    def rows(view: View) -> tuple[Constraints, ...]:
        of = (np.array([vehicle]),)
        return (Constraints(of, (np.array([lie]),), np.zeros(1), np.array([rhs])),)

    return rows


@pytest.mark.parametrize(
    ("rows", "g4", "g6"),
    [
        (one_row(0, [1.0, 0.0, 0.0], 10.0), "holds", "holds"),  # v >= 10: so it is
        (one_row(1, [-1.0, 0.0, 0.0], -20.0), "holds", "violated"),  # it could fly so slowly, and does not
        (one_row(1, [1.0, 0.0, 0.0], 1e3), "violated", "violated"),  # nobody flies that fast
        (lambda view: (), "holds", "premise not met"),
    ],
)
def test_declared_rows_are_judged_with_our_own_residual(rows: Any, g4: str, g6: str) -> None:
    run = flown("start.radius_m=150", filter=type("Own", (Declaring,), {"declares": staticmethod(rows)}))
    assert run.guarantee("qp-feasibility")["verdict"] == g4
    assert run.guarantee("rows-satisfied")["verdict"] == g6


@pytest.mark.parametrize(
    ("rows", "said"),
    [
        (3, "its declared constraints are a int, which cannot be called"),
        (lambda view: None, "constraints() is not a tuple"),
        (one_row(7, [1.0, 0.0, 0.0], 0.0), "rows over vehicles that are not 0 to 1"),
        (one_row(0, [np.nan, 0.0, 0.0], 0.0), "lie of constraints() is not finite"),
        (one_row(0, [1.0, 0.0], 0.0), "lie of constraints() has shape (1, 2), not (1, 3)"),
        (raising, "constraints() raised RuntimeError"),
    ],
)
def test_declared_rows_are_checked(rows: Any, said: str) -> None:
    declares = staticmethod(rows) if callable(rows) else rows
    assert said in ended(flown(filter=type("Own", (Declaring,), {"declares": declares})))


class Cancelled(BaseException):
    """As `asyncio.CancelledError`: no Exception."""


@pytest.mark.parametrize(
    "error", [Cancelled("no more"), GeneratorExit("no more"), BaseExceptionGroup("no more", [Cancelled()])]
)
def test_what_is_no_exception_ends_the_run_too(error: BaseException) -> None:
    def leave(*_: Any) -> Any:
        raise error

    for parts in ({"plant": plant(step=leave)}, {"filter": lambda *_: leave}, {"nominal": leave}):
        assert f"{type(error).__name__}: no more" in ended(flown(**parts))


def test_an_interrupt_passes() -> None:
    def stop(*_: Any) -> Any:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        flown(filter=lambda *_: stop)


@pytest.mark.parametrize(
    "speeds", [np.array([20.0, 20.0 + 1j]), np.ma.array([20.0, 20.0], mask=[True, False]), ["20", "20"]]
)
def test_numbers_that_are_not_real_are_refused_where_they_are_written_down(speeds: Any) -> None:
    law = lambda *_: lambda t, state: Command(speeds, np.zeros(2), np.zeros(2))  # noqa: E731
    assert "these must be real numbers" in ended(flown(nominal=law))
    with pytest.raises(TypeError, match="real numbers"):
        Command.of(speeds)


# What ended at its first step is still a run.


@pytest.mark.parametrize("part", ["plant", "filter", "nominal", "disturbance"])
@pytest.mark.parametrize("when", ["made", "called"])
def test_a_run_that_ended_at_its_first_step_is_read_reported_and_verified(
    tmp_path: Path, part: str, when: str
) -> None:
    from typer.testing import CliRunner

    from testbed.cli.main import app

    called: dict[str, Any] = {
        "plant": plant(step=raising),
        "filter": lambda *_: raising,
        "nominal": lambda *_: raising,
        "disturbance": environment(None, raising),
    }
    s = testbed.load_scenario("paper-2-turn", BRIEF)
    parts = testbed.Parts(**{part: raising if when == "made" else called[part]})
    run = testbed.run(s, tmp_path / "r", parts=parts, force=True)
    assert "the engine fell off" in ended(run)
    rows = 2 if part == "plant" and when == "called" else 0
    assert (
        len(run.vehicles) == rows
        and len(run.pairs) == rows // 2
        and {"x_m", "qp_status"} <= set(run.vehicles)
    )
    assert len(run.scorecard) == len(run.guarantees)
    exports = [["export", "--format", kind] for kind in ("csv", "acmi")]
    for command in (["report"], ["verify"], *exports, ["ledger"]):
        done = CliRunner().invoke(app, [*command, str(tmp_path / "r")])
        assert done.exception is None or isinstance(done.exception, SystemExit | UserError), done.exception
        assert "damaged" not in f"{done.output} {done.exception}", command
    page = next((tmp_path / "r").rglob("*.html")).read_text(encoding="utf-8")
    assert "the engine fell off" in page
