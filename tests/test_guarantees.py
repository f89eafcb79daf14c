"""Verdicts: each made to hold and to fail by a scenario whose answer is known beforehand."""

from __future__ import annotations

import numpy as np
import pytest

from aircraft.airframe import load as load_airframe
from aircraft.kinematic import KinematicFleet
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.euclidean import EuclideanBarrier
from filters.cbf.theorem_monitor import theorem_checks
from filters.filter import MonitorRecord
from filters.model import Command, Limits, State, View
from testbed.claims.guarantees import Flown, judge
from testbed.claims.monitored import monitored
from testbed.claims.premises import premises
from testbed.components.components import Parts
from testbed.measures.extreme import Extreme
from testbed.measures.run_statistics import RunStatistics
from testbed.measures.saturation import Saturation
from testbed.records.run import Run
from testbed.records.verdict import Kind, Verdict
from testbed.scenario.scenario import Scenario, load
from testbed.simulation.simulate import run


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


def test_a_vehicle_lost_ends_the_run_and_nothing_holds() -> None:
    parts = Parts(plant=lambda s, wind: Falling(s.vehicles, s.rates.fdm_dt_s))
    result = run(load("paper-2-turn"), parts=parts)
    assert result.manifest["ended_early"] == "vehicle 2: ground at 0.500 s; run stopped"
    assert "holds" not in {g["verdict"] for g in result.guarantees if g.kind is Kind.GUARANTEE}
    assert result.guarantee("separation")["why"] == result.manifest["ended_early"]


TURN = TurnBarrier(16.0, 0.2, 5.0)
LIMITS = Limits(np.full(2, 15.0), 25.0, 0.25, 3.9)


def flown(
    statistics: RunStatistics, scenario: Scenario, started_safe: bool = True, end: str | None = None
) -> Flown:
    i, j = np.triu_indices(statistics.vehicles, 1)
    straight, alone = np.array([400.0, 300.0]), np.array([17.0, 12.5])
    return Flown(scenario, statistics, i, j, started_safe, end, straight, alone)


def judged(
    statistics: RunStatistics, *overrides: str, started_safe: bool = True, end: str | None = None
) -> dict[str, Verdict]:
    return {
        g["id"]: g for g in judge(flown(statistics, load("paper-2-turn", list(overrides)), started_safe, end))
    }


def scripted(statistics: RunStatistics, scenario: Scenario, end: str | None = None) -> dict[str, str]:
    entries = judge(flown(statistics, scenario, end=end))
    return {g["id"]: g["verdict"] for g in entries if g["id"] != "intervention"}


def good_statistics(vehicles: int = 2) -> RunStatistics:
    statistics = RunStatistics(vehicles)
    for extreme in (statistics.separation, statistics.between):
        extreme.update(0.0, np.array([5.0]))
    for extreme in (statistics.h, statistics.admissible, statistics.condition, statistics.rows):
        extreme.update(0.0, np.array([0.0]))
    statistics.command_margin.update(0.0, np.zeros(vehicles))
    statistics.goal.update(0.0, np.zeros(vehicles))
    statistics.passed = np.zeros(vehicles)
    statistics.filter_steps = statistics.solves = 1
    statistics.bends.largest = np.zeros(vehicles)  # straight paths
    return statistics


def test_exactly_at_every_bound_the_guarantees_hold() -> None:
    assert set(scripted(good_statistics(), load("paper-2-turn")).values()) == {"holds"}
    # and none of them if the run ended before its time
    ended = scripted(good_statistics(), load("paper-2-turn"), end="vehicle 1: ground")
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
        ("goal", lambda t: t.goal.value.__setitem__(0, 20.001)),
    ],
)
def test_each_guarantee_fails_alone(name: str, spoil) -> None:  # type: ignore[no-untyped-def]
    statistics = good_statistics()
    spoil(statistics)
    verdicts = scripted(statistics, load("paper-2-turn"))
    assert [k for k, v in verdicts.items() if v != "holds"] == [name]
    assert verdicts[name] == "violated"


