"""The ladder's bookkeeping, on a scripted plant whose effects and interaction are known."""

from __future__ import annotations

import json
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from aircraft.kinematic import KinematicFleet
from filters.model import Command, State
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal, journal_beside
from testbed.components.components import Parts
from testbed.scenario.scenario import Scenario, load, parse
from testbed.studies.common.measure import default_starts, measure, override
from testbed.studies.ladder.ladder import (
    Rung,
    account,
    alone,
    climb,
    cumulative,
    markdown,
    rates,
    rungs,
    summary,
)

# Two lags a and b of a scripted vehicle that comes 10 - a - 2b - 3ab + seed close.
SCRIPTED = [
    Rung("ideal", (("wind.speed_mps", 0.0), ("wind.updraft_mps", 0.0))),
    Rung("a", (("wind.speed_mps", 0.5),), "ideal"),
    Rung("b", (("wind.updraft_mps", 0.25),), "ideal"),
]


def scripted(job: Job) -> dict[str, Any]:
    wind = json.loads(job.data)["wind"]
    a, b = wind["speed_mps"], wind["updraft_mps"]
    distance = 10 - a - 2 * b - 3 * a * b + job.seed
    return {
        "distance_m": distance,
        "distance_verdict": "holds" if distance >= 11 else "violated",
        "refused": "",
    }


@pytest.fixture
def table():  # type: ignore[no-untyped-def]
    return climb(
        default_starts(load("paper-2-turn")), SCRIPTED, range(1, 6), Journal(), workers=1, work=scripted
    )


def test_known_interacting_lags_are_accounted_for_exactly(table: Any) -> None:
    found = account(table, SCRIPTED, "distance_m")
    a, b = 0.5, 0.25
    assert found.steps[1].difference.value == pytest.approx(-a)
    assert found.steps[1].alone.value == pytest.approx(-a)
    assert found.steps[2].difference.value == pytest.approx(-2 * b - 3 * a * b)
    assert found.steps[2].alone.value == pytest.approx(-2 * b)
    assert found.total.value == pytest.approx(-a - 2 * b - 3 * a * b)
    assert found.interaction.value == pytest.approx(-3 * a * b)


class Lagging(KinematicFleet):
    """Vehicle 2 flies beside vehicle 1 and comes 10 - a - 2 b - 3 a b close: two lags that interact."""

    def __init__(self, s: Scenario) -> None:
        super().__init__(2, s.rates.fdm_dt_s)
        a, b = s.lags.v_delay_s, s.lags.omega_delay_s
        self.nearer, self.flown = a + 2 * b + 3 * a * b, False

    def step(self, command: Command, wind: Any, n: int) -> Any:
        track, self.flown = super().step(command, wind, n), True
        track[:, 1, 1] -= self.nearer
        return track

    def state(self) -> State:
        places = super().state().array()
        places[1, 1] -= self.nearer if self.flown else 0.0
        return State.of(places)


def test_a_scripted_plant_with_two_interacting_lags_is_accounted_for() -> None:
    lagging = partial(measure, parts=Parts(plant=lambda s, wind: Lagging(s)))
    beside = ", ".join(f"{{x_m=0, y_m={y}, course_deg=0, goal_x_m=300, goal_y_m={y}}}" for y in (0, 10))
    table_ = [
        "plant=lagged",
        "lags.source=table",
        "filter.kind=none",
        "start.pattern=list",
        f"places=[{beside}]",
    ]
    s = load("paper-2-turn", [*table_, "duration_s=0.1", "filter_dt_s=0.05", "record_dt_s=0.05"])
    ladder = [
        Rung("ideal", (("lags.v_delay_s", 0.0), ("lags.omega_delay_s", 0.0))),
        Rung("a", (("lags.v_delay_s", 0.5),), "ideal"),
        Rung("b", (("lags.omega_delay_s", 0.25),), "ideal"),
    ]
    found = account(climb(s, ladder, range(1, 2), Journal(), workers=1, work=lagging), ladder, "distance_m")
    assert found.steps[0].value == pytest.approx(10.0)
    assert found.steps[1].difference.value == pytest.approx(-0.5)
    assert found.steps[2].alone.value == pytest.approx(-0.5)
    assert found.steps[2].difference.value == pytest.approx(-0.5 - 0.375)
    assert found.interaction.value == pytest.approx(-0.375)


