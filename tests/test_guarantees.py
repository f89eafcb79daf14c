"""Verdicts: each made to hold and to fail by a scenario whose answer is known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from aircraft.kinematic import KinematicFleet
from filters.unicycle import State
from testbed import catalogue
from testbed.guarantees import Flown, judge
from testbed.scenario import Scenario, load
from testbed.simulate import run
from testbed.tally import Extreme, Tally


def verdict(overrides: list[str], name: str, force: bool = False) -> str:
    return str(run(load("paper-2-turn", overrides), force=force).guarantee(name)["verdict"])


def test_without_a_filter_head_on_vehicles_collide() -> None:
    result = run(load("paper-2-turn", ["filter.kind=none"]))
    separation = result.guarantee("separation")
    assert separation["verdict"] == "violated"
    # v = u_hat falls as the goal nears; they meet head-on in the middle
    assert separation["value"] == pytest.approx(0.0, abs=0.2)
    assert result.guarantee("safe-set")["verdict"] == "violated"
    assert result.guarantee("qp-feasibility")["verdict"] == "not applicable"


def test_a_start_outside_the_safe_set_voids_the_premise_of_invariance() -> None:
    result = run(load("paper-2-straight", ["course_offset_deg=0", "duration_s=1"]), force=True)
    assert result.guarantee("safe-set")["verdict"] == "premise not met"


def test_the_goal_verdict_follows_the_radius() -> None:
    # 17.4 m is the worst goal distance at 20 s
    flown = [run(load("paper-2-turn", [f"goal_radius_m={r}"])) for r in (18, 17)]
    near, far = (result.guarantee("goal") for result in flown)
    assert (near["verdict"], far["verdict"]) == ("holds", "violated")
    # at 15 m/s, the least speed, 0.6 m before the end are 0.04 s
    assert near["detail"]["last_passed_s"] == pytest.approx(19.96, abs=0.01) and near["why"] == ""
    assert "last_passed_s" not in far["detail"] and far["why"] == "2 of 2 not within it by the end"
    # Of vehicles still on their way nobody knows what the way costs.
    added = [result.guarantee("intervention")["detail"]["path_added_m"] for result in flown]
    assert None not in added[0] and added[1] == [None, None]


class Falling(KinematicFleet):
    """Vehicle 2 hits the ground after 0.5 s."""

    steps = 0

    def step(self, command, wind, n):  # type: ignore[no-untyped-def]
        self.steps += n
        return super().step(command, wind, n)

    def faults(self) -> list[str]:
        return ["", "ground" if self.steps * self.dt >= 0.5 else ""]


def test_a_vehicle_lost_ends_the_run_and_nothing_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(catalogue.PLANTS, "unicycle", lambda s, wind: Falling(s.vehicles, s.rates.fdm_dt_s))
    result = run(load("paper-2-turn"))
    assert result.manifest["ended_early"] == "vehicle 2: ground by 0.500 s, the run ended there"
    assert "holds" not in {g["verdict"] for g in result.guarantees if g["number"].startswith("G")}
    assert result.guarantee("separation")["why"] == result.manifest["ended_early"]


def scripted(tally: Tally, scenario: Scenario, end: str | None = None) -> dict[str, str]:
    i, j = np.triu_indices(2, 1)
    flown = Flown(scenario, tally, i, j, True, end, np.full(2, 400.0))
    return {g["id"]: g["verdict"] for g in judge(flown) if g["id"] != "intervention"}


def good_tally() -> Tally:
    tally = Tally(2)
    for extreme in (tally.separation, tally.between):
        extreme.update(0.0, np.array([5.0]))
    for extreme in (tally.h, tally.admissible, tally.condition, tally.rows):
        extreme.update(0.0, np.array([0.0]))
    tally.command_margin.update(0.0, np.zeros(2))
    tally.goal.update(0.0, np.zeros(2))
    tally.passed = np.zeros(2)
    tally.filter_steps = tally.solves = 1
    return tally


def test_exactly_at_every_bound_the_guarantees_hold() -> None:
    assert set(scripted(good_tally(), load("paper-2-turn")).values()) == {"holds"}
    # and none of them if the run ended before its time
    ended = scripted(good_tally(), load("paper-2-turn"), end="vehicle 1: ground")
    assert set(ended.values()) == {"premise not met"}


@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("separation", lambda t: t.separation.update(1.0, np.array([4.999]))),
        ("separation", lambda t: t.between.update(1.0, np.array([4.999]))),
        ("barrier-condition", lambda t: t.condition.update(1.0, np.array([-1e-2]))),
        ("rows-satisfied", lambda t: t.rows.update(1.0, np.array([-1e-5]))),
        ("safe-set", lambda t: t.h.update(1.0, np.array([-1e-6]))),
        ("zcbf-condition", lambda t: t.admissible.update(1.0, np.array([-1e-6]))),
        ("qp-feasibility", lambda t: t.qp_failures.update(infeasible=1)),
        ("command-limits", lambda t: t.command_margin.update(1.0, np.array([0.0, -1e-9]))),
    ],
)
def test_each_guarantee_fails_alone(name: str, spoil) -> None:  # type: ignore[no-untyped-def]
    tally = good_tally()
    spoil(tally)
    verdicts = scripted(tally, load("paper-2-turn"))
    assert [k for k, v in verdicts.items() if v != "holds"] == [name]
    assert verdicts[name] == "violated"


def test_nothing_seen_is_never_a_pass() -> None:
    assert "holds" not in scripted(Tally(2), load("paper-2-turn")).values()


def test_an_extreme_remembers_the_first_instant_of_its_minimum() -> None:
    extreme = Extreme.of(2)
    extreme.update(np.array([0.0, 0.1, 0.2]), np.array([[3.0, 9.0], [1.0, 8.0], [1.0, 7.0]]))
    extreme.update(0.3, np.array([1.0, 6.5]))
    assert extreme.t.tolist() == [0.1, 0.3]
    assert extreme.worst() == (0, 1.0, 0.1)


def test_separation_is_tracked_between_filter_steps() -> None:
    """Two unicycles pass each other inside one filter period; only FDM steps can see it."""
    overrides = [
        "filter.kind=none",
        "radius_m=5",
        "filter_dt_s=0.5",
        "record_dt_s=0.5",
        "duration_s=1",
        "d_safe_m=1",
    ]
    result = run(load("paper-2-turn", overrides), force=True)
    assert result.pairs.distance_m.min() > 4
    assert result.guarantee("separation")["value"] < 0.2


def test_state_is_never_nan_in_tally() -> None:
    tally = Tally(2)
    state = State([0.0, 3.0], [0.0, 4.0], 0.0, 0.0)
    tally.start(np.stack([state.x, state.y, state.z], axis=-1), np.zeros((2, 3)), 4.0)
    assert tally.separation.worst() == (0, 5.0, 0.0)
    assert tally.passed.tolist()[0] == 0.0 and np.isnan(tally.passed[1])