WORDS = [
    ("separation", "G1", "every pair keeps Ds", "Theorem 1 with eq. (7)", "least distance", "m"),
    ("safe-set", "G2", "h >= 0 for ever", "Theorem 1, Corollary 1", "least h", "m"),
    ("barrier-condition", "G3", "along the motion hdot + alpha(h) >= 0", "eq. (4), Corollary 1",
     "least hdot + alpha(h) over a filter period", "m/s"),
    ("zcbf-condition", "G4a", "inside its safe set each barrier leaves an admissible input",
     "Definition 1, Theorem 2", "least sup over U of hdot + alpha(h)", "m/s"),
    ("qp-feasibility", "G4", "the QP has a solution", "Theorems 3, 4", "vehicle-steps without one", ""),
    ("command-limits", "G5", "commands stay in U", "eq. (5), actuator rows",
     "least distance inside the limits, as a share of their range", ""),
    ("rows-satisfied", "G6", "solved inputs satisfy every pair's row, limited communication included",
     "Theorem 4, K(x) in K_cap(x)", "least L_g h u + alpha(h)", "m/s"),
    ("goal", "G7", "every vehicle passes its goal within 20 m before the run ends",
     "Section V: vehicles reach their waypoints", "largest over vehicles of the closest approach", "m"),
    ("intervention", "G8", "the nominal input is altered minimally", "eq. (6)", "time overridden, worst", ""),
]  # fmt: skip
PREMISE_WORDS = [
    ("start-safe", "P1", "the start is in the safe set", "Theorem 1", "h >= 0 at t = 0", ""),
    ("shared-manoeuvre", "P2", "all barriers share one manoeuvre", "Assumption 1", "", ""),
    ("manoeuvre-in-U", "P3", "gamma lies in the input set", "Theorem 2", "distance inside U", ""),
    ("manoeuvre-flyable", "P4", "the vehicles can fly gamma for ever", "Theorem 2", "", ""),
    ("gradient", "P5", "L_g h is not zero within 0.05 of the boundary, h = 0", "Theorem 2, Proposition 1",
     "least |L_g h| where |h| <= 0.05", ""),
    ("off-the-kink", "P6", "h is differentiable where it binds", "Theorem 2, Appendix",
     "filter steps' motion to the kink, least", ""),
]  # fmt: skip
FIELDS = ("id", "number", "claim", "source", "quantity", "unit")


def test_every_claim_says_what_it_is_where_it_is_made_and_in_which_unit() -> None:
    entries = judged(good_statistics()).values()
    assert [tuple(e[k] for k in FIELDS) for e in entries] == WORDS
    rates = [e["unit"] for e in judged(good_statistics(), "barrier.form=squared").values() if e["unit"]]
    assert rates == ["m", "m^2", "m^2/s", "m^2/s", "m^2/s", "m"]
    entries = premises(flown(good_statistics(), load("paper-2-turn")), TURN, LIMITS, [])
    assert [tuple(e[k] for k in FIELDS) for e in entries] == PREMISE_WORDS


def test_every_entry_has_the_same_fields_and_nothing_in_those_it_has_no_data_for() -> None:
    empty = {"value": None, "bound": None, "margin": None, "t_s": None, "vehicles": [], "detail": {}}
    alone = judge(flown_alone())
    for entry in [*alone, *judged(RunStatistics(2)).values()]:
        assert set(entry) == {*FIELDS, *empty, "verdict", "why"}
    assert {k: alone[0][k] for k in empty} == empty


def flown_alone() -> Flown:
    none = np.zeros(0, dtype=int)
    return Flown(
        load("paper-2-turn", ["vehicles=1"]), good_statistics(1), none, none, True, None, np.full(1, 400.0)
    )


