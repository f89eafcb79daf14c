"""O1 to O3: a filter that declares a barrier is judged by its own promise, beside what is everybody's."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import testbed
from filters.barriers.euclidean import EuclideanBarrier
from filters.barriers.pairs import PairValues
from filters.cbf.collision import CollisionFilter
from filters.constraints import Constraints
from filters.filter import Decision, Declaration
from filters.model import Array, Command, Limits, State, View
from testbed.claims import registry
from testbed.records.run import Run
from testbed.report import scorecard, tables
from testbed.verification.check import check, verify
from tests.forgery import copied, read, seal, write

NEAR = [
    "lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05", "start.radius_m=60", "duration_s=4",
    "manoeuvre_instants=0",
]  # fmt: skip
EXCUSED = ("safe-set", "barrier-condition", "zcbf-condition", "rows-satisfied")


class Distance:
    """Keeps the distance itself above Ds, with a linear alpha: its own promise, which it can break."""

    gain = 0.3

    def __init__(self, s: testbed.Scenario, barrier: Any, goal: Array) -> None:
        self.barrier: Any = EuclideanBarrier(s.d_safe_m, gamma=Command.of([16.0, 0.2, 0.0]))
        self.alpha: Any = lambda h: self.gain * h
        self.filter = CollisionFilter(self.barrier, self.alpha)

    def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
        return self.filter(view, nominal, limits)

    @property
    def declaration(self) -> Declaration:
        return Declaration(self.barrier, self.filter.constraints, self.alpha, solves_qp=True)


def flown(filter_: Any, *settings: str, out: Path | None = None) -> Run:
    s = testbed.load_scenario("paper-2-turn", [*NEAR, *settings])
    return testbed.run(s, out, parts=testbed.Parts(filter=filter_))


def distances(run: Run) -> tuple[Array, Array]:
    """h = distance - Ds at every step (T,), and the course change between, from the recorded poses alone."""
    place = run.vehicles[["x_m", "y_m", "z_m"]].to_numpy().reshape(-1, 2, 3)
    return np.linalg.norm(place[:, 0] - place[:, 1], axis=-1) - 5.0, run.pairs.t_s.to_numpy()


def test_o1_and_o2_are_the_declared_barrier_at_the_true_states() -> None:
    run = flown(Distance)
    h, t = distances(run)
    assert run.guarantee("own-safe-set").value == pytest.approx(h.min(), abs=1e-12)
    assert run.guarantee("own-safe-set").instant == t[np.argmin(h)]
    condition = np.diff(h) / 0.05 + 0.3 * h[:-1]
    assert run.guarantee("own-condition").value == pytest.approx(condition.min(), abs=1e-9)
    assert run.manifest["declared"] == ["barrier", "alpha", "constraints"]
    np.testing.assert_allclose(run.pairs.h_declared, h, atol=1e-12)


def test_what_rests_on_the_scenarios_barrier_is_measured_and_no_cross() -> None:
    run = flown(Distance)
    for claim in EXCUSED:
        said = run.guarantee(claim)
        assert (said["verdict"], said["why"]) == ("not applicable", "not this filter's claim")
        assert said.value is not None and said.margin == said.value - said.bound
    assert run.guarantee("separation")["verdict"] == "holds"
    assert run.guarantee("command-limits")["verdict"] == "holds"
    # What is everybody's is judged whatever it declares: four seconds lead nobody to the goal.
    assert run.guarantee("goal")["verdict"] == "violated"


def test_a_filter_that_says_it_is_the_papers_is_judged_by_the_papers_claims() -> None:
    class Papers(Distance):
        @property
        def declaration(self) -> Declaration:
            return replace(super().declaration, paper=True)

    run = flown(Papers)
    assert "declared" not in run.manifest and not {c.id for c in registry.OWN} & {
        v.id for v in run.guarantees
    }
    assert run.guarantee("safe-set")["verdict"] != "not applicable"


def test_each_part_of_the_promise_is_judged_only_where_it_is_declared() -> None:
    class Bare(Distance):
        @property
        def declaration(self) -> Declaration:
            return Declaration(self.barrier)

    run = flown(Bare)
    said = {c.id: run.guarantee(c.id) for c in registry.OWN}
    assert said["own-safe-set"]["verdict"] == "holds"
    assert (said["own-condition"]["verdict"], said["own-condition"]["why"]) == (
        "not applicable", "it declares no alpha",
    )  # fmt: skip
    assert said["own-rows"]["why"] == "it declares no constraints"
    assert run.pairs.alpha_declared.isna().all()


def empty_rows(view: View) -> tuple[Constraints, ...]:
    """Rows that any command satisfies."""
    one = np.zeros(1, dtype=int)
    lie = np.zeros((1, 3))
    return (Constraints((one, one + 1), (lie, lie), np.ones(1), -np.ones(1)),)


def test_rows_that_say_nothing_do_not_hold_for_a_barrier_whose_rows_are_broken() -> None:
    class Vacuous(Distance):
        def __call__(self, view: View, nominal: Command, limits: Limits) -> Decision:
            free = limits.clip(nominal)  # flies straight on
            return replace(self.filter(view, nominal, limits), command=free)

        @property
        def declaration(self) -> Declaration:
            return Declaration(self.barrier, empty_rows, self.alpha)

    run = flown(Vacuous)
    assert run.guarantee("separation")["verdict"] == run.guarantee("own-safe-set")["verdict"] == "violated"
    rows = run.guarantee("own-rows")
    assert rows["verdict"] == "premise not met" and "those of its barrier at the true state" in rows["why"]


class Wrong:
    """A barrier that fails as it is told."""

    def __init__(self, values: Callable[[State], Any]) -> None:
        self.values = values


def _raises(state: State) -> Any:
    raise LookupError("no table")


def _of(h: Any, grad: Any = None) -> Callable[[State], PairValues]:
    i, j = np.triu_indices(2, 1)
    return lambda state: PairValues(i, j, h, np.zeros((1, 8)) if grad is None else grad)


@pytest.mark.parametrize(
    ("barrier", "says"),
    [
        (3, "its declared barrier has no method values()"),
        (Wrong(_raises), "values() of its declared barrier raised LookupError: no table"),
        (Wrong(lambda state: None), "values() of its declared barrier is a NoneType, not PairValues"),
        (Wrong(_of(np.array([np.nan]))), "values() of its declared barrier.h is not finite: nan"),
        (Wrong(_of(np.ones(2))), "values() of its declared barrier.h has shape (2,), not (1,)"),
        (Wrong(_of(np.ones(1), np.zeros((1, 4)))), ".grad has shape (1, 4), not (1, 8)"),
        (Wrong(lambda state: state.x.__setitem__(0, 1.0)), "read-only"),
    ],
)
def test_a_declared_barrier_that_fails_is_a_breach_and_holds_nothing(barrier: Any, says: str) -> None:
    class Failing(Distance):
        @property
        def declaration(self) -> Declaration:
            return Declaration(barrier, alpha=self.alpha)

    run = flown(Failing)
    end = run.manifest["ended_early"]
    assert says in end and end.count("\n") == 0 and "Failing" in end
    held = {v.id for v in run.guarantees if v["verdict"] == "holds" and v.number[0] in "GO"}
    assert held == set()


@pytest.mark.parametrize(
    ("alpha", "says"),
    [
        ("linear", "its declared alpha is a str, which cannot be called"),
        (lambda h: h + 2.0, "not of class K: alpha(0) is 2"),
        (lambda h: -h, "not of class K: it does not grow with h"),
        (lambda h: np.full(2, 0.0), "its declared alpha has shape (2,), not (1,)"),
        (lambda h: h / 0.0 if h.any() else h, "its declared alpha is not finite"),
        (lambda h: 1 / 0, "its declared alpha raised ZeroDivisionError"),
    ],
)
def test_a_declared_alpha_that_is_none_is_a_breach(alpha: Any, says: str) -> None:
    class Failing(Distance):
        @property
        def declaration(self) -> Declaration:
            return Declaration(self.barrier, alpha=alpha)

    with np.errstate(all="ignore"):
        assert says in flown(Failing).manifest["ended_early"]


def test_a_run_is_verified_and_forged_promises_are_found(tmp_path: Path) -> None:
    run = flown(Distance, out=tmp_path / "run")
    assert all(f.agrees is not False for f in verify(tmp_path / "run"))
    checked = check(tmp_path / "run")
    assert "pairs.h_declared" in {u.what for u in checked.uncovered}
    decided = {f.what: f.agrees for f in checked.findings}
    assert decided["O1 own-safe-set"] and decided["O2 own-condition"] and decided["O3 own-rows"] is None
    assert run.guarantee("own-safe-set").value is not None

    fresh = (tmp_path / f"forged-{k}" for k in range(99))

    def forge(name: str, **changes: Any) -> set[str]:
        folder = copied(tmp_path / "run", next(fresh))
        entries = read(folder, "guarantees.json")
        for e in entries:
            if e["id"] == name:
                e.update(changes)
        write(folder, "guarantees.json", entries)
        seal(folder)
        return {f.what for f in verify(folder) if f.agrees is False}

    assert forge("own-safe-set", value=99.0, margin=99.0 + 1e-9) == {"O1 own-safe-set"}
    assert forge("own-condition", verdict="not applicable") == {"O2 own-condition"}
    assert forge("own-rows", verdict="holds", margin=1.0) == {"O3 own-rows"}
    assert forge("safe-set", verdict="holds", why="") == {"G2 safe-set"}
    assert forge("rows-satisfied", value=-3.0, margin=-3.0 + 1e-6) == {"G6 rows-satisfied"}
    assert forge("own-safe-set", number="O9") == {"entries", "texts"}

    def without(manifest: dict[str, Any]) -> set[str]:
        folder = copied(tmp_path / "run", next(fresh))
        write(folder, "manifest.json", manifest)
        seal(folder)
        return {f.what for f in verify(folder) if f.agrees is False}

    manifest = json.loads((tmp_path / "run" / "manifest.json").read_text())
    missed = without({k: v for k, v in manifest.items() if k != "declared"})
    assert {"entries", "columns", "G2 safe-set", "G6 rows-satisfied"} <= missed | {"G6 rows-satisfied"}
    assert "columns" in without({k: v for k, v in manifest.items() if k != "parts"})


def test_tables_show_own_promises_beside_a_run_that_has_none() -> None:
    s = testbed.load_scenario("paper-2-turn", NEAR)
    runs = {"paper": testbed.run(s), "distance": flown(Distance)}
    from rich.console import Console

    console = Console(width=100)
    with console.capture() as text:
        console.print(tables.scorecard(runs, "both"))
    assert "O1 own-safe-set" in text.get() and "not this filter's claim" in text.get()
    rows = {row["id"]: row for row in scorecard.rows(runs)}
    assert [line["run"] for line in rows["own-safe-set"]["lines"]] == ["distance"]
    assert "promises" in rows["own-safe-set"]["heading"]


def test_a_single_vehicle_has_no_pair_to_promise_about() -> None:
    s = testbed.load_scenario("paper-2-turn", ["vehicles=1", "duration_s=0.1", "manoeuvre_instants=0"])
    run = testbed.run(s, parts=testbed.Parts(filter=Distance))
    assert {run.guarantee(c.id)["verdict"] for c in registry.OWN} == {"not applicable"}


def test_a_baseline_remembers_what_the_filter_promises() -> None:
    from testbed.regression.quantities import fly, job, quantities

    s = testbed.load_scenario("paper-2-turn", NEAR)
    row = fly(job(s, "own", {}, 1, testbed.Parts(filter=Distance)))
    names = [q.name for q in quantities(s, own_filter=True)]
    assert list(row) == names and len(names) == len(quantities(s)) + 6
    assert row["own-safe-set lost"] == 0.0 and row["safe-set lost"] is None
    run = flown(Distance)
    assert row["own-condition"] == pytest.approx(run.guarantee("own-condition").value, rel=1e-5)
