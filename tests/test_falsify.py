"""The search for violations: departures, the order of flights, the shrinking, and the file that shows it."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filters.model import Array
from testbed.campaigns.job import Job
from testbed.campaigns.outcome import Outcome
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.studies.common.measure import override
from testbed.studies.falsify import falsify as study
from testbed.studies.falsify.flights import Flights, fly
from testbed.studies.falsify.shrink import ddmin, scale, shrink
from testbed.studies.falsify.space import Bounds, Space, bounds

ALL = Bounds(10.0, 5.0, 1.0, 5.0, 0.1)
STARTS_ONLY = Bounds(10.0, 5.0, 1.0, 0.0, 0.0)


def space(b: Bounds = ALL, *overrides: str) -> Space:
    return Space.of(load("paper-2-turn", list(overrides)), b)


# Departures


def test_no_departure_is_the_scenario_itself() -> None:
    s = load("paper-2-turn", ["wind.speed_mps=3", "latency_s=0.2", "heading_offsets_deg=[1.0, 0.0]"])
    made = Space.of(s, ALL)
    assert made.at(np.zeros(made.size)) == s
    assert made.size == 2 * 3 + 2 + 1


def test_a_departure_says_what_it_does_and_the_scenario_does_it() -> None:
    made = space()
    x = np.zeros(made.size)
    x[made.coordinates(["lateral_m"], [1])] = 0.5
    x[made.coordinates(["heading_deg"], [2])] = -1.0
    x[made.coordinates(["latency_s"])] = 0.3
    s = made.at(x)
    assert s.start.lateral_offsets_m == [5.0, 0.0] and s.start.heading_offsets_deg == [0.0, -5.0]
    assert s.start.height_offsets_m == [] and s.network.latency_s == 0.03
    assert [(r["kind"], r.get("vehicle"), r["value"], r["unit"]) for r in made.values(x)] == [
        ("lateral", 1, 5.0, "m"),
        ("heading", 2, -5.0, "deg"),
        ("latency", None, 0.03, "s"),
    ]


def test_wind_adds_to_the_scenarios_own_as_a_vector_and_stays_in_its_disc() -> None:
    made = space(ALL, "wind.speed_mps=4", "towards_deg=90")
    x = np.zeros(made.size)
    x[made.coordinates(["wind_mps"])] = [0.6, 0.0]
    wind = made.at(x).wind
    assert (wind.speed_mps, wind.towards_deg) == (pytest.approx(5.0), pytest.approx(53.130102354))
    x[made.coordinates(["wind_mps"])] = [1.0, 1.0]
    assert made.values(x)[0]["value"] == pytest.approx(5.0)


def test_perturbations_of_the_scenario_are_searched_not_drawn() -> None:
    s = load("paper-2-turn", ["heading_perturbation_deg=3", "seed=5"])
    b = bounds(s, None, None, None, 0.0, 0.0)
    assert b == Bounds(0.0, 3.0, 0.0, 0.0, 0.0)
    made = Space.of(s, b)
    assert made.size == 2 and made.scenario.start.heading_perturbation_deg == 0.0
    plain = load("paper-2-turn")
    assert bounds(plain, None, 2.0, None, 1.0, 0.0) == Bounds(10.0, 2.0, 1.0, 1.0, 0.0)
    exact, _ = places(plain, generators(1)["start"])
    assert np.array_equal(places(made.at(np.zeros(2)), generators(5)["start"])[0].array(), exact.array())


@pytest.mark.parametrize(("name", "value"), [("heading", 200.0), ("wind", -1.0), ("latency", float("nan"))])
def test_a_bound_that_no_scenario_can_meet_is_refused(name: str, value: float) -> None:
    given = {"lateral": None, "heading": None, "height": None, "wind": 0.0, "latency": 0.0} | {name: value}
    with pytest.raises(UserError, match=f"--{name}"):
        bounds(load("paper-2-turn"), *given.values())


def test_rounding_is_of_departures_in_their_units() -> None:
    made = space()
    x = np.full(made.size, 1 / 3)
    assert made.at(made.rounded(x, 2)).start.lateral_offsets_m == [3.3, 3.3]
    assert made.at(made.rounded(x, 1)).start.heading_offsets_deg == [2.0, 2.0]
    assert made.at(made.rounded(x, 3)).network.latency_s == 0.0333


def test_points_of_the_search_lie_in_the_bounds_and_spread_over_them() -> None:
    made = space()
    points = np.array(study.hypercube(made, np.arange(made.size), 40, np.random.default_rng(0)))
    assert (points >= made.lower).all() and (points <= 1.0).all()
    assert points[:, made.coordinates(["latency_s"])].min() >= 0.0
    for column in points.T:  # a Latin hypercube: one point in each fortieth
        low = -1.0 if column.min() < 0 else 0.0
        assert sorted(np.floor((column - low) / (1 - low) * 40)) == list(range(40))


# Shrinking


def tried(violates: Callable[[Array], bool]) -> tuple[Callable[[Sequence[Array]], int | None], list[Array]]:
    seen: list[Array] = []

    def first(trials: Sequence[Array]) -> int | None:
        for k, x in enumerate(trials):
            seen.append(x)
            if violates(x):
                return k
        return None

    return first, seen


def test_delta_debugging_leaves_what_is_needed_together() -> None:
    needed = {(3,), (11,), (12,)}
    calls = []

    def first(trials: Sequence[Sequence[tuple[int, ...]]]) -> int | None:
        for k, t in enumerate(trials):
            calls.append(t)
            if needed <= set(t):
                return k
        return None

    assert set(ddmin([(k,) for k in range(60)], first)) == needed
    assert len(calls) < 150  # 60 single removals, again and again, would be some 170
    assert ddmin([(5,)], first) == [(5,)]


def test_what_is_shrunk_violates_has_no_part_too_many_and_hardly_any_size_too_much() -> None:
    x = np.random.default_rng(2).uniform(-1, 1, 43)
    x[3], x[7] = 0.9, -0.8
    first, seen = tried(lambda v: v[3] - v[7] > 0.35)
    kinds = [(42,), (40, 41), tuple(range(20)), tuple(range(20, 40))]
    small = shrink(x, kinds, [(k,) for k in range(40)] + [(40, 41), (42,)], first)
    assert 0.35 < small[3] - small[7] < 0.42  # bisected to a factor of 2^(1/8)
    assert set(np.flatnonzero(small)) <= {3, 7}
    assert len(seen) < 80


def test_the_kind_furthest_from_the_theorem_goes_first() -> None:
    first, _ = tried(lambda v: abs(v[0]) > 0.1 or abs(v[1]) > 0.1)
    small = shrink(np.array([0.8, 0.8]), [(1,), (0,)], [(0,), (1,)], first)
    assert small[1] == 0.0 and 0.1 < small[0] < 0.12


def test_a_violation_of_any_size_ends_at_rounding_not_in_a_loop() -> None:
    first, seen = tried(lambda v: v[0] != 0.0)
    small = scale(np.array([1.0]), [0], first)
    assert 0.0 < small[0] < 1e-6 and len(seen) < 12


def test_nothing_smaller_leaves_what_was_found() -> None:
    x = np.array([0.4, -0.3])
    first, _ = tried(lambda v: bool(np.array_equal(v, x)))
    assert np.array_equal(shrink(x, [(0,), (1,)], [(0,), (1,)], first), x)


# The search, on objectives whose answer is known


@dataclass
class Landscape:
    """Stands in for flying: reads the departure back from the scenario."""

    margin: Callable[[dict[str, Any]], float]
    refused: Callable[[dict[str, Any]], bool] = lambda s: False

    def __call__(self, job: Job) -> dict[str, Any]:
        s = json.loads(job.data)
        no = self.refused(s)
        margin = float("nan") if no else float(self.margin(s))
        return {
            "margin": margin,
            "value": margin + 5.0,
            "violated": margin < 0.0,
            "refused": "outside the safe set" if no else "",
            "vehicles": (1, 2),
            "t_s": 1.0,
        }


def headings(s: dict[str, Any]) -> Array:
    return np.array(s["start"]["heading_offsets_deg"] or np.zeros(s["vehicles"]))


def test_a_scenario_that_violates_as_it_stands_needs_no_search() -> None:
    flights = Flights(space(), "separation", 50, work=Landscape(lambda s: -0.5))
    found = study.falsify(flights, seed=1)
    assert len(flights.flown) == 1 and found.shrunk is flights.flown[0] and not found.shrunk.x.any()


def test_a_search_that_finds_nothing_spends_its_budget_and_says_the_least() -> None:
    flights = Flights(space(), "separation", 180, work=Landscape(lambda s: 2.0 - 0.1 * headings(s)[0]))
    found = study.falsify(flights, seed=1)
    assert found.shrunk is None and len(flights.flown) == 180
    # The least is 1.5 at the bound of 5 deg; lines are searched to a twentieth of the box, 0.5 deg
    assert 1.5 <= found.least.margin < 1.55


def test_the_descent_reaches_what_sampling_misses() -> None:
    """A ball of a hundred-thousandth of the volume, at the end of a slope."""
    centre = np.array([4.0, -3.0])

    def margin(s: dict[str, Any]) -> float:
        lateral = np.array(s["start"]["lateral_offsets_m"] or [0.0, 0.0])
        return float(np.hypot(*((headings(s) - centre) / 5)) + np.hypot(*(lateral - 6.0)) / 10 - 0.05)

    bounded = Bounds(10.0, 5.0, 0.0, 0.0, 0.0)
    flights = Flights(space(bounded), "separation", 200, work=Landscape(margin))
    found = study.falsify(flights, seed=3)
    assert found.found is not None and found.found.stage == "descent"


def test_starts_are_tried_before_weather() -> None:
    flights = Flights(
        space(), "separation", 90, work=Landscape(lambda s: 1.0 - 10 * s["network"]["latency_s"])
    )
    study.falsify(flights, seed=1)
    stages = [f.stage for f in flights.flown]
    assert stages[1:31] == ["starts"] * 30 and stages[31] == "starts and weather"
    calm = [f.x[flights.space.coordinates(["wind_mps", "latency_s"])] for f in flights.flown[:31]]
    assert not np.any(calm)


def test_a_refused_start_is_no_counterexample_and_no_dead_end() -> None:
    """Refused wherever the first heading is to the left; it violates far to the right."""
    landscape = Landscape(lambda s: headings(s)[0] + 4.5, lambda s: headings(s)[0] > 1e-9)
    flights = Flights(space(STARTS_ONLY), "separation", 150, work=landscape)
    found = study.falsify(flights, seed=1)
    assert any(f.refused for f in flights.flown)
    assert found.shrunk is not None and found.shrunk.margin < 0.0
    assert headings(json.loads(found.space.at(found.shrunk.x).model_dump_json()))[0] <= -4.5


def test_a_scenario_that_cannot_be_flown_as_it_stands_is_a_mistake_not_a_finding() -> None:
    flights = Flights(space(), "separation", 9, work=Landscape(lambda s: 1.0, lambda s: True))
    with pytest.raises(UserError, match="outside the safe set"):
        study.falsify(flights, seed=1)


class Late:
    """An executor that answers in reverse."""

    def __init__(self, workers: int) -> None:
        self.workers = workers

    def imap(self, work: Callable[[Any], Any], jobs: Sequence[Any]) -> Iterator[Outcome]:
        for k in reversed(range(len(jobs))):
            yield Outcome(k, work(jobs[k]), None, 0.0, "")


@pytest.mark.parametrize("thorough", [False, True])
def test_any_number_of_workers_flies_finds_and_shrinks_the_same(thorough: bool) -> None:
    found = []
    for pool in (None, Late(2), Late(5)):
        flights = Flights(space(), "separation", 40, pool, Landscape(lambda s: 3.0 - abs(headings(s)).max()))  # type: ignore[arg-type]
        result = study.falsify(flights, 4, thorough)
        both = flights.flown + (result.shrinks.flown if result.shrinks else [])
        found.append([(f.number, f.stage, f.margin) for f in both])
        assert result.shrunk is not None and len(result.space.values(result.shrunk.x)) == 1
        assert len(flights.flown) == 40 or not thorough
    assert found[0] == found[1] == found[2]


def test_shrinking_ends_with_its_last_violation_and_within_its_budget() -> None:
    landscape = Landscape(lambda s: 2.0 - abs(headings(s)).sum())
    for budget in (12, 200):
        result = study.falsify(Flights(space(), "separation", budget, work=landscape), 1)
        assert result.shrinks is not None and len(result.shrinks.flown) <= budget
        last = result.shrunk
        assert last is not None and last.violated and last.margin < 0.0
        if budget == 200:
            # one heading of two, rounded: 2.1 deg or so of the 2 needed
            assert len(result.space.values(last.x)) == 1
            assert 2.0 < abs(result.space.values(last.x)[0]["value"]) < 2.3


# Real flights

# Coarse rates that fly in a tenth of a second; a third of a second of delay is more than it can bear.
QUICK = ["fdm_dt_s=0.05", "filter_dt_s=0.05", "record_dt_s=0.05", "duration_s=10", "manoeuvre_instants=1"]


def test_a_start_outside_the_safe_set_is_refused_where_it_is_flown() -> None:
    made = space(STARTS_ONLY, *QUICK, "radius_m=4", "lookahead_m=10")
    result = fly(Job("start", override(made.at(np.zeros(made.size)), {}), 1, "separation"))
    assert "outside the safe set" in result["refused"] and not result["violated"]


@pytest.mark.slow
def test_the_file_written_violates_by_the_very_value_found(
    call: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "found"
    sets = [x for s in QUICK for x in ("--set", s)]
    arguments = ("--lateral", 0, "--height", 0, "--wind", 0, "--latency", 0.5, "--budget", 12)
    assert call("falsify", "paper-2-turn", *sets, *arguments, "--workers", 1, "--out", out, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    data = json.loads((out / "falsify.json").read_text())
    assert told["violated"] and data["violated"] and data["departures"]
    assert len(data["departures"]) <= len(data["found_departures"])
    s = load(out / "scenario.toml")
    assert s.seed == 1 and not s.start.heading_perturbation_deg
    entry = run(s).guarantee("separation")
    assert entry["verdict"] == "violated" and entry["value"] == data["result"]["value"] < 5.0
    assert data["reproduce"] == f"testbed run {out}/scenario.toml"
    assert {f.name for f in out.iterdir()} >= {"margin.png", "counterexample.png", "flights.csv"}
    # Found already: it violates as it stands
    assert call("falsify", out / "scenario.toml", "--workers", 1, "--out", tmp_path / "again", "--json") == 0
    again = json.loads(capsys.readouterr().out)
    assert again["flights"] == 1 and again["departures"] == []
    assert again["result"]["value"] == entry["value"]


@pytest.mark.slow
def test_the_kink_of_twenty_unicycles_is_found_and_shrunk_without_being_told(
    call: Callable[..., int], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The circle keeps 6.08 m as it stands, and the encounter is over by 12.5 s."""
    sets = ["fdm_dt_s=0.02", "filter_dt_s=0.02", "record_dt_s=0.1", "duration_s=12.5", "manoeuvre_instants=0"]
    out = tmp_path / "kink"
    more = [x for s in sets for x in ("--set", s)] + ["--budget", 200, "--seed", 2, "--workers", 1]
    assert call("falsify", "paper-20-turn", *more, "--out", out, "--json") == 0
    data = json.loads(capsys.readouterr().out)
    # Seeds 1 to 8 need 2 to 18 runs, starts alone.
    assert data["violated"] and 1 < data["flights"] <= 200
    assert data["nominal"]["margin"] > 1.0
    assert len(data["found_departures"]) == 60 and 1 <= len(data["departures"]) <= 3
    assert {d["kind"] for d in data["departures"]} <= {"lateral", "heading", "height"}
    again = run(load(out / "scenario.toml"))
    assert again.guarantee("separation")["value"] == data["result"]["value"] < 5.0
    assert again.guarantee("rows-satisfied")["verdict"] == "holds"