def test_one_vehicle_has_no_pair_to_judge() -> None:
    verdicts = {g["id"]: (g["verdict"], g["why"]) for g in judge(flown_alone())}
    assert verdicts["separation"] == ("not applicable", "a single vehicle has no pair")
    for name in ("safe-set", "barrier-condition", "zcbf-condition"):
        assert verdicts[name] == ("not applicable", "no pair, no barrier")
    assert verdicts["rows-satisfied"] == ("not applicable", "no rows")
    assert verdicts["command-limits"][0] == verdicts["goal"][0] == "holds"


def test_after_an_early_end_nothing_holds_and_what_is_violated_stays_so() -> None:
    end = "vehicle 2: ground at 0.500 s"
    for name, entry in judged(good_statistics(), end=end).items():
        if name != "intervention":
            assert (entry["verdict"], entry["why"]) == ("premise not met", end), name
    spoilt = good_statistics()
    spoilt.separation.update(1.0, np.array([4.0]))
    assert judged(spoilt, end=end)["separation"]["verdict"] == "violated"


def test_what_was_not_seen_is_a_premise_not_met_and_says_what() -> None:
    seen = judged(RunStatistics(2))
    for name, why in (
        ("barrier-condition", "the run had no motion"),
        ("zcbf-condition", "no pair was ever inside its safe set"),
        ("command-limits", "no command was given"),
        ("rows-satisfied", "no QP was solved"),
    ):
        assert (seen[name]["verdict"], seen[name]["why"]) == ("premise not met", why)
    outside = judged(good_statistics(), started_safe=False)["safe-set"]
    assert (outside["verdict"], outside["why"]) == ("premise not met", "the start is outside the safe set")
    assert outside["value"] == 0.0
    for name, why in (("qp-feasibility", "the filter solves no QP"), ("rows-satisfied", "no rows")):
        without = judged(good_statistics(), "filter.kind=none")[name]
        assert (without["verdict"], without["why"]) == ("not applicable", why)
    # a filter of that kind in name, whose decisions never rested on a QP
    idle = good_statistics()
    idle.filter_steps, idle.solves = 3, False
    assert judged(idle)["qp-feasibility"]["verdict"] == judged(idle)["rows-satisfied"]["verdict"]
    assert judged(idle)["qp-feasibility"]["verdict"] == "not applicable"


def test_a_pairs_entry_names_the_worst_pair_its_time_and_how_far_it_is_from_the_bound() -> None:
    statistics = good_statistics(3)
    for extreme in (
        statistics.separation,
        statistics.h,
        statistics.condition,
        statistics.admissible,
        statistics.rows,
    ):
        extreme.value[:] = 9.0
        extreme.update(2.5, np.array([8.0, 8.0, 7.5]))
    statistics.between.value[:] = 7.25
    i, j = np.triu_indices(3, 1)
    made = judge(
        Flown(
            load("paper-2-turn", ["vehicles=3", "d_safe_m=6"]),
            statistics,
            i,
            j,
            True,
            None,
            np.full(3, 400.0),
        )
    )
    found = {g["id"]: g for g in made}
    for name, bound in (("separation", 6.0), ("safe-set", -1e-9), ("barrier-condition", -1e-3),
                        ("zcbf-condition", -1e-9), ("rows-satisfied", -1e-6)):  # fmt: skip
        assert (found[name]["value"], found[name]["bound"], found[name]["margin"]) == (
            7.5,
            bound,
            7.5 - bound,
        )
        assert (found[name]["t_s"], found[name]["vehicles"]) == (2.5, [2, 3])
    assert found["separation"]["detail"] == {"between_steps_m": 7.25, "possible_m": 7.25}


