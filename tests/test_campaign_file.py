"""Campaign files: what they mean, and one line for everything that can be wrong with them."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from testbed.campaigns import file, view
from testbed.campaigns.bases import bases
from testbed.campaigns.distinct import counted, distinct_results
from testbed.campaigns.draw import draw
from testbed.campaigns.file import GUARANTEES, Campaign, Distribution
from testbed.campaigns.identity import ROOT, code_id, content_id, modules
from testbed.campaigns.plan import Plan, expand
from testbed.claims import registry
from testbed.scenario import scenario
from testbed.scenario.randomness import random_fields
from testbed.scenario.scenario import Scenario, load
from testbed.simulation.simulate import run

BASE = {"name": "c", "scenario": "paper-2-turn", "seeds": 3}


def plan(**fields: object) -> Plan:
    campaign = Campaign.model_validate(BASE | fields)
    return expand(campaign, bases(campaign, Path()))


def test_cells_are_the_product_of_the_axes_and_all_fly_the_same_seeds() -> None:
    made = plan(
        plants=["unicycle", "jsbsim"],
        grid={"lookahead_m": [1, 10]},
        variants={"calm": {}, "windy": {"wind.speed_mps": 5, "gusts.intensity": "light"}},
        remedies=["none", "buffer 1 m"],
        first_seed=7,
    )
    assert len(made.cells) == 16 and len(made.runs) == 48
    assert [r.seed for r in made.of(5)] == [7, 8, 9]
    last = made.data(made.runs[-1])
    assert made.cells[-1].label == "plant jsbsim, variant windy, guidance.lookahead_m 10, remedy buffer 1 m"
    assert (last["plant"], last["guidance"]["lookahead_m"], last["seed"]) == ("jsbsim", 10.0, 9)
    assert (last["wind"]["speed_mps"], last["remedy"]["ds_buffer_m"]) == (5.0, 1.0)


def test_a_run_is_named_by_its_content() -> None:
    ids = [r.id for r in plan(grid={"d_safe_m": [5, 6]}).runs]
    assert len(set(ids)) == 6
    assert [r.id for r in plan(set={"d_safe_m": 6}).runs] == ids[3:]
    assert [r.id for r in plan(set={"d_safe_m": 6}, first_seed=2).runs][:2] == ids[4:]
    # Names and numbers of campaigns are no part of a run.
    assert [r.id for r in plan(name="d", grid={"d_safe_m": [5]}).runs] == ids[:3]
    assert expand(plan().campaign, plan().bases, "other code").runs[0].id != plan().runs[0].id
    assert content_id({"a": 1, "b": 2}) == content_id({"b": 2, "a": 1})


def test_the_code_a_run_depends_on_is_all_that_flies_and_nothing_that_draws() -> None:
    names = {str(f.relative_to(ROOT)) for f in modules()}
    assert {
        "aircraft/jsbsim/fdm.py",
        "filters/qp/single.py",
        "filters/barriers/closed_form.py",
        "testbed/environment/gusts.py",
    } <= names
    assert not any(
        n.startswith(f"testbed/{of}/") for n in names for of in ("cli", "report", "campaigns", "studies")
    )
    assert code_id() == code_id() and len(code_id()) == 16


def test_draws_belong_to_seed_and_field_alone() -> None:
    wind = {"wind.speed_mps": {"uniform": [0, 5]}}
    more = wind | {"d_safe_m": {"uniform": [4, 6]}}
    few, many = plan(random=wind), plan(random=more, plants=["unicycle", "lagged"])
    speeds = [r.draws["wind.speed_mps"] for r in few.runs]
    assert [r.draws["wind.speed_mps"] for r in many.runs] == speeds * 2 and len(set(speeds)) == 3
    data = few.data(few.runs[0])
    assert data["wind"]["speed_mps"] == speeds[0] and data["seed"] == 1


@pytest.mark.parametrize(
    ("distribution", "mean", "deviation", "low", "high"),
    [
        ({"uniform": [2, 6]}, 4, 4 / 12**0.5, 2, 6),
        ({"normal": [3, 2]}, 3, 2, -np.inf, np.inf),
        # Half a normal distribution: mean sqrt(2 / pi), variance 1 - 2 / pi.
        ({"normal": [0, 1], "low": 0}, (2 / np.pi) ** 0.5, (1 - 2 / np.pi) ** 0.5, 0, np.inf),
        ({"loguniform": [1, np.e]}, np.e - 1, ((np.e**2 - 1) / 2 - (np.e - 1) ** 2) ** 0.5, 1, np.e),
        ({"integers": [1, 6]}, 3.5, (35 / 12) ** 0.5, 1, 6),
        ({"choice": [0, 10]}, 5, 5, 0, 10),
    ],
)
def test_draws_follow_their_distribution(
    distribution: dict[str, object], mean: float, deviation: float, low: float, high: float
) -> None:
    d = Distribution.model_validate(distribution)
    seen = np.array([draw(d, seed, "x") for seed in range(2000)])
    assert low <= seen.min() and seen.max() <= high
    # 4 standard errors.
    assert seen.mean() == pytest.approx(mean, abs=4 * deviation / 2000**0.5)
    assert seen.std() == pytest.approx(deviation, rel=0.1)


@pytest.mark.parametrize("name", file.builtin())
def test_the_campaigns_that_come_with_the_package_resolve(name: str) -> None:
    campaign, here = file.load(name)
    made = expand(campaign, bases(campaign, here))
    assert campaign.name == name and campaign.description
    assert len({r.id for r in made.runs}) == len(made.runs) >= 10
    assert file.load(f"{name}.toml")[0] == campaign


def test_every_guarantee_that_can_be_counted_is_one_that_runs_have() -> None:
    from testbed.simulation.simulate import run

    done = run(scenario.load("paper-2-turn", ["duration_s=0.05"]))
    # Those of a filter that declares a barrier, of fences and of longer runs are there only with them.
    rare = (*registry.OWN, *registry.FENCES, *registry.INTRUDERS, *registry.LIVENESS)
    only = {claim.id for claim in rare}
    assert set(GUARANTEES) - only <= {g["id"] for g in done.guarantees}


def test_a_scenario_file_is_meant_from_the_campaign_files_folder(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.toml").write_text('name = "mine"\nvehicles = 3\n')
    (tmp_path / "c.toml").write_text(
        'name = "c"\nscenario = "mine.toml"\nseeds = 4\n[set]\nheading_perturbation_deg = 5\n'
    )
    assert call("campaign", "check", tmp_path / "c.toml") == 0
    assert "c: 4 runs, 1 cells x 4 seeds" in capsys.readouterr().out


MISTAKES = {
    "name = ": "not valid TOML",
    'seed = 3\nname = "c"\nscenario = "paper-2-turn"': "seed: unknown field; did you mean seeds",
    'name = "c"\nscenario = "paper-2-turn"': "seeds: say how many",
    'name = "c"\nseeds = 3': "scenario: field required, or encounters",
    'name = "c"\nscenario = "paper-2-tern"\nseeds = 3': "did you mean",
    'name = "c"\nscenario = "paper-2-turn"\nencounters = "x"': "scenario: leave it out, or encounters",
    'name = "c"\nencounters = "nowhere"': "encounters nowhere: nowhere has no scenario file",
    'name = "c"\nencounters = "x"\nstop = {looks = [5, 9], target = 0.1}': "encounters are flown all",
    "seeds = 0": "seeds: input should be greater than or equal to 1, got 0",
    'seeds = "many"': "seeds: input should be a valid integer",
    'plants = ["glider"]': "c: plants: there is no plant 'glider'; there is unicycle",
    'plants = ["jsbsim", "jsbsim"]': "plants: 'jsbsim' is listed twice",
    'plants = ["jsbsim"]\nset.airframes = ["x9"]': "airframes: no airframe x9",
    'remedies = ["bufer 1 m"]': "did you mean buffer 1 m",
    'remedies = ["buffer 1 m"]\ngrid."remedy.ds_buffer_m" = [1]': "remedy.ds_buffer_m is set by remedy",
    'guarantee = "seperation"': "guarantee: input should be 'separation'",
    "set.seed = 3": "set.seed: say seeds and first_seed",
    "set.d_safe = 3": "set.d_safe: unknown field; did you mean d_safe_m",
    "set.d_safe_m = -3": "d_safe_m: input should be greater than 0",
    'grid.d_safe_m = ["wide"]': "d_safe_m wide: d_safe_m: input should be a valid number",
    "grid.d_safe_m = []": "grid.d_safe_m: list should have at least 1 item",
    "grid.d_safe_m = [5, 5.0]": "grid.d_safe_m: a value is listed twice",
    'plants = ["jsbsim"]\ngrid.plant = ["unicycle"]': "grid.plant: plant is an axis already",
    "grid.d_safe_m = [5]\nrandom.d_safe_m.uniform = [4, 6]": "d_safe_m: set by both d_safe_m and random",
    "random.d_safe_m.uniform = [6, 4]": "random.d_safe_m: uniform: 6 is above 4",
    "random.d_safe_m.uniforn = [4, 6]": "random.d_safe_m.uniforn: unknown field; did you mean uniform",
    "random.d_safe_m.low = 4": "say one of uniform, loguniform, normal, integers, choice",
    "random.d_safe_m = {uniform = [4, 6], normal = [5, 1]}": "not uniform and normal",
    "random.d_safe_m.normal = [0, 1]": ", seed",
    "stop = {looks = [20, 10], target = 0.1}": "stop: looks [20, 10]: give increasing",
    "stop = {looks = [10, 20], target = 0.1}\nseeds = 30": "but the last of stop.looks is 20",
    "stop = {looks = [10, 20]}": "stop.target: field required",
    "seeds = 600000\nplants = ['unicycle', 'jsbsim']": "1200000 runs are more than 1000000",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_is_one_line_and_leaves_nothing(
    text: str, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "c.toml"
    whole = "name" in text
    seeds = "" if "seeds = " in text or "looks" in text else "seeds = 3\n"
    path.write_text(text if whole else f'name = "c"\nscenario = "paper-2-turn"\n{seeds}{text}\n')
    assert call("campaign", "run", path, "--out", tmp_path / "out") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and lines[0].startswith("error: ") and MISTAKES[text] in lines[0], lines
    assert list(tmp_path.iterdir()) == [path]


COMMANDS = {
    ("run", "head-on-x9", "--out", "o"): "unknown campaign 'head-on-x9'; did you mean head-on-x8",
    ("run", "none.toml", "--out", "o"): "campaign file none.toml does not exist",
    ("run", "head-on-x8", "--out", "o", "--workers", "0"): "--workers 0: give at least 1",
    ("run", "head-on-x8", "--out", "o", "--workers", "2", "--cluster", "tcp://a:1"): "give one of the two",
    ("status", "o"): "o holds no campaign",
    ("resume", "o"): "o holds no campaign",
}


@pytest.mark.parametrize("arguments", COMMANDS, ids=" ".join)
def test_a_mistaken_command_is_one_line_and_leaves_nothing(
    arguments: tuple[str, ...],
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert call("campaign", *arguments) == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and COMMANDS[arguments] in lines[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command", ["run", "resume", "status", "check", "list", "schema"])
def test_every_command_has_help_with_an_example(
    command: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("campaign", command, "--help") == 0
    text = capsys.readouterr().out
    assert "Example" in text and f": testbed campaign {command}" in text


def test_the_schema_of_campaign_files_is_a_json_schema(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("campaign", "schema") == 0
    assert json.loads(capsys.readouterr().out)["properties"]["seeds"]["description"]


def test_the_view_says_done_failed_running_the_rate_with_its_interval_and_the_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [100.0]
    monkeypatch.setattr(view.time, "monotonic", lambda: now[0])
    asked = SimpleNamespace(name="c", guarantee="separation")
    rows = {
        verdict: {"status": status, "guarantees": {"separation": [5.0, verdict]}}
        for verdict, status in (("holds", "flown"), ("violated", "flown"), ("not applicable", "failed"))
    }
    state = SimpleNamespace(plan=SimpleNamespace(campaign=asked), entries={"a": {"row": rows["holds"]}})
    shown = view.View()
    with shown.showing(state, 12, SimpleNamespace(workers=2)):
        for verdict in ("holds", "violated", "not applicable"):
            now[0] += 10.0
            shown.done(rows[verdict])
        # One was there before: three took 30 s, eight are left. 2 of 4 lost: [6.8, 93.2] by the binomial.
        assert str(shown) == (
            "4 of 12 done, 1 failed, 2 running, separation lost in 50.0 % [6.8, 93.2], 1 min 20 s left"
        )
    said = capsys.readouterr().err.splitlines()
    assert said[0] == "c: 1 of 12 done, 0 failed" and said[-1] == "c: 4 of 12 done, 1 failed"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seeds = 40", "c: 40 seeds, nothing random: add [random], or seeds = 1"),
        ("seeds = 2\n[random]\nd_safe_m = { choice = [5] }", "c: 2 seeds, nothing random"),
        ("seeds = 2\n[set]\nloss = 1.0", "c: 2 seeds, nothing random"),
        (
            "[stop]\nlooks = [5, 10]\ntarget = 0.1",
            "nothing random: add [random], or looks = [1]",
        ),
        (
            "seeds = 3\nplants = ['lagged']\n[grid]\n'gusts.intensity' = ['light', 'none']",
            "c, gusts.intensity none: 3 seeds, nothing random",
        ),
    ],
)
def test_seeds_that_change_nothing_are_refused_before_anything_is_flown(
    text: str, said: str, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "c.toml").write_text(f'name = "c"\nscenario = "paper-2-turn"\n{text}\n')
    for command in (("check",), ("run", "--out", tmp_path / "out")):
        assert call("campaign", command[0], tmp_path / "c.toml", *command[1:]) == 2
        assert said in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    "setting",
    [
        "lateral_perturbation_m=1",
        "height_perturbation_m=1",
        "position_bias_m=0.1",
        "course_drift_deg=1",
        "loss=0.5",
        "gusts.sigma_mps=1",
        "gusts.intensity='light'",
    ],
)
def test_a_seed_that_changes_a_run_is_known_to(setting: str) -> None:
    """Each field said to be random makes two seeds two runs; without it they are one."""
    settings = ["duration_s=0.2", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]
    settings += ["plant=lagged", "radius_m=40"]
    bare, random = (load("paper-2-turn", [*settings, *more]) for more in ([], [setting]))
    assert not random_fields(bare) and len(random_fields(random)) == 1

    def positions(s: Scenario, seed: int) -> list[float]:
        done = run(s.model_copy(update={"seed": seed}))
        table = done.vehicles
        return [*table.x_m, *table.y_m, *table.z_m, *table.v_command_mps, *table.omega_command_radps]

    assert positions(bare, 1) == positions(bare, 2)
    assert positions(random, 1) != positions(random, 2)


def test_distinct_results_are_counted_not_ids() -> None:
    rows = [{"seed": k, "value": v} for k, v in enumerate((1.0, 1.0, float("nan"), 2.0, float("nan")))]
    assert distinct_results(rows) == 3 and distinct_results(rows, without=()) == 5
    assert counted(5, 3) == "5 runs, only 3 distinct: intervals and tests take them for 5 independent ones"
    assert counted(5, 5) == "5 runs, all distinct"


@pytest.mark.parametrize("axis", ["variants", "grid"])
def test_airframes_of_an_axis_are_found_beside_the_campaign_file(
    axis: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "campaigns"
    folder.mkdir()
    (folder / "slow.toml").write_text('base = "x8"\n[gains.turn]\nbandwidth_radps = 3.6\n')
    lines = {
        "variants": '[variants.a]\nairframes = ["slow.toml"]',
        "grid": '[grid]\nairframes = [["slow.toml"]]',
    }
    head = 'name = "slow"\nscenario = "paper-2-turn"\nseeds = 2\nplants = ["jsbsim"]\n'
    (folder / "slow-turn.toml").write_text(
        f"{head}[set]\n'start.lateral_perturbation_m' = 5\n{lines[axis]}\n"
    )
    monkeypatch.chdir(tmp_path)
    campaign, here = file.load("campaigns/slow-turn.toml")
    made = expand(campaign, bases(campaign, here))
    assert Path(made.varied(made.cells[0], 0)["airframes_folder"]) == folder.resolve()
