"""Campaigns fly folders of encounter files: each once, the same in every cell, ids of their content."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pandas as pd
import pytest

from testbed.campaigns.bases import bases
from testbed.campaigns.distinct import check_distinct
from testbed.campaigns.file import load
from testbed.campaigns.plan import Plan, expand
from testbed.campaigns.processes import Processes
from testbed.campaigns.runner import fly_all, prepare, reopen
from testbed.campaigns.view import View
from testbed.encounters.generating import generate
from testbed.encounters.scenarios import Choices
from testbed.encounters.writing import write
from testbed.errors import UserError

CAMPAIGN = """
name = "met"
plants = ["unicycle", "lagged"]
[encounters]
crossing = "crossing"
meeting = "head-on/*.toml"
[set]
duration_s = 0.2
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("met")
    for kind, count in (("crossing", 3), ("head-on", 2)):
        write(generate(kind, 7, count), Choices("filter", "goal", matched=False), place / kind, "")
    (place / "met.toml").write_text(CAMPAIGN)
    return place


def planned(file: Path) -> Plan:
    campaign, here = load(str(file))
    return expand(campaign, bases(campaign, here), "code")


def test_every_cell_flies_the_files_of_its_set_each_from_a_seed_of_its_own(folder: Path) -> None:
    made = planned(folder / "met.toml")
    said = [(c.parameters["encounters"], c.parameters["plant"], len(made.of(c.number))) for c in made.cells]
    assert said == [
        (name, plant, n) for name, n in (("crossing", 3), ("meeting", 2)) for plant in ("unicycle", "lagged")
    ]
    assert len({r.id for r in made.runs}) == len(made.runs) == 10
    seeds = [[r.seed for r in made.of(k)] for k in range(4)]
    assert seeds[0] == seeds[1] and seeds[2] == seeds[3] and len({*seeds[0], *seeds[2]}) == 5
    check_distinct(made)


def test_a_file_more_and_another_place_leave_the_other_runs_as_they_are(folder: Path, tmp_path: Path) -> None:
    choices = Choices("filter", "goal", matched=False)
    for kind, count in (("crossing", 4), ("head-on", 2)):
        write(generate(kind, 7, count), choices, tmp_path / kind, "")
    # Comes first among the files.
    (tmp_path / "crossing" / "a.toml").write_text((tmp_path / "crossing" / "crossing-0004.toml").read_text())
    (tmp_path / "met.toml").write_text(CAMPAIGN)
    before, after = planned(folder / "met.toml"), planned(tmp_path / "met.toml")
    assert {r.id for r in before.runs} < {r.id for r in after.runs}


def test_it_goes_on_when_the_files_are_gone_and_the_table_names_them(folder: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    plan = prepare(str(folder / "met.toml"), out)
    found = json.loads((out / "campaign.json").read_text())["encounters"]
    files = [folder / ("crossing" if e["set"] == "crossing" else "head-on") / e["file"] for e in found]
    assert [e["sha256"] for e in found] == [hashlib.sha256(f.read_bytes()).hexdigest() for f in files]
    again = reopen(out)
    assert again.id == plan.id and [r.id for r in again.runs] == [r.id for r in plan.runs]
    with Processes(1) as pool:
        assert fly_all(again, out, pool, View()).complete
    runs = pd.read_parquet(out / "runs.parquet")
    assert runs.file.tolist()[:3] == ["crossing-0001.toml", "crossing-0002.toml", "crossing-0003.toml"]
    assert runs.encounters.tolist() == ["crossing"] * 6 + ["meeting"] * 4
    cells = json.loads((out / "summary.json").read_text())["cells"]
    # Plants are compared on the same encounters, and sets with nothing.
    assert [c["against_first"] is not None for c in cells] == [False, True, False, True]
    assert [c["runs"] for c in cells] == [3, 3, 2, 2]


def test_seeds_of_an_encounter_need_something_random(folder: Path) -> None:
    file = folder / "seeds.toml"
    file.write_text('name = "s"\nseeds = 2\nencounters = "head-on"\n')
    made = planned(file)
    assert [r.base for r in made.runs] == [0, 0, 1, 1] and made.cells[0].parameters == {
        "encounters": "head-on"
    }
    with pytest.raises(UserError, match="2 seeds, nothing random"):
        check_distinct(made)
    file.write_text('name = "s"\nencounters = "head-on"\nset."sensing.position_noise_m" = 1\nseeds = 2\n')
    check_distinct(planned(file))
