"""Requirements in signal temporal logic: robustness by brute force, what is read, what is refused."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import testbed
from testbed.errors import UserError
from testbed.requirements.formula import (
    Always,
    And,
    ColumnName,
    Comparison,
    Eventually,
    Formula,
    Interval,
    Not,
    Number,
    Or,
    Until,
    horizon,
)
from testbed.requirements.parser import parse
from testbed.requirements.quantities import QUANTITIES
from testbed.requirements.requirement import Requirement, recorded_at_every_step
from testbed.requirements.robustness import Signals, robustness
from testbed.scenario.scenario import load

GRID = 0.25  # every time of the random formulas is a multiple of it


def brute(of: Formula, signals: Mapping[str, np.ndarray], t: np.ndarray, at: float, end: float) -> float:
    """Robustness by its definition, over a grid on which every signal is constant between two points.

    The grid has the middles of the cells too: a step that holds only between two points of the grid is seen.
    """

    def here(t_: float) -> int:
        return int(np.searchsorted(t, t_ + 1e-9, side="right") - 1)

    def within(during: Interval, inner: float) -> list[float]:
        last = end - inner if during.last is None else at + during.last
        ticks = np.arange(0, round((last - at - during.first) / (GRID / 2)) + 1) * GRID / 2
        return [at + during.first + float(tick) for tick in ticks] if last >= at + during.first else []

    match of:
        case Comparison(ColumnName(name), Number(value)):
            return float(signals[name][here(at)] - value)
        case Comparison(Number(value), ColumnName(name)):
            return float(value - signals[name][here(at)])
        case Not(inner):
            return -brute(inner, signals, t, at, end)
        case And(parts):
            return min(brute(p, signals, t, at, end) for p in parts)
        case Or(parts):
            return max(brute(p, signals, t, at, end) for p in parts)
        case Always(inner, during):
            found = [brute(inner, signals, t, k, end) for k in within(during, horizon(inner))]
            return min(found, default=np.inf)
        case Eventually(inner, during):
            found = [brute(inner, signals, t, k, end) for k in within(during, horizon(inner))]
            return max(found, default=-np.inf)
        case Until(left, right, during):
            best = -np.inf
            for k in within(during, max(horizon(left), horizon(right))):
                steps = np.arange(at, k + 1e-9, GRID / 2)
                kept = min(brute(left, signals, t, float(q), end) for q in (*steps, k))
                best = max(best, min(brute(right, signals, t, k, end), kept))
            return best
    raise AssertionError(of)


comparisons = st.tuples(st.sampled_from("ab"), st.integers(-3, 3), st.booleans()).map(
    lambda c: (
        Comparison(ColumnName(c[0], 1), Number(c[1]), 1)
        if c[2]
        else Comparison(Number(c[1]), ColumnName(c[0], 1), 1)
    )
)
intervals = st.one_of(
    st.tuples(st.integers(0, 4), st.integers(0, 4)).map(
        lambda p: Interval(p[0] * GRID, (p[0] + p[1]) * GRID)
    ),
    st.integers(0, 2).map(lambda first: Interval(first * GRID)),
)


def larger(inner: st.SearchStrategy[Formula]) -> st.SearchStrategy[Formula]:
    return st.one_of(
        inner.map(Not),
        st.tuples(inner, inner).map(And),
        st.tuples(inner, inner).map(Or),
        st.tuples(inner, intervals).map(lambda p: Always(*p)),
        st.tuples(inner, intervals).map(lambda p: Eventually(*p)),
        st.tuples(inner, inner, intervals).map(lambda p: Until(*p)),
    )


formulas = st.recursive(comparisons, larger, max_leaves=3)


@settings(max_examples=150, deadline=None)
@given(of=formulas, seed=st.integers(0, 10_000), steps=st.integers(2, 9))
def test_robustness_is_its_definition(of: Formula, seed: int, steps: int) -> None:
    rng = np.random.default_rng(seed)
    t = GRID * np.concatenate([[0], np.sort(rng.choice(np.arange(1, 16), steps, replace=False))])
    values = {name: rng.integers(-5, 6, (len(t), 2)).astype(float) for name in "ab"}
    end = float(t[-1])
    if horizon(of) > end:
        with pytest.raises(ValueError, match="s ahead, and the run is"):
            robustness(of, Signals(t, values, end))
        return
    found = robustness(of, Signals(t, values, end))
    for k in range(2):
        assert found[k] == brute(of, {n: v[:, k] for n, v in values.items()}, t, 0.0, end)


@settings(max_examples=40, deadline=None)
@given(of=formulas, seed=st.integers(0, 10_000), shown=st.integers(1, 8))
def test_a_run_that_ended_early_bounds_what_it_would_have_said(of: Formula, seed: int, shown: int) -> None:
    """The whole run's robustness is between the bounds from its beginning."""
    rng = np.random.default_rng(seed)
    t = GRID * np.arange(10.0)
    values = {name: rng.integers(-5, 6, (10, 1)).astype(float) for name in "ab"}
    end = float(t[-1])
    if horizon(of) > end:
        return
    whole = robustness(of, Signals(t, values, end))[0]
    part = {n: v[:shown] for n, v in values.items()}
    low, high = (robustness(of, Signals(t[:shown], part, end, s * np.inf))[0] for s in (-1, 1))
    assert low <= whole <= high


