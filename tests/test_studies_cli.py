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


@pytest.mark.parametrize("command", ["remedies", "margin", "answer"])
def test_every_study_has_help_with_an_example(
    command: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(command, "--help") == 0
    assert f"Example: testbed {command}" in capsys.readouterr().out