@pytest.mark.parametrize(
    ("sampled", "chord", "bend", "status", "value", "why"),
    [
        (5.2, 5.1, 0.1, "holds", 5.2, ""),  # at least 5.05
        (5.2, 5.1, 0.2, "holds", 5.2, ""),  # at least 5
        (5.3, 5.25, 0.8, "open", 5.3, "as near as 4.85 m: sample finer, fdm_dt_s <= 0.0017 would do"),
        (5.2, 5.101, 0.8, "open", 5.2, "as near as 4.701 m: sample finer, for example fdm_dt_s = 0.0012"),
        (5.2, 4.9, 0.8, "open", 5.2, "as near as 4.5 m: sample finer, for example fdm_dt_s = 0.0012"),
        (5.2, 4.9, 0.1, "violated", 4.95, ""),  # at most 4.95, between samples
        (4.8, 4.7, 0.8, "violated", 4.8, ""),
        (5.2, 5.1, np.inf, "open", 5.2, "may be anywhere: sample finer, for example fdm_dt_s = 0.0012"),
    ],
)
def test_separation_holds_only_where_paths_cannot_come_nearer_between_samples(
    sampled: float, chord: float, bend: float, status: str, value: float, why: str
) -> None:
    statistics = good_statistics()
    statistics.separation.value[:], statistics.between.value[:] = sampled, chord
    statistics.separation.t[:], statistics.between.t[:] = 1.0, 2.0
    statistics.bends.largest = np.full(2, bend)
    found = judged(statistics)["separation"]
    assert (found["verdict"], found["value"]) == (status, pytest.approx(value))
    assert why in found["why"] and bool(why) == bool(found["why"])
    assert found["margin"] == pytest.approx(found["value"] - 5.0)
    assert found["t_s"] == (2.0 if value == 4.95 else 1.0)
    ended = judged(statistics, end="vehicle 1: ground")["separation"]
    assert ended["verdict"] == ("violated" if status == "violated" else "premise not met")


def two_arcs(gap: float, plant: str) -> Run:
    """Two vehicles whose paths bend towards each other between two samples, and nowhere else come so near."""
    rate, speed = 0.2268, 25.0
    angle = 1.5 * rate
    y = gap + 2 * speed / rate * (1 - np.cos(angle))
    course = np.degrees(angle)
    places = ", ".join(
        f"{{x_m=0, y_m={y_m}, course_deg={towards}, goal_x_m=400, goal_y_m={y_m}}}"
        for y_m, towards in ((0.0, course), (y, -course))
    )
    overrides = ['start.pattern="list"', f"start.places=[{places}]", 'filter.kind="none"', "fdm_dt_s=1"]
    overrides += ["filter_dt_s=1", "record_dt_s=1", "duration_s=3", "manoeuvre_instants=0"]

    class Arcs:
        def __call__(self, t: float, view: View) -> Command:
            return Command([speed, speed], [-rate, rate], 0.0)

    def plain(scenario: Scenario, wind: np.ndarray) -> KinematicFleet:
        return KinematicFleet(scenario.vehicles, scenario.rates.fdm_dt_s)

    own = {"plant": plain} if plant == "own" else {}
    return run(load("paper-2-turn", overrides), force=True, parts=Parts(nominal=lambda *_: Arcs(), **own))


@pytest.mark.parametrize(
    ("gap", "plant", "status"),
    [(4.0, "", "violated"), (5.0 + 1e-6, "", "holds"), (5.0 - 1e-6, "", "violated"), (4.0, "own", "open")],
)
def test_two_arcs_that_meet_between_samples_are_judged_by_where_they_meet(
    gap: float, plant: str, status: str
) -> None:
    found = two_arcs(gap, plant).guarantee("separation")
    assert found["verdict"] == status
    if status == "violated":
        assert found["value"] == pytest.approx(gap, abs=1e-8) and found["t_s"] == pytest.approx(1.5, abs=1e-3)
    assert (found["value"] < 5.0) == (status == "violated")


def test_qps_without_a_solution_are_counted_by_status_and_the_first_is_named() -> None:
    none = judged(good_statistics())["qp-feasibility"]
    assert (none["value"], none["bound"], none["margin"], none["detail"]) == (0, 0, 0, {"in_safe_set": 0})
    statistics = good_statistics()
    statistics.qp_failures, statistics.failures_inside = {"iteration_limit": 1, "infeasible": 2}, 2
    statistics.first_failure = (4.25, 1, "infeasible")
    found = judged(statistics)["qp-feasibility"]
    assert (found["value"], found["bound"], found["margin"]) == (3, 0, -3)
    assert list(found["detail"].items()) == [("infeasible", 2), ("iteration_limit", 1), ("in_safe_set", 2)]
    assert (found["t_s"], found["vehicles"]) == (4.25, [2])
    assert found["why"] == "first infeasible; 2 of them inside the safe set"