RTAMT = [
    "always[0,2](a > 1)",
    "eventually[1,3](a < 0) and always[0,1](b > -2)",
    "always[0,2](eventually[0,1](a > b))",
    "(a > -4) until[0.5,3] (b > 2)",
    "not(always[0,1](a > 0) or eventually[2,3](b < a))",
    "always[0,3](a > 0 implies eventually[0,1](b > 0))",
]


@pytest.mark.parametrize("text", RTAMT)
def test_rtamt_says_the_same(text: str) -> None:
    """Another library's monitor of dense-time signals in steps."""
    rtamt = pytest.importorskip("rtamt")
    rng = np.random.default_rng(len(text))
    t = np.concatenate([[0.0], np.sort(rng.uniform(0.01, 5.0, 30)), [5.0]])
    values = {name: rng.normal(0, 3, (len(t), 1)) for name in "ab"}
    spec = rtamt.StlDenseTimeSpecification()
    for name in "ab":
        spec.declare_var(name, "float")
    spec.spec = text
    spec.parse()
    said = spec.evaluate(
        *([n, [[float(x), float(y)] for x, y in zip(t, v[:, 0], strict=True)]] for n, v in values.items())
    )
    assert robustness(parse(text), Signals(t, values, 5.0))[0] == pytest.approx(said[0][1], abs=1e-12)


def test_a_minimum_between_two_instants_of_a_nested_operator_is_found() -> None:
    """Steps at 0, 1.1 and 1.3 s: the value of 1.1 s is within [t + 1, t + 1.05] for t in 0.05 to 0.3 s."""
    t = np.array([0.0, 1.1, 1.3, 4.0])
    a = np.array([[5.0], [-2.0], [5.0], [5.0]])
    of = parse("always[0,2](eventually[1,1.05](a > 0))")
    assert robustness(of, Signals(t, {"a": a}, 4.0))[0] == -2.0


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("distance_m<5 or h_m >= 1 and v_mps > 2", "(distance_m < 5) or ((h_m > 1) and (v_mps > 2))"),
        ("a > 1 implies b > 2 implies c > 3", "not (a > 1) or (not (b > 2) or c > 3)"),
        ("always[0:5] not a > 1 && b > 2", "(always[0,5](not(a > 1))) and (b > 2)"),
        (
            "eventually[2,end] 2*a - b/4 > -abs(c) + 1e1",
            "eventually[2,end](((2*a)-(b/4)) > ((-abs(c)) + 10))",
        ),
        ("((a)) > (b)", "a > b"),
    ],
)
def test_formulas_bind_as_usual(text: str, same: str) -> None:
    assert placeless(parse(text)) == placeless(parse(same))


def placeless(of: Any) -> Any:
    """A formula without the places of its words."""
    import re

    return re.sub(r", at=\d+", "", repr(of))


