"""Airframe folders, gains and campaign files from a fuzzer: taken, or refused in one line with the field."""

from __future__ import annotations

import json
import shutil
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from aircraft import airframe
from aircraft.airframes.files import read_folder
from aircraft.airframes.safety import dangers
from aircraft.check.rules import RULES
from testbed.campaigns import file, plan
from testbed.campaigns.bases import Base, bases
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario
from tests.fuzzing import cases, change, damaged, document, no_hang

X8 = airframe.AIRFRAMES / "x8"
KINDS = ["plausible", "number", "remove", "add", "rename", "nest", "junk", "junk"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    copy = tmp_path_factory.mktemp("fuzz") / "x8"
    shutil.copytree(X8, copy)
    return copy


def mutants(text: str) -> st.SearchStrategy[tuple[str, tuple[Any, ...]]]:
    @st.composite
    def mutant(draw: st.DrawFn) -> tuple[str, tuple[Any, ...]]:
        tables: dict[str, Any] = json.loads(json.dumps(tomllib.loads(text)))
        path = change(draw, tables, KINDS, ["x8", "rascal", "unicycle", "none", "ap/on"])
        return document(tables), path

    return mutant()


def one_line(said: str, path: tuple[Any, ...] = ()) -> None:
    assert said and "\n" not in str(UserError(said)) and len(said) < 3000
    if path and "not valid TOML" not in said:
        named = [str(p) for p in path if isinstance(p, str)]
        assert any(n[:20] in said for n in named), (said, path)


def load(folder: Path, path: tuple[Any, ...] = ()) -> None:
    """Load the folder as a run would; whatever it answers is one line."""
    with no_hang():
        try:
            found = airframe.load(folder)
            assert all(abs(v) <= 1e9 for v in found.gain_values().values())
        except (ValueError, FileNotFoundError) as error:
            one_line(str(error), path)


@given(mutants((X8 / "airframe.toml").read_text()))
@cases(100)
def test_one_change_to_an_airframe_is_taken_or_named(
    folder: Path, mutant: tuple[str, tuple[Any, ...]]
) -> None:
    text, path = mutant
    (folder / "airframe.toml").write_text(text, encoding="utf-8")
    # a model of another name is missing, and said to be
    load(folder, path if path[0] not in ("model", "name") else ())
    shutil.copy(X8 / "airframe.toml", folder)


@pytest.mark.parametrize("name", ["x8.xml", "engine/motor.xml"])
def test_bytes_of_a_model_are_linted_or_refused(folder: Path, name: str) -> None:
    """Text rules only: flying what they let pass is done in a process of its own."""

    @given(damaged((X8 / name).read_bytes()))
    @cases(60)
    def check(content: bytes) -> None:
        (folder / name).write_bytes(content)
        with no_hang():
            findings = list(dangers(folder))
            files, _ = read_folder(folder)
            if not findings and files is not None:
                findings = [found for rule in RULES for found in rule(files)]
        for found in findings:
            one_line(str(found))

    check()
    shutil.copy(X8 / name, folder / name)


def test_a_field_that_nobody_knows_is_named_before_the_one_that_is_missing(folder: Path) -> None:
    text = (X8 / "airframe.toml").read_text()
    (folder / "airframe.toml").write_text(text.replace("name =", "names =", 1))
    with pytest.raises(ValueError, match="names: unknown field"):
        airframe.load(folder)
    shutil.copy(X8 / "airframe.toml", folder)


GAINS = 'base = "x8"\n[provenance]\nby = "hand"\n[gains.turn]\ndamping = 1.1\nbandwidth_radps = 9.0\n'


@given(mutants(GAINS))
@cases(40)
def test_one_change_to_a_gains_file_is_taken_or_named(
    folder: Path, mutant: tuple[str, tuple[Any, ...]]
) -> None:
    path = folder.parent / "gains.toml"
    path.write_text(mutant[0], encoding="utf-8")
    load(path)


def test_numbers_of_hundreds_of_digits_are_refused_in_one_short_line(folder: Path) -> None:
    path = folder.parent / "gains.toml"
    path.write_text(GAINS.replace("9.0", "1" + 400 * "0"))
    with pytest.raises(ValueError, match=r"turn.bandwidth_radps: must be a finite number, got 1000"):
        airframe.load(path)
    path = folder.parent / "campaign.toml"
    path.write_text(CAMPAIGN.replace("[4.0, 5.0]", f"[[1{3000 * '0'}], 5.0]"))
    with pytest.raises(UserError, match="d_safe_m") as refused:
        plan.expand(*reversed(plan_of(path)))
    assert len(str(refused.value)) < 400
    path.write_text(CAMPAIGN.replace("[1.0, 0.1]", "1" + 3000 * "0"))
    with pytest.raises(UserError, match="normal: write a list") as refused:
        file.load(str(path))
    assert len(str(refused.value)) < 600
    assert len(str(UserError("x" * 10_000))) < 2100


def plan_of(path: Path) -> tuple[list[Base], file.Campaign]:
    campaign, here = file.load(str(path))
    return bases(campaign, here), campaign


BASE = Scenario.model_validate({"name": "b", "vehicles": 2})
CAMPAIGN = """
name = "c"
scenario = "paper-2-turn"
seeds = 3
plants = ["unicycle", "lagged"]
[set]
"start.radius_m" = 100.0
[grid]
d_safe_m = [4.0, 5.0]
[random]
"start.course_offset_deg" = {uniform = [-1.0, 1.0]}
"start.lateral_perturbation_m" = {normal = [1.0, 0.1], low = 0.0}
[stop]
looks = [1, 3]
target = 0.1
"""


@given(mutants(CAMPAIGN))
@cases(80)
def test_one_change_to_a_campaign_is_planned_or_refused(
    folder: Path, mutant: tuple[str, tuple[Any, ...]]
) -> None:
    path = folder.parent / "campaign.toml"
    path.write_text(mutant[0], encoding="utf-8")
    with no_hang():
        try:
            campaign, here = file.load(str(path))
            if len(campaign.seed_list) <= 100:
                plan.expand(campaign, bases(campaign, here))
        except UserError as error:
            one_line(str(error))


@given(damaged(CAMPAIGN.encode()))
@cases(40)
def test_bytes_are_a_campaign_or_refused(folder: Path, content: bytes) -> None:
    path = folder.parent / "campaign.toml"
    path.write_bytes(content)
    with no_hang():
        try:
            file.load(str(path))
        except UserError as error:
            one_line(str(error))