def test_command_limits_report_the_worst_vehicle_and_the_rates_achieved_by_any() -> None:
    statistics = good_statistics()
    statistics.command_margin.update(3.5, np.array([0.1, -0.2]))
    statistics.lowest = np.array([[16.0, -0.2, -1.0], [17.0, -0.1, -2.0]])
    statistics.highest = np.array([[24.0, 0.1, 1.0], [23.0, 0.2, 0.5]])
    found = judged(statistics)["command-limits"]
    assert (found["value"], found["bound"], found["margin"]) == (-0.2, 0.0, -0.2)
    assert (found["t_s"], found["vehicles"]) == (3.5, [2])
    assert found["detail"] == {
        "achieved_v_mps": [16.0, 24.0],
        "achieved_omega_radps": [-0.2, 0.2],
        "achieved_zeta_mps": [-2.0, 1.0],
    }


def test_surfaces_at_their_stops_are_reported_if_the_aircraft_has_any() -> None:
    statistics = good_statistics()
    assert "share_at_stop" not in judged(statistics)["command-limits"]["detail"]
    statistics.saturation = Saturation([load_airframe("x8")] * 2)
    statistics.saturation.update({"throttle": np.array([1.0, 0.5])})
    statistics.saturation.update({"throttle": np.array([0.5, 0.5])})
    assert judged(statistics)["command-limits"]["detail"]["share_at_stop"]["throttle"] == 0.5


def test_the_goal_is_that_of_the_vehicle_which_comes_least_near() -> None:
    statistics = good_statistics()
    statistics.goal = Extreme(np.array([3.0, 12.0]), np.array([18.0, 19.5]))
    statistics.passed = np.array([17.5, 19.0])
    near = judged(statistics)["goal"]
    assert (near["value"], near["bound"], near["margin"]) == (12.0, 20.0, 8.0)
    assert (near["t_s"], near["vehicles"]) == (19.5, [2])
    assert (near["verdict"], near["why"], near["detail"]) == ("holds", "", {"last_passed_s": 19.0})
    statistics.goal.value[1], statistics.passed[1] = 21.0, np.nan
    far = judged(statistics)["goal"]
    assert (far["verdict"], far["why"], far["detail"]) == ("violated", "1 of 2 not within it by the end", {})


def test_the_intervention_is_the_worst_vehicles_share_of_time_and_what_was_altered_in_all() -> None:
    statistics = good_statistics()
    statistics.filter_steps, statistics.override_steps = 40, np.array([10, 30])
    statistics.altered = np.array([[1.0, 0.25, 3.0], [0.5, 0.5, 2.0]])
    # 400 and 300 m to the goals, 20 m before which the way ends
    statistics.path, statistics.passed = np.array([385.0, 290.0]), np.array([18.0, np.nan])
    found = judged(statistics)["intervention"]
    assert (found["verdict"], found["why"]) == ("not applicable", "reported, not judged")
    assert (found["value"], found["vehicles"]) == (0.75, [2])
    assert found["detail"] == {
        "altered_v_m": 1.5,
        "altered_omega_rad": 0.75,
        "altered_zeta_m": 5.0,
        "path_added_m": [5.0, None],
        "time_added_s": [1.0, None],
    }
    unknown = judge(
        Flown(load("paper-2-turn"), statistics, *np.triu_indices(2, 1), True, None, np.full(2, 400.0))
    )
    assert unknown[-1]["detail"]["time_added_s"] == [None, None]
    assert judged(good_statistics())["intervention"]["value"] == 0.0
    once = good_statistics()
    once.filter_steps, once.override_steps = 1, np.array([1, 0])
    assert judged(once)["intervention"]["value"] == 1.0