WRONG = [
    ("always[0,20](distanse_m > 5)", r"no column 'distanse_m' at letter 14; did you mean distance_m \[m\]"),
    (
        "distance_m > v_mps",
        r"distance_m \[m\] is compared with v_mps \[m/s\] at letter 12; both need one unit",
    ),
    ("distance_m + v_mps > 1", r"distance_m \[m\] is added to v_mps \[m/s\]"),
    ("qp_status > 1", r"no column 'qp_status'"),
    ("always[0,20](5 > 3)", r"names no column; known: "),
    ("distance_m == 5", r"'==' at letter 12 is not read;.*write abs\(a - b\) < tolerance"),
    ("1 < distance_m < 5", r"compares a third time; write a < b and b < c"),
    ("always[20,0](distance_m > 5)", r"the interval \[20,0\] ends before it begins"),
    ("always[0,x](distance_m > 5)", r"'x' at letter 10 is no time"),
    ("always[0 20](distance_m > 5)", r"'20' at letter 10 stands where a comma is expected"),
    ("always[0,20] distance_m", r"'always' at letter 1 is about a number, not a comparison"),
    ("distance_m and h_m > 0", r"'and' at letter 12 is about a number"),
    ("(h_m > 0) + 1 > 2", r"'\+' at letter 11 is about a formula, not a number"),
    ("alway[0,2](h_m > 0)", r"'alway' at letter 1 is no operator; did you mean always"),
    ("always[0,2](h_m > 0", r"the end stands where \) is expected"),
    ("h_m > 0 )", r"'\)' at letter 9 is not expected there"),
    ("h_m > 0 and", r"the end stands where a column or a number is expected"),
    ("", r"the end stands where a column"),
    ("h_m > 2deg", r"'deg' at letter 8|'2deg'"),
    ("h_m > 1e999", r"'1e999' at letter 7 is too large"),
    ("(" * 60 + "h_m > 0" + ")" * 60, r"nested too deeply"),
    ("distance_m > 5 or clearance_m > 0", r"columns of pairs and of fences in one formula"),
    ("h_m > " + "1" * 2000, r"has more than 1000 letters"),
]


@pytest.mark.parametrize(("text", "said"), WRONG, ids=range(len(WRONG)))
def test_a_wrong_requirement_is_refused_in_one_line(text: str, said: str) -> None:
    with pytest.raises(UserError, match=said) as error:
        Requirement(text).unit  # noqa: B018
    assert "\n" not in str(error.value)


@pytest.fixture(scope="module")
def flown() -> testbed.Run:
    quick = ["fdm_dt_s=0.05", "filter_dt_s=0.05", "record_dt_s=1", "manoeuvre_instants=0"]
    return testbed.run(recorded_at_every_step(load("paper-2-turn", quick)))


def test_the_robustness_of_a_run_is_that_of_its_tables(flown: testbed.Run) -> None:
    found = Requirement("always[0,20](distance_m > 5) and eventually[0,15](goal_distance_m < 20)").judge(
        flown
    )
    least = flown.pairs.distance_m.min() - 5
    goal = np.array([[200, 0, 0], [-200, 0, 0]])
    rows = flown.vehicles[flown.vehicles.t_s <= 15 + 1e-9]
    place = rows[["x_m", "y_m", "z_m"]].to_numpy().reshape(-1, 2, 3)
    near = 20 - np.linalg.norm(place - goal, axis=-1).min(axis=0)
    assert found.value == min(least, near.min()) and found.unit == "m"
    assert found.status == ("holds" if found.value >= 0 else "violated")


def test_derived_columns_are_horizontal_and_vertical_distances(flown: testbed.Run) -> None:
    level = Requirement("always (horizontal_m > 3)").judge(flown)
    assert level.value == pytest.approx(flown.pairs.distance_m.min() - 3)  # they fly at one height
    upright = Requirement("eventually (vertical_m > 1)").judge(flown)
    assert (
        upright.value == pytest.approx(-1.0) and upright.status == "violated" and upright.vehicles == (1, 2)
    )


def test_a_formula_of_pairs_and_vehicles_is_about_each_vehicle_of_each_pair(flown: testbed.Run) -> None:
    found = Requirement("always (distance_m < 50 implies v_mps > 18)").judge(flown)
    distance = flown.pairs.distance_m.to_numpy()
    v = flown.vehicles.v_mps.to_numpy().reshape(-1, 2)
    by_hand = np.maximum(distance - 50, (v - 18).T).min()
    assert found.value == by_hand and found.unit == ""


def test_a_column_without_a_value_leaves_the_requirement_open(flown: testbed.Run) -> None:
    found = Requirement("always (hdot_realised_mps > -100)").judge(flown)  # nan at the last instant
    assert found.value is None and found.status == "open"
    assert Requirement("always[0,19](hdot_realised_mps > -100)").judge(flown).status == "holds"
    both = Requirement("always (hdot_realised_mps > -100) and always (distance_m > 300)").judge(flown)
    assert both.status == "violated" and both.vehicles == (1, 2)


