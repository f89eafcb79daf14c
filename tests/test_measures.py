"""Measures of encounters: cylinders against brute force, hand-made paths, risk ratios against exact sums."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from math import comb
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.model import Array
from testbed.campaigns import file
from testbed.claims.registry import INTERVENTION
from testbed.errors import UserError
from testbed.measures.cylinders import (
    CREWED_NMAC,
    CREWED_WELL_CLEAR,
    SMALL_NMAC,
    SMALL_WELL_CLEAR,
    Cylinder,
    inside,
    nearest,
    read,
)
from testbed.measures.encounter_comparison import MEASURE, compared, paired, plain, rows_of
from testbed.measures.encounter_measures import Settings, columns, measured
from testbed.measures.lost_volumes import Paths, lost
from testbed.records.run import Run
from testbed.scenario.scenario import load
from testbed.statistics.risk_ratio import parts, risk_ratio

FT = 12 * 0.0254
VOLUME = Cylinder(20.0, 8.0)


# Cylinders.


@given(st.lists(st.floats(-60, 60), min_size=6, max_size=6), st.booleans(), st.booleans())
@settings(max_examples=60, deadline=None)
def test_depth_and_time_inside_are_those_of_many_points_on_the_line(
    numbers: list[float], level: bool, still: bool
) -> None:
    offset, move = np.array(numbers[:3])[:, None], np.array(numbers[3:])[:, None]
    move[2] *= not level
    move[:2] *= not still
    s = np.linspace(0.0, 1.0, 4001)
    line = offset + move * s
    measure = np.maximum(np.hypot(line[0], line[1]) / 20.0, np.abs(line[2]) / 8.0)
    least, place = nearest(offset, move, VOLUME)
    # A step of the points is at most 85 m / 4000 long, and the measure changes by an eighth of it a metre.
    assert measure.min() - 0.003 <= least[0] <= measure.min() + 1e-9
    at = offset[:, 0] + place[0] * move[:, 0]
    assert max(np.hypot(*at[:2]) / 20.0, abs(at[2]) / 8.0) == pytest.approx(least[0], abs=1e-9)
    low, high = inside(offset, move, VOLUME)
    assert high[0] - low[0] == pytest.approx((measure < 1.0).mean(), abs=1e-3)


def test_standard_volumes_are_those_of_their_sources_in_feet() -> None:
    feet = [(SMALL_NMAC, 50, 15), (CREWED_NMAC, 500, 100), (CREWED_WELL_CLEAR, 2000, 250)]
    for cylinder, radius, height in feet:
        assert cylinder.radius_m == pytest.approx(radius * FT)
        assert cylinder.half_height_m == pytest.approx(height * FT)
        assert read(f"{radius}x{height}ft", "--nmac").radius_m == pytest.approx(cylinder.radius_m)
    ratio = CREWED_WELL_CLEAR.radius_m / CREWED_NMAC.radius_m
    assert SMALL_WELL_CLEAR.radius_m == pytest.approx(ratio * SMALL_NMAC.radius_m)
    assert read("30x10", "--nmac") == Cylinder(30.0, 10.0)


@pytest.mark.parametrize("text", ["30", "30x", "x10", "0x10", "30x-1", "axb", "30x10km", "1e9x1", "..x1", ""])
def test_a_cylinder_that_is_none_is_named(text: str) -> None:
    with pytest.raises(UserError, match=r"--nmac .*give radius x half height"):
        read(text, "--nmac")


# Paths.


def paths(x: list[float], other: Array | None = None, **more: Any) -> Paths:
    """The first flies along x at 1 Hz; the other stands at the origin, or where it is said."""
    place = np.zeros((3, len(x), 2))
    place[0, :, 0] = x
    if other is not None:
        place[:, :, 1] = other
    return Paths(np.arange(len(x), dtype=float), place, np.array([0]), np.array([1]), **more)


STRAIGHT = [-60.0, -35.0, -10.0, 15.0, 40.0]


def test_a_straight_pass_is_lost_for_its_chord() -> None:
    found = lost(paths(STRAIGHT), VOLUME)
    assert (found.lost, found.undecided, found.pairs) == (True, False, 1)
    # At 25 m/s through 40 m, from x = -20 on, to the same place.
    assert found.time_s == pytest.approx(40 / 25)
    assert found.first_s == pytest.approx(40 / 25)
    assert found.depth == pytest.approx(1.0)


def test_a_pass_between_samples_is_seen_and_height_counts() -> None:
    high = np.zeros((3, 3))
    high[2] = 6.0
    found = lost(paths([-60.0, 0.0, 60.0][0:3], high), VOLUME)
    assert found.lost and found.depth == pytest.approx(1 - 6 / 8)
    high[2] = 8.001
    assert not lost(paths([-60.0, 0.0, 60.0], high), VOLUME).lost


def test_a_bend_that_may_reach_in_leaves_it_undecided() -> None:
    aside = np.zeros((3, 5))
    aside[1] = 20.3  # beside the cylinder by 0.3 m
    still = paths(STRAIGHT, aside)
    assert not lost(still, VOLUME).lost and not lost(still, VOLUME).undecided
    # Unicycles that turn with 4 m/s^2 leave the chord of 1 s by 0.5 m.
    turning = paths(STRAIGHT, aside, turning=np.full((5, 2), 2.0))
    assert not lost(turning, VOLUME).lost and lost(turning, VOLUME).undecided
    assert not lost(paths(STRAIGHT, aside, turning=np.full((5, 2), 0.5)), VOLUME).undecided
    aside[1] = 19.9
    grazing = paths([-60.0, -30.0, 30.0, 60.0, 90.0], aside, turning=np.full((5, 2), 2.0))
    assert lost(grazing, VOLUME).lost and lost(grazing, VOLUME).undecided


def test_who_has_left_is_not_looked_at() -> None:
    left = np.zeros((5, 2), dtype=bool)
    left[2:, 1] = True
    assert lost(paths(STRAIGHT), VOLUME).lost
    assert not lost(paths(STRAIGHT, left=left), VOLUME).lost
    columns_, pair = paths(STRAIGHT, left=left).closest()
    assert columns_["closest_m"] == pytest.approx(35.0) and pair == (0, 1)


# Runs.


def run(**fields: Any) -> Run:
    """Two vehicles head-on along x, 20 m/s each, 6 m apart across; the filter turns the first at 2 s."""
    s = load("paper-2-turn", ["filter_dt_s=0.1", "record_dt_s=0.1", "duration_s=20"])
    t = np.arange(201) * 0.1
    n = 2
    x = np.stack([-200 + 20 * t, 200 - 20 * t], axis=1)
    y = np.stack([np.zeros(201), np.full(201, 6.0)], axis=1)
    zero = np.zeros((201, n))
    turn = zero.copy()
    turn[20:40, 0] = np.radians(13 * 0.2)  # 0.1 of the range from -13 to 13 deg/s
    turn[10:20, 1] = np.radians(13 * 0.06)  # 0.03 of it: altered, no intervention
    columns_ = {
        "t_s": np.repeat(t, n), "vehicle": np.tile([1, 2], 201),
        "x_m": x.ravel(), "y_m": y.ravel(), "z_m": zero.ravel(), "theta_rad": np.tile([0, np.pi], 201),
        "v_mps": (zero + 20).ravel(), "omega_radps": zero.ravel(), "zeta_mps": zero.ravel(),
        "v_nominal_mps": (zero + 20).ravel(), "omega_nominal_radps": zero.ravel(),
        "zeta_nominal_mps": zero.ravel(), "v_command_mps": (zero + 20).ravel(),
        "omega_command_radps": turn.ravel(), "zeta_command_mps": zero.ravel(),
        "override": (turn != 0).ravel(),
    }  # fmt: skip
    detail = {"path_added_m": [3.0, None], "time_added_s": [0.5, None]}
    verdict = INTERVENTION.unjudged("root", 20.0).but(detail=detail)
    manifest = {"scenario": s.model_dump(mode="json") | fields, "ended_early": None}
    return Run(manifest, [verdict], {}, tables={"vehicles": columns_})


def test_measures_of_a_hand_made_run() -> None:
    row = measured(run(), Settings({"ds": Cylinder(10.0, 5.0)}))
    assert row.keys() == columns(Settings({"ds": Cylinder(10.0, 5.0)})).keys()
    assert row["ds_lost"] and not row["ds_undecided"]
    assert row["ds_depth"] == pytest.approx(0.4)
    assert row["ds_time_s"] == pytest.approx(2 * 8.0 / 40.0)  # a chord of 16 m at 40 m/s
    assert row["ds_first_s"] == pytest.approx(10.0 - 8.0 / 40.0)
    assert (row["closest_m"], row["closest_s"]) == pytest.approx((6.0, 10.0))
    assert (row["alert_s"], row["intervention_s"], row["lead_s"]) == pytest.approx((1.0, 2.0, 8.0))
    assert row["intervention_share"] == pytest.approx(20 / 402)
    assert (row["arrived"], row["with_goal"]) == (1, 2)
    assert (row["path_added_m"], row["time_added_s"]) == (3.0, 0.5)
    # The first comes within 20 m of its goal after 380 m.
    assert row["flown_s"] == pytest.approx(19.0, abs=0.11)


def test_a_run_without_measurable_pairs_or_samples_is_refused_with_a_remedy() -> None:
    made = run()
    made.tables["vehicles"] = {k: v[:4] for k, v in made.tables["vehicles"].items()}
    with pytest.raises(UserError, match=r"record every filter step, with --set record_dt_s=0\.1"):
        measured(made)
    with pytest.raises(UserError, match="no pair has a vehicle under the filter"):
        measured(run(vehicles=1))


def test_a_run_that_ended_before_its_first_step_is_undecided() -> None:
    made = run()
    made.manifest["ended_early"] = "a part failed"
    made.tables["vehicles"] = {k: v[:2] for k, v in made.tables["vehicles"].items()}
    row_ = measured(made)
    assert (row_["nmac_lost"], row_["nmac_undecided"]) == (False, True)
    assert row_["closest_m"] == pytest.approx(400.0, rel=1e-3)
    empty = Paths(np.zeros(0), np.zeros((3, 0, 2)), np.array([0]), np.array([1]))
    assert lost(empty, VOLUME).undecided and empty.closest()[1] == ()
    assert not empty.lengths(empty.until(np.zeros((2, 3)), 20.0)).any()


# Risk ratios.


def test_the_exact_interval_covers_95_percent_of_all_outcomes() -> None:
    n, covered = 4, {p: 0.0 for p in ((0.1, 0.05, 0.3), (0.02, 0.02, 0.2), (0.3, 0.3, 0.3))}
    for a, b, c in itertools.product(range(n + 1), repeat=3):
        if (d := n - a - b - c) < 0:
            continue
        unresolved, (low, _, high) = parts(a, b, c, 0.975)
        chance = comb(n, a) * comb(n - a, b) * comb(n - a - b, c)
        for p in covered:
            truth = (p[0] + p[1]) / (p[0] + p[2])
            weight = chance * p[0] ** a * p[1] ** b * p[2] ** c * (1 - sum(p)) ** d
            covered[p] += weight * (unresolved.low + low <= truth <= unresolved.high + high)
    assert min(covered.values()) > 0.95


def test_zero_counts_are_said() -> None:
    rng = np.random.default_rng(1)
    some = np.arange(100) < 30
    none = np.zeros(100, dtype=bool)
    safe = risk_ratio(none, some, rng)
    assert safe.value == 0.0 and 0.0 == safe.exact.low < safe.exact.high < 0.3
    assert "no event with the filter" in safe.note and np.isnan(safe.bootstrap.low)
    worse = risk_ratio(some, none, rng)
    assert worse.value == np.inf and worse.exact.high == np.inf and "no upper bound" in worse.note
    empty = risk_ratio(none, none, rng)
    assert np.isnan(empty.value) and (empty.exact.low, empty.exact.high) == (0.0, np.inf)
    assert "unknown" in empty.note


def test_seeds_of_one_encounter_are_no_independent_encounters() -> None:
    rng = np.random.default_rng(2)
    with_, without = rng.random((2, 60)) < np.array([[0.2], [0.6]])
    single = risk_ratio(with_, without, np.random.default_rng(3))
    many = np.repeat(with_, 10), np.repeat(without, 10)
    grouped = risk_ratio(*many, np.random.default_rng(3), np.repeat(np.arange(60), 10))
    ignored = risk_ratio(*many, np.random.default_rng(3))
    assert np.isnan(grouped.exact.low) and "not independent" in grouped.exact.method
    width = [np.log(r.bootstrap.high / r.bootstrap.low) for r in (single, grouped, ignored)]
    assert width[1] == pytest.approx(width[0], rel=0.05) and width[2] < 0.5 * width[0]


def row(lost_: bool, undecided: bool, intervened: bool) -> dict[str, Any]:
    volume = {"lost": lost_, "undecided": undecided, "depth": 0.5 * lost_, "time_s": 1.0 * lost_}
    names = {f"{name}_{k}": v for name in ("nmac", "well_clear") for k, v in volume.items()}
    return names | {
        "intervention_s": 3.0 if intervened else None, "lead_s": 5.0 if intervened else None,
        "path_m": 100.0 + intervened, "flown_s": 10.0, "arrived": 1, "with_goal": 2,
    }  # fmt: skip


def test_undecided_counts_against_the_filter_and_nuisance_is_by_the_flight_without() -> None:
    no, yes = False, True
    first = [row(yes, no, yes), row(no, yes, yes), row(no, no, yes), row(no, no, no)]
    second = [row(yes, no, no), row(yes, yes, no), row(no, no, no), row(yes, no, no)]
    found = compared(first, second, np.random.default_rng(1))
    assert (found["nmac"].with_filter, found["nmac"].without) == (2, 2)
    assert (found["nuisance"].count, found["nuisance"].runs) == (2, 2)
    assert (found["missed"].count, found["missed"].runs) == (1, 2)
    assert found["undecided"] == (1, 1) and found["arrived"] == (4, 8)
    assert found["path_added_m"].value == pytest.approx(0.75)
    assert plain(found)["nmac"]["value"] == 1.0


def test_rows_of_a_campaigns_table_come_back_and_refused_runs_are_left_out() -> None:
    rows = [row(True, False, True), row(False, False, False)]
    table = pd.DataFrame([{MEASURE + k: None if v is None else float(v) for k, v in r.items()} for r in rows])
    table.loc[2] = np.nan
    back = rows_of(table)
    assert [r["intervention_s"] if r else r for r in back] == [3.0, None, None]
    assert back[2] is None
    with_filter = {1: back[0], 2: back[1], 3: None}
    keys, first, second, left_out = paired(with_filter, {1: back[0], 2: back[1], 3: back[0]})
    assert (keys, len(first), len(second), left_out) == ([1, 2], 2, 2, 1)
    with pytest.raises(UserError, match="nothing to compare"):
        paired({1: back[0]}, {2: back[1]})


# The command.


def campaign_folder(path: Path, kinds: list[str], seeds: int, files: bool = False) -> Path:
    """A campaign's folder with measures: the first kind never loses, the others do on odd seeds."""
    path.mkdir()
    said = {"measures": Settings().data(), "random": {}}
    (path / "campaign.json").write_text(json.dumps({"campaign": said}))
    rows = []
    for kind in kinds:
        for seed in range(seeds):
            values = row(kind != kinds[0] and seed % 2 == 1, False, kind == kinds[0])
            of = {"file": f"{seed // 2}.toml"} if files else {}
            own = {MEASURE + k: None if v is None else float(v) for k, v in values.items()}
            before = {"id": f"{kind}{seed}", "filter.kind": kind, **of, "seed": seed, "status": "flown"}
            rows.append(before | own)
    pd.DataFrame(rows).to_parquet(path / "runs.parquet")
    return path


