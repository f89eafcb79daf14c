"""Campaigns over filters and guidance: built-in kinds and names that `--parts` brings, cell by cell."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

import testbed
from testbed.campaigns.folder import journal
from testbed.campaigns.inprocess import InProcess
from testbed.campaigns.plan import Plan
from testbed.campaigns.runner import fly_all, prepare, reopen
from testbed.campaigns.view import View
from testbed.components import named_parts
from tests.test_comparison import PARTS

TEXT = """
name = "axes"
scenario = "paper-2-turn"
seeds = 2
plants = ["unicycle", "lagged"]
filters = ["centralised", "Bold"]
{more}

[set]
duration_s = 0.1
"checks.manoeuvre_instants" = 0
"start.heading_perturbation_deg" = 5
"""


@pytest.fixture
def own(tmp_path: Path) -> Path:
    file = tmp_path / "mine.py"
    file.write_text(PARTS)
    return file


def plan(tmp_path: Path, *parts: str, more: str = "") -> Plan:
    file = tmp_path / "axes.toml"
    file.write_text(TEXT.format(more=more))
    return prepare(str(file), tmp_path / "out", parts=named_parts.read(parts))


def test_a_part_flies_in_the_cells_that_name_it(own: Path, tmp_path: Path) -> None:
    both = 'guidance = ["near-identity", "Ahead"]'
    found = plan(tmp_path, f"{own}:Bold", f"{own}:Ahead", more=both)
    assert len(found.cells) == 8 and len({run.id for run in found.runs}) == 16
    for cell in found.cells:
        names = (cell.parameters["filter.kind"], cell.parameters["guidance.kind"])
        assert set(cell.own) == {name for name in names if name[0].isupper()}
    state = fly_all(found, tmp_path / "out", InProcess(), View())
    assert state.complete
    rows = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    assert set(rows["filter.kind"]) == {"centralised", "Bold"}
    assert set(rows["status"]) == {"flown"}
    # Another filter is another result: the pass-through solves no QP.
    assert set(rows[rows["filter.kind"] == "Bold"].qp_feasibility_verdict) == {"not applicable"}
    assert set(rows[rows["filter.kind"] == "centralised"].qp_feasibility_verdict) == {"holds"}
    again = reopen(tmp_path / "out", to_fly=False)
    assert [c.label for c in again.cells] == [c.label for c in found.cells]
    assert len(journal(tmp_path / "out").entries) == 16


def test_a_part_of_a_role_without_an_axis_flies_in_every_cell(own: Path, tmp_path: Path) -> None:
    found = plan(tmp_path, f"{own}:Bold", f"{own}:Ahead")
    assert all("Ahead" in cell.own for cell in found.cells)
    assert [("Bold" in cell.own) for cell in found.cells] == [False, True, False, True]


@pytest.mark.parametrize(
    ("parts", "more", "says"),
    [
        ([], "", "axes: filters: there is no filter 'Bold'; there is centralised, limited"),
        (["Bold"], 'guidance = ["Ahead"]', "axes: guidance: there is no guidance 'Ahead'"),
        (["Bold", "Ahead"], 'guidance = ["near-identity"]', "--parts Ahead: axes: guidance does not name it"),
        (
            ["Bold(share=2)"],
            "",
            "filters: there is no filter 'Bold'; there is centralised",
        ),
        (["Bold"], 'guidance = ["near-identity", "near-identity"]', "'near-identity' is listed twice"),
        (["Bold"], "guidance = []\nfilter = 3", "filter"),
    ],
)
def test_a_wrong_axis_is_one_clear_line(
    own: Path, tmp_path: Path, parts: list[str], more: str, says: str
) -> None:
    with pytest.raises(testbed.UserError) as refused:
        plan(tmp_path, *(f"{own}:{part}" for part in parts), more=more)
    assert says in str(refused.value) and "\n" not in str(refused.value)


def test_the_command_flies_both_filters_on_two_workers_to_the_same_bytes(
    own: Path, tmp_path: Path, call: Callable[..., int], capsys: Any
) -> None:
    plan(tmp_path, f"{own}:Bold")
    for out, workers in (("a", 2), ("b", 1)):
        arguments = ("--parts", f"{own}:Bold", "--workers", workers)
        assert call("campaign", "run", tmp_path / "axes.toml", "--out", tmp_path / out, *arguments) == 0
    text = capsys.readouterr().out
    assert "Bold" in text
    assert (tmp_path / "a" / "runs.parquet").read_bytes() == (tmp_path / "b" / "runs.parquet").read_bytes()
    assert json.loads((tmp_path / "a" / "campaign.json").read_text())["parts"]["Bold"]["role"] == "filter"
