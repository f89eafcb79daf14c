"""[guidance] was called [nominal], and its `kind` `controller`: the older spelling is read everywhere."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import testbed
from testbed.campaigns import plan
from testbed.campaigns.bases import bases
from testbed.campaigns.file import Campaign
from testbed.errors import UserError
from testbed.report.settings import changed as settings_changed
from testbed.scenario.scenario import Scenario, load, parse
from testbed.scenario.variants import changed
from testbed.simulation.refly import refly
from testbed.verification.check import verify
from tests.forgery import seal

NEW = '[guidance]\nkind = "near-identity"\nlookahead_m = 10\ndelay_steps = 2\n'
OLD = NEW.replace("guidance", "nominal").replace("kind", "controller")


def file(folder: Path, table: str) -> Path:
    made = folder / "own.toml"
    made.write_text(f'name = "own"\nvehicles = 2\n{table}')
    return made


def older(s: Scenario) -> dict[str, object]:
    """A scenario's plain data as an earlier version dumped it."""
    data = s.model_dump(mode="json")
    table = data.pop("guidance")
    return data | {"nominal": {"controller": table.pop("kind")} | table}


def test_a_file_says_the_same_in_both_spellings(tmp_path: Path) -> None:
    s = load(file(tmp_path, OLD))
    assert s == load(file(tmp_path, NEW)) and s.nominal is s.guidance
    assert (s.guidance.kind, s.guidance.lookahead_m) == ("near-identity", 10.0)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("nominal.lookahead_m=5", "guidance.lookahead_m=5"),
        ("nominal.controller=manoeuvre", "guidance.kind=manoeuvre"),
        ("controller=manoeuvre", "guidance.kind=manoeuvre"),
        ('nominal={controller="manoeuvre", delay_steps=3}', 'guidance={kind="manoeuvre", delay_steps=3}'),
    ],
)
def test_an_override_says_the_same_in_both_spellings(old: str, new: str) -> None:
    assert load("paper-2-turn", [old]) == load("paper-2-turn", [new]) != load("paper-2-turn")
    # One of them may change what a file says in the other spelling.
    assert load("published-2-turn", [old]) == load("published-2-turn", [new])


def test_the_program_changes_fields_by_either_name() -> None:
    s = load("paper-2-turn")
    assert changed(s, {"nominal.lookahead_m": 4.0}) == changed(s, {"guidance.lookahead_m": 4.0}) != s


def test_a_campaigns_axes_and_set_take_both_and_mean_the_same_runs() -> None:
    def ids(name: str) -> tuple[list[str], list[str]]:
        campaign = Campaign(
            name="c", scenario="paper-2-turn", seeds=2, set={f"{name}.delay_steps": 1},
            grid={f"{name}.lookahead_m": [1, 10]},
        )  # fmt: skip
        made = plan.expand(campaign, bases(campaign, Path()))
        return [r.id for r in made.runs], list(made.cells[0].parameters)

    assert ids("nominal") == ids("guidance")
    assert ids("nominal")[1] == ["guidance.lookahead_m"]


def test_plain_data_of_either_spelling_is_the_same_scenario() -> None:
    s = load("paper-2-turn", ["lookahead_m=3"])
    assert parse(older(s)) == s
    assert parse(older(s) | {"schema_version": 1}) == s
    assert settings_changed({"a": older(s)}) == settings_changed({"a": s.model_dump(mode="json")})


def test_a_run_folder_of_the_older_spelling_is_loaded_verified_and_flown_again(tmp_path: Path) -> None:
    s = load("paper-2-turn", ["duration_s=0.5", "manoeuvre_instants=0", "lookahead_m=2", "delay_steps=2"])
    testbed.run(s, tmp_path / "r")
    manifest = tmp_path / "r" / "manifest.json"
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"scenario": older(s)}))
    seal(tmp_path / "r")
    assert "nominal" in testbed.load(tmp_path / "r").manifest["scenario"]
    assert [f.what for f in verify(tmp_path / "r") if f.agrees is False] == []
    assert [f.what for f in refly(tmp_path / "r") if f.agrees is False] == []
    # What it says is read, not skipped.
    wrong = older(changed(s, {"guidance.gain_per_s": 0.2}))
    manifest.write_text(json.dumps(json.loads(manifest.read_text()) | {"scenario": wrong}))
    seal(tmp_path / "r")
    assert "nominal" in [f.what for f in verify(tmp_path / "r") if f.agrees is False]


def test_both_names_at_once_and_a_wrong_value_are_one_line_with_its_line(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"own.toml: nominal: is the older name of guidance, which is there"):
        load(file(tmp_path, NEW + OLD))
    with pytest.raises(UserError, match=r"guidance.lookahead_m: input should be greater .* \(line 5\)"):
        load(file(tmp_path, OLD.replace("= 10", "= -1")))
    with pytest.raises(UserError, match=r"guidance.kind: input should be 'near-identity'.* \(line 4\)"):
        load(file(tmp_path, OLD.replace("near-identity", "far-identity")))
