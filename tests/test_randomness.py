"""What in a scenario the seed may change, field by field; and what is said where it changes nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from testbed.campaigns.distinct import check_distinct, check_random, counted, distinct_results
from testbed.errors import UserError
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import load, parse

# Overrides -> the fields that are named.
RANDOM = {
    ("lateral_perturbation_m=1",): ["start.lateral_perturbation_m"],
    ("heading_perturbation_deg=1",): ["start.heading_perturbation_deg"],
    ("height_perturbation_m=1",): ["start.height_perturbation_m"],
    ("sensing.position_noise_m=1",): ["sensing.position_noise_m"],
    ("sensing.position_bias_m=1",): ["sensing.position_bias_m"],
    ("sensing.course_drift_deg=1",): ["sensing.course_drift_deg"],
    ("network.loss=0.5",): ["network.loss"],
    ("network.loss=0.01",): ["network.loss"],
    ("plant=lagged", "gusts.intensity=light"): ["gusts"],
    ("plant=lagged", "gusts.sigma_mps=1"): ["gusts"],
    ("plant=jsbsim", "gusts.jsbsim_turbulence=light"): ["gusts.jsbsim_turbulence"],
    ("remedy.air_mass=true", "wind.speed_mps=1", "gusts.intensity=light"): ["gusts"],
    ("lateral_perturbation_m=1", "network.loss=0.5"): ["start.lateral_perturbation_m", "network.loss"],
}
STILL = [
    (),
    ("start.lateral_perturbation_m=0",),
    ("network.loss=0",),
    ("network.loss=1",),
    ("plant=lagged",),
    ("plant=lagged", "gusts.sigma_mps=0"),
    ("plant=lagged", "wind.speed_mps=3"),
    ("network.latency_s=0.1",),
    ("sensing.delay_s=0.1",),
]


@pytest.mark.parametrize("overrides", RANDOM, ids=" ".join)
def test_a_random_field_is_named(overrides: tuple[str, ...]) -> None:
    assert random_fields(load("paper-2-turn", list(overrides))) == RANDOM[overrides]


@pytest.mark.parametrize("overrides", STILL, ids=" ".join)
def test_what_draws_nothing_is_not(overrides: tuple[str, ...]) -> None:
    assert random_fields(load("paper-2-turn", list(overrides))) == []


def test_random_goals_are_random() -> None:
    drawn = load("paper-2-turn").model_dump(mode="json") | {"start": {"pattern": "random-goals"}}
    assert random_fields(parse(drawn)) == ["start.pattern"]


def test_gusts_move_no_unicycle_over_the_ground() -> None:
    gusty = load("paper-2-turn", ["plant=lagged", "gusts.intensity=light"])
    assert random_fields(gusty.model_copy(update={"plant": "unicycle"})) == []


def test_seeds_that_change_nothing_are_refused_and_the_remedy_works() -> None:
    still = load("paper-2-turn")
    check_random(still, "a study", 1)
    check_random(load("paper-2-turn", ["start.heading_perturbation_deg=5"]), "a study", 2)
    said = (
        "paper-2-turn: a study of 2 seeds, nothing random: every seed gives the same run; perturb the start,"
        " for example --set start.heading_perturbation_deg=5"
    )
    with pytest.raises(UserError) as one:
        check_random(still, "a study", 2)
    assert str(one.value) == f"{said}, or fly one seed"
    with pytest.raises(UserError) as many:
        check_random(still, "a study", 2, one_will_do=False)
    assert str(many.value) == said


def plan(*cells: tuple[int, list[dict[str, float]], tuple[str, ...]], stop: object = None) -> Any:
    """A plan whose cells have so many seeds, with these draws, and these parts of the user's own."""
    listed = [SimpleNamespace(number=k, label=f"cell {k}", own=own) for k, (_, _, own) in enumerate(cells)]
    runs = [
        [SimpleNamespace(base=0, draws=draws[n % len(draws)]) for n in range(seeds)]
        for seeds, draws, _ in cells
    ]
    roles = {"a": "plant", "b": "environment", "c": "filter", "d": "guidance"}
    return SimpleNamespace(
        cells=listed,
        of=lambda number: runs[number],
        data=lambda run: load("paper-2-turn").model_dump(mode="json"),
        parts=SimpleNamespace(origins={label: {"role": role} for label, role in roles.items()}),
        campaign=SimpleNamespace(name="c", stop=stop),
    )


SAME, DRAWN = [{"x": 1.0}], [{"x": 1.0}, {"x": 2.0}]
# A cell that flies one run twice, and cells that do not.
REPEATS = (2, SAME, ())
FINE = [(1, SAME, ()), (2, DRAWN, ()), (2, SAME, ("a",)), (2, SAME, ("b",)), (2, SAME, ("c", "b"))]


@pytest.mark.parametrize("fine", FINE)
def test_a_cell_that_may_be_random_is_flown_and_hides_no_other(fine: Any) -> None:
    check_distinct(plan(fine))
    with pytest.raises(UserError, match=r"^c, cell 1: 2 seeds, nothing random: add"):
        check_distinct(plan(fine, REPEATS))


@pytest.mark.parametrize("own", [(), ("c",), ("d",), ("c", "d")])
def test_parts_that_are_given_no_generator_draw_nothing(own: tuple[str, ...]) -> None:
    said = (
        "c: 3 seeds, nothing random: add [random], or seeds = 1, or perturb the start, for example"
        " start.heading_perturbation_deg = 5; every seed gives the same run"
    )
    with pytest.raises(UserError) as refused:
        check_distinct(plan((3, SAME, own)))
    assert str(refused.value) == said
    with pytest.raises(UserError, match=r"nothing random: add \[random\], or looks = \[1\], or perturb"):
        check_distinct(plan((3, SAME, own), stop=object()))


def test_results_are_counted_without_what_names_the_run() -> None:
    rows = [{"seed": k, "rung": f"r{k}", "d": d} for k, d in enumerate((1.0, 1.0, 2.0))]
    assert distinct_results(rows) == 3
    assert distinct_results([{"seed": r["seed"], "d": r["d"]} for r in rows]) == 2
    assert distinct_results(rows, without=("seed", "rung")) == 2
    assert distinct_results(rows, without=("seed", "rung", "d")) == 1
    assert counted(3, 3) == "3 runs, all distinct"
    assert counted(3, 2) == "3 runs, only 2 distinct: intervals and tests take them for 3 independent ones"