def test_a_run_that_ended_early_may_be_violated_met_or_open(flown: testbed.Run) -> None:
    """Cut off at 10 s of 20: the pair has met, at its least distance, and nobody is at the goal yet."""
    run = flown
    whole = run.pairs.distance_m
    seen = {
        name: {c: v[: len(v) * 200 // 401] for c, v in columns.items()}
        for name, columns in run.tables.items()
    }
    cut = testbed.Run(run.manifest | {"ended_early": "stall at 10 s"}, run.guarantees, {}, tables=seen)
    close = whole[:200].min()
    lost = Requirement(f"always[0,20](distance_m > {close + 1:.6f})").judge(cut)
    assert lost.status == "violated" and lost.value == pytest.approx(-1.0, abs=1e-5)
    left = Requirement("always[0,20](distance_m > 1)").judge(cut)
    assert (left.status, left.value) == ("open", None) and "stall at 10 s" in left.why
    met = Requirement("eventually[0,20](distance_m < 100)").judge(cut)
    assert met.status == "holds" and met.value == pytest.approx(100 - close)
    assert Requirement("always[0,9](distance_m > 1)").judge(cut).status == "holds"


@pytest.mark.parametrize(
    ("scenario", "text", "said"),
    [
        (
            "paper-2-turn",
            "always[0,40](distance_m > 5)",
            r"looks 40 s ahead, and paper-2-turn lasts 20 s; set dur",
        ),
        ("paper-2-turn", "always (clearance_m > 0)", r"no column clearance_m: it has no \[\[fence\]\] table"),
        (
            "paper-2-turn",
            "always (roll_rad < 1)",
            r"no column roll_rad: aircraft alone have it, so give --plant",
        ),
        (
            "loiter-stack",
            "eventually (goal_distance_m < 9)",
            r"no column goal_distance_m: vehicle .* has no goal",
        ),
    ],
)
def test_a_scenario_whose_runs_cannot_tell_is_refused(scenario: str, text: str, said: str) -> None:
    with pytest.raises(UserError, match=said):
        Requirement(text).check(load(scenario))


def test_the_guide_lists_every_column() -> None:
    page = (Path(__file__).parent.parent / "docs/guide/requirements.md").read_text("utf-8")
    for name in ("goal_distance_m", "horizontal_m", "vertical_m", "clearance_m", "fence_h_m"):
        assert f"`{name}`" in page and name in QUANTITIES


def test_falsify_searches_the_least_robustness(
    tmp_path: Path, call: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    import json
    import tomllib

    from testbed.studies.falsify import figures

    # Drawing takes longer than the search; the guide's page draws.
    for name in ("margins", "counterexample"):
        monkeypatch.setattr(figures, name, lambda *_: [])

    out = tmp_path / "found"
    text = "always[0,0.5](vertical_m < 0.9)"  # heights may depart by 1 m
    settings_ = (
        "--set",
        "fdm_dt_s=0.05",
        "--set",
        "filter_dt_s=0.05",
        "--set",
        "record_dt_s=0.05",
        "--set",
        "duration_s=0.5",
    )
    asked = ("falsify", "paper-2-turn", "--requirement", text, "--budget", 8, "--workers", 1, *settings_)
    assert call(*asked, "--out", out) == 0
    data = json.loads((out / "falsify.json").read_text())
    assert data["guarantee"] == text and data["violated"] and data["margin_unit"] == "m"
    s = load(out / "scenario.toml")
    assert s.rates.record_dt_s == s.rates.filter_dt_s
    assert Requirement(text).judge(testbed.run(s)).value == data["result"]["value"] < 0
    assert tomllib.loads((out / "scenario.toml").read_text())["name"].startswith("paper-2-turn")


def test_falsify_takes_a_guarantee_or_a_requirement(refusal: Callable[..., str]) -> None:
    said = refusal("falsify", "paper-2-turn", "--requirement", "h_m > 0", "--guarantee", "safe-set")
    assert "--requirement and --guarantee: give one of the two" in said
    assert "did you mean h_m" in refusal("falsify", "paper-2-turn", "--requirement", "hm > 0")
    assert "looks 90 s ahead" in refusal("falsify", "paper-2-turn", "--requirement", "always[0,90](h_m > 0)")


FORMULA = "always[0,0.5](distance_m > 395)"


def test_a_campaign_records_the_robustness_of_each_run() -> None:
    import json

    from testbed.campaigns.flight import fly
    from testbed.campaigns.identity import code_id
    from testbed.campaigns.job import Job

    s = load("paper-2-turn", ["filter_dt_s=0.05", "record_dt_s=1", "duration_s=1", "manoeuvre_instants=0"])
    job = Job(
        "x", json.dumps(s.model_dump(mode="json")), 1, code=code_id(), requirements=(("apart", FORMULA),)
    )
    row = fly(job)
    assert row["status"] == "flown", row
    value, verdict = row["guarantees"]["apart"]
    # Two at 25 m/s towards each other from 400 m: 375 m after half a second.
    assert value == pytest.approx(-20.0, abs=1.3) and verdict == "violated"
    assert row["guarantees"]["separation"][1] == "holds"


def test_a_campaign_s_requirements_are_checked_and_part_of_its_runs(tmp_path: Path) -> None:
    from testbed.campaigns.bases import bases
    from testbed.campaigns.file import load as campaign
    from testbed.campaigns.plan import expand

    def plan(text: str) -> Any:
        file = tmp_path / "c.toml"
        file.write_text('name = "c"\nscenario = "paper-2-turn"\nseeds = 1\n' + text)
        found, here = campaign(str(file))
        return expand(found, bases(found, here), code="x")

    plain = plan("")
    asked = plan(f'guarantee = "apart"\n[requirements]\napart = "{FORMULA}"\n')
    assert asked.campaign.guarantee == "apart" and asked.runs[0].id != plain.runs[0].id
    for text, said in (
        (
            '[requirements]\napart = "hm > 0"\n',
            r"requirements.apart: .*no column 'hm' at letter 1; did you mean h_m",
        ),
        ('[requirements]\nseparation = "h_m > 0"\n', r"no claim's id"),
        ('[requirements]\nApart = "h_m > 0"\n', r"small letters, digits, _ and -"),
        ('guarantee = "apart"\n', r"guarantee: input should be 'separation'.*got 'apart'"),
        (
            '[requirements]\napart = "always[0,99](h_m > 0)"\n',
            r"looks 99 s ahead, and paper-2-turn lasts 20 s",
        ),
    ):
        with pytest.raises(UserError, match=said):
            plan(text)


def test_a_baseline_compares_robustness(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from testbed.regression import recording
    from testbed.regression.baseline import parse_file
    from testbed.regression.quantities import fly, job, quantities

    settings_ = ["filter_dt_s=0.05", "record_dt_s=0.05", "duration_s=1", "heading_perturbation_deg=5"]
    asked = {"apart": FORMULA}
    s = load("paper-2-turn", settings_)
    names = [q.name for q in quantities(s, requirements=asked)]
    assert names.count("apart") == 1 and "apart lost" in names
    row = fly(job(s, "unicycle", {"plant": "unicycle"}, 1, requirements=asked))
    assert list(row) == names and row["apart"] is not None and row["apart"] < 0 and row["apart lost"] == 1.0

    def flown(s: Any, rungs: Any, seeds: Any, *rest: Any) -> Any:
        n = len(list(seeds))
        return {
            r: {q: np.linspace(1, 2, n) for q in [m.name for m in quantities(s, False, rest[2])]}
            for r in rungs
        }

    monkeypatch.setattr(recording, "fly_rungs", flown)
    made, path = recording.record(
        tmp_path, "b", "paper-2-turn", settings_, rungs=["unicycle"], requirements=asked
    )
    assert parse_file(path).requirements == made.requirements == asked
    assert [q.unit for q in made.quantities if q.name == "apart"] == ["m"]
    again, _ = recording.record(tmp_path, "b", reason="kept")  # as it was recorded
    assert again.requirements == asked
    with pytest.raises(UserError, match="requirement 'safe-set': name it by small letters"):
        recording.record(tmp_path, "c", "paper-2-turn", settings_, requirements={"safe-set": FORMULA})


def test_a_requirement_of_a_baseline_has_a_name(refusal: Callable[..., str]) -> None:
    record = ("regress", "record", "b", "--scenario", "paper-2-turn", "--requirement")
    assert "write NAME=FORMULA" in refusal(*record, "always(distance_m > 5)")
    assert "no column 'hm'" in refusal(*record, "low=hm > 5")


PIECES = [
    *(
        "always",
        "eventually",
        "until",
        "not",
        "and",
        "or",
        "implies",
        "abs",
        "h_m",
        "v_mps",
        "distance_m",
        "x",
    ),
    *(
        "[0,2]",
        "[1,end]",
        "[",
        ",",
        "(",
        ")",
        "<",
        ">=",
        "==",
        "+",
        "-",
        "*",
        "/",
        "5",
        "0.5",
        "1e9",
        "²",
        "$",
    ),
    "\n",
]


@settings(max_examples=200, deadline=None)
@given(pieces=st.lists(st.sampled_from(PIECES), max_size=12))
def test_any_text_is_a_formula_or_refused_in_one_line(pieces: list[str]) -> None:
    try:
        assert isinstance(Requirement(" ".join(pieces)).unit, str)
    except UserError as error:
        assert "\n" not in str(error)