def test_a_monitors_failed_premise_voids_and_its_failed_conclusion_violates() -> None:
    record = MonitorRecord(checks=theorem_checks())
    see = record.checks
    two = np.array([0, 1]), np.array([2, 2])
    see["solvable"].see(10, np.array([0.0]))
    see["limited_is_safe"].see(10, np.array([0.5, 0.25]), *two)
    for name in ("aligned", "aligned_limited", "gradient"):
        see[name].see(20, np.array([0.5, -0.25]), *two)
    found = {
        e["id"]: e for e in monitored(record, load("paper-2-turn", ["filter_dt_s=0.05", "record_dt_s=0.05"]))
    }
    assert len(found) == 9 and {e["number"] for e in found.values()} == {"M"}
    assert {e["source"] for e in found.values()} == {"Theorems 3 and 4"}
    assert {e["quantity"] for e in found.values()} == {"smallest seen"}
    held = found["monitor-limited_is_safe"]
    assert held["claim"] == "limited-communication inputs satisfy the centralised rows"
    assert (held["unit"], held["verdict"], held["why"]) == ("m/s", "holds", "")
    assert (held["value"], held["bound"], held["margin"]) == (0.25, -1e-6, 0.25 + 1e-6)
    assert (held["t_s"], held["vehicles"]) == (0.5, [2, 3])
    unsolved = found["monitor-solvable"]
    assert (unsolved["verdict"], unsolved["why"]) == ("violated", "1 of 1 fail")
    assert (unsolved["t_s"], unsolved["vehicles"]) == (0.5, [])
    for name in ("aligned", "aligned_limited", "gradient"):
        premise = found[f"monitor-{name}"]
        assert (premise["verdict"], premise["why"]) == ("premise not met", "1 of 2 fail")
        assert (premise["t_s"], premise["vehicles"]) == (1.0, [2, 3])
    never = found["monitor-cheaper"]
    assert (never["verdict"], never["why"], never["value"]) == ("not applicable", "never met", None)


def premise(
    statistics: RunStatistics,
    name: str,
    *overrides: str,
    barrier=TURN,
    limits=LIMITS,
    unflyable=(),
    safe=True,
):  # type: ignore[no-untyped-def]
    made = flown(statistics, load("paper-2-turn", list(overrides)), safe)
    return next(e for e in premises(made, barrier, limits, list(unflyable)) if e["id"] == name)


def test_each_premise_says_why_it_fails_and_nothing_when_it_holds() -> None:
    statistics = good_statistics()
    statistics.gradient.update(1.5, np.array([0.5]))
    statistics.kink.update(2.5, np.array([1.0]))
    made = premises(flown(statistics, load("paper-2-turn")), TURN, LIMITS, [])
    assert {(e["verdict"], e["why"]) for e in made} == {("holds", "")}
    for name, why, spoilt in (
        ("start-safe", "h < 0 at the start", {"safe": False}),
        ("manoeuvre-in-U", "gamma exceeds the limits", {"barrier": TurnBarrier(14.0, 0.2, 5.0)}),
        ("manoeuvre-in-U", "there is no one manoeuvre", {"barrier": EuclideanBarrier(5.0)}),
        ("manoeuvre-flyable", "too slow; too steep", {"unflyable": ["too slow", "too steep"]}),
    ):
        found = premise(statistics, name, **spoilt)
        assert (found["verdict"], found["why"]) == ("premise not met", why)
    separate = load("paper-counterexample")
    three = Limits(np.full(3, 15.0), 25.0, 0.25, 3.9)
    made = {e["id"]: e for e in premises(flown(good_statistics(3), separate), TURN, three, [])}
    for name, why in (("shared-manoeuvre", "each pair has its own"),
                      ("manoeuvre-flyable", "there is no one manoeuvre")):  # fmt: skip
        assert (made[name]["verdict"], made[name]["why"]) == ("premise not met", why)