def test_the_command_compares_cells_of_a_campaign_and_two_folders(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    both = campaign_folder(tmp_path / "both", ["centralised", "none"], 20)
    assert call("measures", both, "--against", "kind=none", "--json") == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert (cell["nmac"]["with_filter"], cell["nmac"]["without"]) == (0, 10)
    assert cell["nuisance"]["count"] == cell["nuisance"]["runs"] == 10
    first = campaign_folder(tmp_path / "with", ["centralised"], 20)
    second = campaign_folder(tmp_path / "without", ["x", "none"], 20)
    assert call("measures", first, "--against", first) == 0
    assert "no event with or without the filter" in capsys.readouterr().out
    assert call("measures", second) == 0
    assert "10/20 (27-73 %)" in capsys.readouterr().out
    grouped = campaign_folder(tmp_path / "files", ["centralised", "none"], 20, files=True)
    assert call("measures", grouped, "--against", "kind=none", "--json") == 0
    (cell,) = json.loads(capsys.readouterr().out)["cells"]
    assert cell["nmac"]["exact"]["low"] is None


def test_mistakes_of_the_command_are_named(
    tmp_path: Path, tmp_path_factory: pytest.TempPathFactory, refusal: Callable[..., str]
) -> None:
    folder = campaign_folder(tmp_path_factory.mktemp("c") / "both", ["centralised", "none"], 4)
    assert "holds no run and no campaign" in refusal("measures", tmp_path)
    assert "give radius x half height" in refusal("measures", folder, "--nmac", "big")
    assert "no such folder, and no COLUMN=VALUE" in refusal("measures", folder, "--against", "elsewhere")
    assert "did you mean none" in refusal("measures", folder, "--against", "kind=nona")
    assert "no axis 'kinds'" in refusal("measures", folder, "--against", "kinds=none")
    assert "keeps no run centralised0" in refusal("measures", folder, "--nmac", "3x3")
    assert "give a share" in refusal("measures", folder, "--threshold", "1.5")
    assert "give NAME=RADIUS" in refusal("measures", folder, "--cylinder", "5x5")


def test_a_campaigns_table_of_measures_is_checked_and_alone_changes_no_other_campaign() -> None:
    plain_ = {"name": "c", "scenario": "paper-2-turn", "seeds": 1}
    made = file.parse(plain_ | {"measures": {}}, "c.toml")
    assert made.measures is not None and made.measures.settings().data() == Settings().data()
    assert file.parse(plain_, "c.toml").measures is None
    with pytest.raises(UserError, match=r"measures\.cylinders\.nmac"):
        file.parse(plain_ | {"measures": {"cylinders": {"nmac": [1.0]}}}, "c.toml")
    with pytest.raises(UserError, match="begins names of columns"):
        file.parse(plain_ | {"measures": {"cylinders": {"N-1": [1.0, 1.0]}}}, "c.toml")
