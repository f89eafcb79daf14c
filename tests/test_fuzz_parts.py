"""Compositions of parts that lie: none ends in our traceback, none is believed against the true motion."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import testbed
from filters.model import State
from testbed.components import catalogue
from testbed.records.checksums import plain
from testbed.records.run import Run
from testbed.records.verdict import Kind, Status
from testbed.scenario.scenario import Scenario
from tests.fuzzing import cases, no_hang
from tests.fuzzing.parts import (
    ENVIRONMENT_LIES,
    FILTER_LIES,
    GUIDANCE_LIES,
    PLANT_LIES,
    Honest,
    Lie,
    LyingEnvironment,
    LyingFilter,
    LyingGuidance,
    LyingPlant,
)

BRIEF = [
    "duration_s=0.8", "fdm_dt_s=0.02", "filter_dt_s=0.04", "record_dt_s=0.08", "manoeuvre_instants=0"
]  # fmt: skip
BESIDE = [
    'start.pattern="list"',
    "start.places=[{x_m=0,y_m=0,course_deg=10,goal_x_m=400,goal_y_m=0},"
    "{x_m=0,y_m=12,course_deg=-10,goal_x_m=400,goal_y_m=-12}]",
]
SCENARIOS = {
    "head-on": ["start.radius_m=16"],
    "beside": BESIDE,
    "three": ["vehicles=3", "start.radius_m=30", "filter.kind=limited"],
    "monitored": ["start.radius_m=30", "filter.monitor=true"],
    "far": ["start.radius_m=200", "filter.kind=none"],
    "alone": ["vehicles=1"],
    "branches": ["start.radius_m=40", "duration_s=0.16", "manoeuvre_instants=1", "barrier.omega_degps=120",
                 "limits.omega_max_degps=130"],
}  # fmt: skip
PARTS: dict[str, tuple[str, tuple[str, ...], Callable[..., Any]]] = {
    "plant": ("plant", PLANT_LIES, LyingPlant),
    "filter": ("filter", FILTER_LIES, LyingFilter),
    "guidance": ("nominal", GUIDANCE_LIES, LyingGuidance),
    "environment": ("disturbance", ENVIRONMENT_LIES, LyingEnvironment),
}
G1_TO_G6 = ("separation", "safe-set", "barrier-condition", "zcbf-condition", "qp-feasibility",
            "command-limits", "rows-satisfied")  # fmt: skip


@pytest.fixture(scope="module")
def scenarios() -> dict[str, Scenario]:
    return {n: testbed.load_scenario("paper-2-turn", [*BRIEF, *more]) for n, more in SCENARIOS.items()}


@st.composite
def compositions(draw: st.DrawFn) -> tuple[str, dict[str, Lie]]:
    """A scenario, and one or two parts that are a user's, one of which lies or both."""
    lies = {}
    for part in draw(st.lists(st.sampled_from(sorted(PARTS)), min_size=1, max_size=2, unique=True)):
        what = draw(st.sampled_from(PARTS[part][1]))
        numbers = draw(st.tuples(st.integers(0, 19), st.integers(0, 59), st.integers(0, 59)))
        lies[part] = Lie(what, *numbers)
    return draw(st.sampled_from(sorted(SCENARIOS))), lies


def composed(lies: dict[str, Lie], plants: list[Honest]) -> testbed.Parts:
    """The parts; every plant made is kept in `plants`."""
    makers: dict[str, Any] = {}

    def maker(part: str, lie: Lie) -> Callable[..., Any]:
        def make(*given: Any) -> Any:
            if lie.what == "made":
                return lie.junk()
            made = PARTS[part][2](*given, lie)
            if isinstance(made, Honest):
                plants.append(made)
            return made

        return make

    def honest(s: Scenario, wind: np.ndarray) -> Honest:
        plants.append(Honest(s, wind))
        return plants[-1]

    makers["plant"] = honest
    for part, lie in lies.items():
        makers[PARTS[part][0]] = maker(part, lie)
    return testbed.Parts(**makers)


def contradictions(run: Run, s: Scenario, plant: Honest, lies: dict[str, Lie]) -> list[str]:
    """Guarantees that hold against the plant's own record of its motion."""
    barrier, alpha = catalogue.barrier(s), catalogue.alpha(s)
    i, j = np.triu_indices(s.vehicles, 1)
    said = {g.id for g in run.guarantees if g.status is Status.HOLDS and g.kind is Kind.GUARANTEE}
    wrong = []

    def against(name: str, value: Any, least: float) -> None:
        if name in said and not np.min(value, initial=np.inf) >= least:
            wrong.append(f"{name} holds, truly {np.min(value)}")

    limits = catalogue.limits(s)
    low, high = limits.corners
    commands = np.array(plant.commands).reshape(-1, s.vehicles, 3)
    against("command-limits", np.minimum(commands - low, high - commands), -1e-12)
    if not i.size:
        return wrong
    states = np.array(plant.states)
    passed = np.concatenate([states[:1, :, [0, 1, 3]], *plant.tracks])
    apart = np.linalg.norm(passed[:, i] - passed[:, j], axis=-1)
    against("separation", apart, s.d_safe_m)
    # Wind splits a filter period only beyond 0.05 s, so there is a state at every filter step.
    values = [barrier.values(State.of(x)) for x in states]
    h = np.array([v.h for v in values])
    against("safe-set", h, -1e-8)
    against("barrier-condition", np.diff(h, axis=0) / s.rates.filter_dt_s + alpha(h[:-1]), -1.1e-3)
    best, left = alpha(h), []
    for k, (x, v) in enumerate(zip(states, values, strict=True)):
        sides = v.lie(State.of(x))
        for side, vehicle in zip(sides, (i, j), strict=True):
            best[k] += np.maximum(side * low[vehicle], side * high[vehicle]).sum(axis=-1)
        if k < len(commands):
            u = commands[k]
            left.append((sides[0] * u[i]).sum(axis=-1) + (sides[1] * u[j]).sum(axis=-1) + alpha(h[k]))
    against("zcbf-condition", np.where(h < 0, np.inf, best), -1e-6)
    # A view that is not the truth has rows of its own; rows of QPs without a solution are G4's.
    if "environment" not in lies or lies["environment"].what != "offset":
        against("qp-feasibility", np.array(left), -1e-5)
        if "filter" in lies or "qp-feasibility" in said:
            against("rows-satisfied", np.array(left), -1e-5)
    return wrong


@cases(2000)
@given(compositions())
def test_no_lie_is_believed_and_none_ends_in_a_traceback(
    scenarios: dict[str, Scenario], composition: tuple[str, dict[str, Lie]]
) -> None:
    name, lies = composition
    s, plants = scenarios[name].model_copy(deep=True), []  # type: ignore[var-annotated]
    with no_hang():
        run = testbed.run(s, parts=composed(lies, plants), force=True)
    assert s == scenarios[name], "a part changed the scenario"
    json.dumps(plain(run.guarantees), allow_nan=False), json.dumps(plain(run.manifest), allow_nan=False)
    assert {"x_m", "qp_status"} <= set(run.vehicles) and "h_m" in run.pairs and len(run.scorecard)
    end = run.manifest["ended_early"]
    if end is not None:
        assert end.endswith("s; run stopped") and end.isprintable() and len(end) < 1000, end
        assert not {g.id for g in run.guarantees if g.id in G1_TO_G6 and g.status is Status.HOLDS}
    else:
        assert len(plants) and not contradictions(run, s, plants[0], lies)