def test_the_manoeuvre_is_as_far_inside_the_limits_as_its_worst_entry_of_its_worst_vehicle() -> None:
    # Of vehicle 2, 0.2 of +-0.25 rad/s: 0.05 of a range of 0.5. No climb is asked of either.
    sigma = TurnBarrier(16.0, 0.2, 5.0, sigma=[1.25, 1.3])
    limits = Limits([15.0, 15.0], [25.0, 25.0], [0.3, 0.25], 3.9)
    found = premise(good_statistics(), "manoeuvre-in-U", barrier=sigma, limits=limits)
    assert found["value"] == found["margin"] == pytest.approx(0.1) and found["bound"] == 0.0
    assert (found["verdict"], found["vehicles"]) == ("holds", [2])
    # vehicles that cannot climb, and gamma asks for no climb: on the edge is inside
    flat = Limits([15.0, 15.0], [25.0, 25.0], 0.25, 0.0)
    assert premise(good_statistics(), "manoeuvre-in-U", limits=flat)["value"] == 0.0
    assert premise(good_statistics(), "manoeuvre-in-U", limits=flat)["verdict"] == "holds"
    euclidean = EuclideanBarrier(5.0, gamma=Command(15.0, 0.0, 1.0))
    found = premise(good_statistics(), "manoeuvre-in-U", barrier=euclidean, limits=flat)
    # 1 m/s of climb where none is allowed counts as it is, for there is no range to divide by
    assert (found["value"], found["verdict"]) == (-1.0, "premise not met")


def test_a_gradient_that_is_nearly_zero_at_the_boundary_voids_and_one_never_seen_does_not_apply() -> None:
    unseen = premise(good_statistics(), "gradient")
    assert (unseen["verdict"], unseen["why"]) == ("not applicable", "no pair came to the boundary")
    for value, verdict_ in ((1e-10, "premise not met"), (1e-9, "premise not met"), (1e-8, "holds")):
        statistics = good_statistics()
        statistics.gradient.update(1.5, np.array([value]))
        found = premise(statistics, "gradient")
        assert (found["verdict"], found["value"], found["bound"]) == (verdict_, value, 1e-9)
        assert (found["t_s"], found["vehicles"]) == (1.5, [1, 2])


def test_the_kink_is_one_filter_step_away_at_least_or_the_premise_fails() -> None:
    smooth = TurnBarrier(16.0, 0.2, 5.0, smoothing=0.5)
    statistics = good_statistics()
    for none in (premise(statistics, "off-the-kink", barrier=EuclideanBarrier(5.0)),
                 premise(statistics, "off-the-kink", "filter.kind=none")):  # fmt: skip
        assert (none["verdict"], none["why"]) == ("not applicable", "no kink, or nothing binds")
    found = premise(statistics, "off-the-kink", barrier=smooth)
    assert (found["verdict"], found["why"]) == ("holds", "smoothed")
    unbound = premise(statistics, "off-the-kink")
    assert (unbound["verdict"], unbound["why"]) == ("not applicable", "no row ever bound")
    for value, verdict_, why in (
        (1.0, "holds", ""),
        (0.99, "premise not met", "one filter step can cross it"),
    ):
        statistics = good_statistics()
        statistics.kink.update(2.5, np.array([value]))
        found = premise(statistics, "off-the-kink")
        assert (found["verdict"], found["why"], found["bound"]) == (verdict_, why, 1.0)


def test_nothing_seen_is_never_a_pass() -> None:
    assert "holds" not in scripted(RunStatistics(2), load("paper-2-turn")).values()


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
    statistics = RunStatistics(2)
    state = State([0.0, 3.0], [0.0, 4.0], 0.0, 0.0)
    statistics.start(state.position, np.zeros((2, 3)), 4.0)
    assert statistics.separation.worst() == (0, 5.0, 0.0)
    assert statistics.passed.tolist()[0] == 0.0 and np.isnan(statistics.passed[1])