@pytest.mark.slow
def test_one_metre_aside_costs_twenty_unicycles_ds_by_the_kink_alone() -> None:
    """What the search shrank paper-20-turn to; the smoothed barrier bears the same start."""
    file = Path(__file__).parent.parent / "docs/guide/data/falsify/kink.toml"
    short = ["duration_s=12", "manoeuvre_instants=0", "record_dt_s=1"]
    found = run(load(file, short))
    assert sum(map(abs, load(file).start.lateral_offsets_m)) == 1.0
    assert found.guarantee("separation")["value"] == pytest.approx(3.523, abs=0.3)  # which way it chatters
    assert found.guarantee("qp-feasibility")["value"] == 0
    assert found.guarantee("rows-satisfied")["verdict"] == "holds"
    smoothed = run(load(file, [*short, "barrier.smoothing_m2=30", "delta_m2=0"]))
    assert smoothed.guarantee("separation")["value"] == pytest.approx(6.10, abs=0.02)
    plain = run(load(file, [*short, "lateral_offsets_m=[]"]))
    assert plain.guarantee("separation")["value"] == pytest.approx(6.08, abs=0.01)


def test_mistakes_are_one_line(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    for arguments, said in (
        (("--budget", 0), "--budget 0"),
        (("--guarantee", "goal"), "--guarantee goal"),
        (("--heading", 400), "--heading 400"),
        (
            [a for k in ("lateral", "heading", "height", "wind", "latency") for a in (f"--{k}", 0)],
            "every bound is 0: there is nothing to search; leave one out for its default",
        ),
        (("--workers", 0), "--workers 0"),
        (("--set", "vehicles=1", "--workers", 1, "--set", "duration_s=1"), "does not apply"),
    ):
        assert call("falsify", "paper-2-turn", *arguments, "--out", "/nonexistent/x") == 2
        lines = capsys.readouterr().err.splitlines()
        assert said in lines[-1]
