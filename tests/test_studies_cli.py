"""The studies' commands, small: what they write, and one line for every mistake."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from testbed.campaigns.job import Job
from testbed.studies.answer.answer import table
from testbed.studies.common.measure import measure

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


@pytest.mark.parametrize("stopped_after", [1, 3])
def test_an_answer_that_was_stopped_goes_on_and_ends_with_the_same_bytes(
    tmp_path: Path, call: Callable[..., int], monkeypatch: pytest.MonkeyPatch, stopped_after: int
) -> None:
    asked = ["answer", "--airframes", "x8", "--weather", "calm", "--only", "none", "--only", "lags, +0.5 m"]
    asked += ["--seeds", "2", "--first-seed", "1001", "--workers", "1", "--set", "duration_s=0.1"]
    assert call(*asked, "--out", tmp_path / "whole") == 0
    flown = []

    def stopping(job: Job) -> dict[str, object]:
        if len(flown) == stopped_after:
            raise KeyboardInterrupt
        flown.append(job.seed)
        return measure(job)

    stopping.__module__ = measure.__module__
    monkeypatch.setattr("testbed.studies.answer.answer.measure", stopping)
    assert call(*asked, "--out", tmp_path / "parts") != 0
    monkeypatch.undo()
    assert call(*asked, "--out", tmp_path / "parts") == 0
    for name in ("runs.csv", "answer.csv", "answer.md", "answer.json"):
        assert (tmp_path / "whole" / name).read_bytes() == (tmp_path / "parts" / name).read_bytes()
    runs = pd.read_csv(tmp_path / "whole" / "runs.csv")
    assert set(runs.seed) == {1001, 1002} and set(runs.remedy) == {"none", "lags, +0.5 m"}
    pd.testing.assert_frame_equal(table(runs), pd.read_csv(tmp_path / "whole" / "answer.csv"))


MISTAKES = {
    ("remedies", "paper-2-turn", "--only", "lags, bufer 1 m"): "did you mean lags, buffer 1 m",
    ("margin", "paper-2-turn", "--knob", "buffer"): "did you mean ds_buffer",
    ("margin", "paper-2-turn", "--knob", "issf", "--target-rate", "0"): "between 0 and 1",
    ("margin", "paper-20-navigation", "--knob", "ds_buffer", "--seeds", "0"): "--seeds 0: give at least 1",
    ("margin", "paper-20-navigation", "--knob", "ds_buffer"): "filter 'navigation' cannot take it",
    ("margin", "paper-2-straight", "--knob", "derate"): "a 'straight' barrier has no turn; try derate_speed",
    ("remedies", "paper-20-navigation"): "filter 'navigation' cannot take it",
    ("answer", "--vehicles", "3"): "--vehicles 3: give 2, 20 or 50",
    ("answer", "--only", "lag, +0.5 m"): "--only 'lag, +0.5 m': unknown; did you mean lags, +0.5 m",
    ("answer", "--guidance", "layer"): "--guidance 'layer': unknown; did you mean layers",
    (
        "answer",
        "--vehicles",
        "2",
        "--missions",
        "random",
    ): "--missions random: nothing to fly; 2 vehicles fly",
    ("answer", "--vehicles", "20", "--fleet-seeds", "0"): "--seeds 0: give at least 1",
    ("answer", "--cells", "0"): "--cells 0: give numbers from 1 to",
    ("answer", "--cells", "7-5"): "--cells 7-5: the last number is below the first",
    ("answer", "--cells", "1", "--vehicles", "2"): "--cells: it chooses among the page's cells",
    ("answer", "--cells", "1", "--add", "nowhere"): "--add nowhere: no folder of `testbed answer`",
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