def test_differences_telescope_to_the_total(table: Any) -> None:
    found = account(table, SCRIPTED, "distance_m")
    assert sum(s.difference.value for s in found.steps[1:]) == pytest.approx(found.total.value)
    assert found.steps[-1].value - found.steps[0].value == pytest.approx(found.total.value)


def test_rates_count_what_does_not_hold(table: Any) -> None:
    found = rates(table, SCRIPTED)
    assert (found["ideal"].count, found["ideal"].runs) == (0, 5)
    assert (found["b"].count, found["b"].runs) == (2, 5)


def test_a_run_that_could_not_start_is_in_no_rate_and_no_mean(table: Any) -> None:
    lost = table.copy()
    void = (lost.rung == "b") & (lost.seed == 5)
    lost.loc[void, ["distance_m", "distance_verdict", "refused"]] = [None, None, "no steady flight"]
    lost["h_m"] = lost.distance_m
    made = summary(lost, SCRIPTED).set_index("rung")
    assert made.loc["b", ["flown", "refused", "lost"]].tolist() == [4, 1, 2]
    # seeds 1 to 4 on every rung: 10 - a - 2 b - 3 a b + 2.5
    assert made.distance_m["ideal"] == pytest.approx(12.5)
    assert made.distance_m["b"] == pytest.approx(12.5 - 0.5 - 0.5 - 0.375)
    assert made.distance_m_change["interaction"] == pytest.approx(-0.375)
    text = markdown(made.reset_index())
    assert "| b | 2 of 4 | 7 to 93 % | 1 | 11.12 |" in text and "*interaction*" in text


def test_an_interrupted_climb_resumes_where_it_stopped(tmp_path: Path) -> None:
    flown = []

    def fragile(job: Job) -> dict[str, Any]:
        if len(flown) == 7:
            raise KeyboardInterrupt
        flown.append(job)
        return scripted(job)

    def counted(job: Job) -> dict[str, Any]:
        flown.append(job)
        return scripted(job)

    s = default_starts(load("paper-2-turn"))
    with pytest.raises(KeyboardInterrupt), journal_beside(tmp_path / "l", "ladder") as book:
        climb(s, SCRIPTED, range(1, 6), book, workers=1, work=fragile)
    with journal_beside(tmp_path / "l", "ladder") as book:
        climb(s, SCRIPTED, range(1, 6), book, workers=1, work=counted)
    assert len(flown) == len(set(flown)) == 4 * 5
    assert list(tmp_path.iterdir()) == []


def test_every_rung_is_a_valid_scenario_and_only_overrides() -> None:
    s = load("paper-2-turn")
    ladder = rungs(s)
    for fields in [*cumulative(ladder).values(), *(f for pair in alone(ladder).values() for f in pair)]:
        made = parse(json.loads(override(s, fields)))
        assert made.barrier == s.barrier and made.start == s.start and made.duration_s == s.duration_s


def test_a_rung_alone_has_its_bases_and_nothing_else() -> None:
    without, with_ = alone(rungs(load("paper-2-turn")))["gusts"]
    assert with_["gusts.intensity"] == "moderate" and with_["plant"] == "jsbsim"
    assert with_["wind.speed_mps"] == 0.0
    assert {k for k in with_ if with_[k] != without[k]} == {"gusts.intensity"}


def test_starts_are_perturbed_only_where_the_scenario_does_not() -> None:
    assert default_starts(load("paper-2-turn")).start.lateral_perturbation_m == 10.0
    own = load("paper-2-turn", ["heading_perturbation_deg=2"])
    assert default_starts(own) == own
