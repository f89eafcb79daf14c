"""The studies' commands, small: what they write, and one line for every mistake."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

QUICK = ["--set", "duration_s=1", "--seeds", "2", "--workers", "1"]


def test_the_ladder_writes_a_row_per_run_and_an_account(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "l"
    assert call("compare", "paper-2-turn", "--ladder", "--out", out, *QUICK) == 0
    text = capsys.readouterr().out
    assert "6-DOF" in text and "interaction" in text
    table = pd.read_csv(out / "ladder.csv")
    assert set(table.seed) == {1, 2} and {"unicycle", "lags", "6-DOF", "loss"} <= set(table.rung)
    said = json.loads((out / "ladder.json").read_text())
    assert set(said["distance_m"]) == {"total", "interaction"}
    # What made it: the page shows it, too.
    assert len(said["airframes"]["x8"]) == 64 and "jsbsim" in said["versions"]
    assert (out / "ladder.png").stat().st_size > 10_000


def test_remedies_fly_the_seeds_asked_for(tmp_path: Path, call: Callable[..., int]) -> None:
    out = tmp_path / "r"
    chosen = ["--only", "none", "--only", "lags, buffer 1 m", "--first-seed", "7"]
    assert call("remedies", "paper-2-turn", *chosen, "--out", out, *QUICK) == 0
    runs = pd.read_csv(out / "runs.csv")
    assert set(runs.seed) == {7, 8} and list(dict.fromkeys(runs.remedy)) == ["none", "lags, buffer 1 m"]
    table = pd.read_csv(out / "remedies.csv")
    assert table.n.tolist() == [2, 2] and (out / "remedies.png").is_file()


MISTAKES = {
    ("remedies", "paper-2-turn", "--only", "lags, bufer 1 m"): "did you mean lags, buffer 1 m",
    ("margin", "paper-2-turn", "--knob", "buffer"): "did you mean ds_buffer",
    ("margin", "paper-2-turn", "--knob", "issf", "--target-rate", "0"): "between 0 and 1",
    ("margin", "paper-20-navigation", "--knob", "ds_buffer", "--seeds", "0"): "--seeds 0: give at least 1",
    ("margin", "paper-20-navigation", "--knob", "ds_buffer"): "filter 'navigation' cannot take it",
    ("margin", "paper-2-straight", "--knob", "derate"): "a 'straight' barrier has no turn; try derate_speed",
    ("remedies", "paper-20-navigation"): "filter 'navigation' cannot take it",
    ("answer", "--vehicles", "3"): "--vehicles 3: give 2, 20 or 2,20",
}


@pytest.mark.parametrize("arguments", MISTAKES, ids=" ".join)
def test_a_mistake_is_one_line_and_leaves_nothing(
    arguments: tuple[str, ...], refusal: Callable[..., str]
) -> None:
    lines = refusal(*arguments).splitlines()
    assert len(lines) == 1 and MISTAKES[arguments] in lines[0]


STILL = ("--set", "start.heading_perturbation_deg=0")
NOTHING_RANDOM = {
    ("margin", "paper-2-turn", "--knob", "derate", "--seeds", "1"): "a certificate of 299 seeds",
    ("remedies", "paper-2-turn", "--seeds", "4"): "a comparison of 4 seeds",
    ("compare", "paper-2-turn", "--ladder", "--seeds", "4"): "a ladder of 4 seeds",
    ("regress", "record", "still", "--scenario", "paper-2-turn"): "a baseline of",
}


@pytest.mark.parametrize("arguments", NOTHING_RANDOM, ids=" ".join)
def test_seeds_that_change_nothing_are_refused_before_anything_is_flown(
    arguments: tuple[str, ...], refusal: Callable[..., str]
) -> None:
    """Starts that the scenario says are not perturbed are left so, and then every seed flies one run."""
    said = refusal(*arguments, *STILL)
    assert f"paper-2-turn: {NOTHING_RANDOM[arguments]}" in said
    assert "nothing random: every seed gives the same run; perturb the start, for example" in said
    assert "--set start.heading_perturbation_deg=5" in said


def test_one_seed_of_a_run_without_chance_is_flown_and_the_remedy_named_works(
    tmp_path: Path, call: Callable[..., int]
) -> None:
    one = ("remedies", "paper-2-turn", "--plant", "unicycle", "--only", "none", "--workers", "1")
    one += ("--set", "duration_s=0.2")
    assert call(*one, *STILL, "--seeds", "1", "--out", tmp_path / "one") == 0
    perturbed = ("--set", "start.heading_perturbation_deg=5")
    assert call(*one, *perturbed, "--seeds", "2", "--out", tmp_path / "two") == 0
    assert pd.read_csv(tmp_path / "two" / "remedies.csv").distinct.tolist() == [2]


@pytest.mark.parametrize("command", ["remedies", "margin", "answer"])
def test_every_study_has_help_with_an_example(
    command: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(command, "--help") == 0
    assert f"Example: testbed {command}" in capsys.readouterr().out
