"""The command line as a user meets it: results, help, and one line for every mistake."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

SHORT = ["--set", "duration_s=0.1"]


def test_run_prints_the_scorecard_and_writes_the_run(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("run", "paper-2-turn", "--out", tmp_path / "r", *SHORT) == 0
    out = capsys.readouterr().out
    assert "separation" in out and "safe-set" in out and str(tmp_path / "r") in out.replace("\n", "")
    assert (tmp_path / "r" / "manifest.json").is_file()
    assert max(len(line) for line in out.splitlines() if "run folder" not in line) <= 80


def test_run_as_json_is_json_alone(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("run", "paper-2-turn", "--json", "--out", tmp_path / "r", *SHORT) == 0
    result = json.loads(capsys.readouterr().out)
    assert {g["id"] for g in result["guarantees"]} >= {"separation", "safe-set", "qp-feasibility", "goal"}


def test_compare_draws_the_plants_together(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "c"
    assert call("compare", "paper-2-turn", "--out", out, *SHORT) == 0
    text = capsys.readouterr().out
    assert "unicycle" in text and "jsbsim" in text
    for figure in ("panels", "aircraft"):
        for kind in ("png", "pdf"):
            assert (out / "figures" / f"{figure}.{kind}").stat().st_size > 10_000
    summary = json.loads((out / "comparison.json").read_text())
    assert set(summary) == {"unicycle", "jsbsim"}
    assert (out / "jsbsim" / "manifest.json").is_file()


def test_list_names_every_built_in_scenario(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("list", "--json") == 0
    rows = json.loads(capsys.readouterr().out)
    assert "paper-2-turn" in rows and all(rows.values())


def test_schema_is_a_json_schema(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert call("schema") == 0
    assert json.loads(capsys.readouterr().out)["properties"]["d_safe_m"]["exclusiveMinimum"] == 0


MISTAKES = {
    ("run", "paper-2-tern"): "unknown scenario 'paper-2-tern'; did you mean paper-2-turn",
    ("run", "paper-2-turn", "--plant", "glider"): "plant: input should be 'unicycle'",
    ("run", "paper-2-turn", "--set", "d_safe=5"): "unknown field; did you mean d_safe_m",
    ("run", "paper-2-turn", "--set", "airframes=['x9']", "--plant", "jsbsim"): "x9",
    ("run", "paper-2-turn", "--seed", "-1"): "seed: input should be greater than or equal to 0",
    ("run", "paper-2-straight", "--set", "course_offset_deg=0"): "--force",
    ("run", "paper-2-straight", "--set", "speed_step=0"): "equal straight speeds",
    ("compare", "paper-2-turn", "--plants", "unicycle,glider"): "there is no plant 'glider'",
    ("compare", "paper-2-turn", "--plants", ","): "name at least one plant",
    ("compare", "paper-2-turn", "--seeds", "3"): "only --ladder flies several",
    ("compare", "paper-2-turn", "--ladder", "--plants", "unicycle"): "the ladder's rungs have their own",
    ("compare", "paper-2-turn", "--ladder", "--seed", "3"): "say how many with --seeds",
    ("compare", "paper-2-turn", "--ladder", "--no-report"): "the ladder has neither",
    ("verify", "nowhere"): "nowhere holds no finished run (no manifest.json)",
    ("run", "paper-2-turn", "--set", "airframes=x8"): "airframes: write a list, such as airframes=['x8']",
}


@pytest.mark.parametrize("arguments", MISTAKES, ids=" ".join)
def test_a_mistake_is_one_line_and_leaves_nothing(
    arguments: tuple[str, ...], refusal: Callable[..., str]
) -> None:
    lines = [line for line in refusal(*arguments).splitlines() if not line.startswith("flying")]
    assert len(lines) == 1 and lines[0].startswith("error: ")
    assert MISTAKES[arguments] in lines[0]


def test_an_unwritable_folder_is_one_line(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("")
    assert call("run", "paper-2-turn", "--out", tmp_path / "file" / "r", *SHORT) == 2
    assert "cannot write below" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["run", "compare", "list", "schema"])
def test_every_command_has_help_with_an_example(
    command: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(command, "--help") == 0
    said = capsys.readouterr().out
    assert f"Example: testbed {command}" in said or f"Examples: testbed {command}" in said


def test_the_installed_command_works_from_anywhere(tmp_path: Path) -> None:
    program = Path(sys.executable).parent / "testbed"
    done = subprocess.run([program, "list"], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert "paper-20-turn" in done.stdout
    assert "\x1b" not in done.stdout
