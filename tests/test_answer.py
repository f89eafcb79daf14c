"""The answer: cells fly what they say, runs are counted rightly, folders add up, the page is the table."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest

from testbed.campaigns.journal import Journal
from testbed.errors import UserError
from testbed.studies.answer import answer, design
from testbed.studies.answer.cells import COLUMNS, Cell, product, scenario
from testbed.studies.answer.folders import added

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "docs"))
import answer_page  # noqa: E402
import flow_page  # noqa: E402

KEPT = ROOT / "docs/guide/data/answer"


@pytest.mark.parametrize("cell", [block.cells[-1] for block in design.DESIGN], ids=str)
def test_a_cell_of_each_block_flies_what_its_name_says(cell: Cell) -> None:
    s = scenario(cell)
    assert s.vehicles == cell.number and (s.plant == "unicycle") == (cell.vehicle == "unicycle")
    assert s.plant == "unicycle" or s.airframes == [cell.vehicle]
    kinds = {"straight": "near-identity", "evading layers": "layers"}
    assert kinds.get(cell.guidance, cell.guidance) == s.guidance.kind
    assert getattr(s.guidance, "evading", False) == (cell.guidance == "evading layers")
    patterns = {"swap": "circle", "streams": "streams", "random": "random-goals"}
    assert s.start.pattern == patterns[cell.mission]
    assert (s.filter.kind == "flow") == cell.remedy.startswith("flow")
    assert s.remedy.predict_lags == cell.remedy.startswith("lags")
    assert (getattr(s.filter, "cost", "") == "range") == ("range" in cell.remedy or "flow" in cell.remedy)
    assert (s.wind.speed_mps, s.gusts.intensity) == ((5, "light") if cell.weather == "windy" else (0, "none"))
    # The paper's barrier everywhere: a remedy alone smooths it.
    assert (s.barrier.delta_m2, s.barrier.smoothing_m2) == (0.01, 0)
    papers = "limited" if cell.number > 2 else "centralised"
    assert s.filter.kind == ("flow" if cell.remedy.startswith("flow") else papers)


def test_all_combinations_are_those_that_mean_something() -> None:
    axes = {
        "number": [2, 20],
        "mission": ["swap", "random"],
        "vehicle": ["unicycle", "x8"],
        "weather": ["calm", "windy"],
        "remedy": ["none", "flow, +2 m"],
        "guidance": ["straight"],
    }
    made = product(axes)
    assert len(made) == len(set(made)) == 3 * (1 + 4)
    assert not any(c.number == 2 and c.mission == "random" for c in made)
    assert {(c.weather, c.remedy) for c in made if c.vehicle == "unicycle"} == {("calm", "none")}


def test_numbers_choose_cells_and_each_once() -> None:
    listed = list(design.CELLS)
    assert design.chosen("3, 1-3") == [listed[2], listed[0], listed[1]]
    assert len(listed) == sum(len(block.cells) for block in design.DESIGN)


def _run(seed: int, **more: object) -> dict[str, object]:
    cell = Cell("x8", 20, "swap", "calm", "flow, +2 m", "layers")
    row = {"seed": seed, "distance_m": 7.0, "distance_verdict": "holds", "h_m": 1.0, "arrived_share": 1.0}
    return cell.named() | row | {"goal_passed_s": 22.0, "waiting": 0, "flow_m": 0.1} | more


def test_what_is_counted() -> None:
    """A run without h did not keep it; one that could not start lost Ds, and its vehicles did not arrive."""
    runs = [
        _run(1),
        _run(2, h_m=-0.5, arrived_share=0.9, goal_passed_s=None, waiting=2),
        _run(3, distance_m=4.0, distance_verdict="violated", h_m=-4.0, goal_passed_s=30.0),
        {name: _run(4)[name] for name in (*COLUMNS, "seed")} | {"refused": "cannot start"},
    ]
    (row,) = answer.table(pd.DataFrame(runs)).to_dict("records")
    assert (row["runs"], row["lost"], row["h_below_0"], row["arrived"]) == (4, 2, 3, 2)
    assert row["arrived_share"] == pytest.approx(2.9 / 4) and row["waiting"] == 2 and row["last_s"] == 30
    assert (row["least_distance_m"], row["least_h_m"], row["ended_early"]) == (4.0, -4.0, 1)
    text = answer.markdown(pd.DataFrame([row]))
    assert (
        "| 2 of 4 | 6.8 to 93.2 % | 4.00, 7.00 | 3 of 4 |" in text and "| 58 of 80 | 2 of 4 | 30.0 |" in text
    )
    # Tables of before there were missions and guidance, or waits.
    old = pd.DataFrame([_run(1)]).drop(columns=["mission", "guidance", "waiting"])
    (row,) = answer.table(old).to_dict("records")
    assert (row["mission"], row["guidance"]) == ("swap", "straight") and math.isnan(row["waiting"])


def test_runs_of_earlier_folders_are_taken_over_and_not_flown_again(tmp_path: Path) -> None:
    cell = Cell("unicycle", 2, "swap", "calm", "none", "straight")
    made = {cell: scenario(cell, ["duration_s=0.1"])}
    first = answer.fly(made, {cell: range(1, 3)}, Journal(), 1)
    one, two = tmp_path / "one", tmp_path / "two"
    for folder in (one, two):
        folder.mkdir()
        first.to_csv(folder / "runs.csv", index=False)
        (folder / "answer.json").write_text(
            json.dumps({"set": ["duration_s=0.1"], "airframes": {"x8": "1"}}), encoding="utf-8"
        )
    known, airframes = added([one], ["duration_s=0.1"], {"rascal": "2"})
    assert airframes == {"x8": "1", "rascal": "2"} and known is not None
    book = Journal()
    runs = answer.fly(made, {cell: range(1, 4)}, book, 1, known)
    assert runs.seed.tolist() == [1, 2, 3] and len(book.rows) == 1
    pd.testing.assert_frame_equal(runs[:2], known, check_dtype=False)
    for folders, changes, now, why in (
        ([one, two], ["duration_s=0.1"], {}, "none; straight, seed 1 is in two of the folders"),
        ([one], [], {}, "it was flown with --set duration_s=0.1"),
        ([one], ["duration_s=0.1"], {"x8": "3"}, "x8 has other files now"),
    ):
        with pytest.raises(UserError, match=why):
            added(folders, changes, now)


def test_the_list_names_every_cell_with_its_number(
    call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("answer", "--list") == 0
    text = capsys.readouterr().out
    for k, (cell, seeds) in enumerate(design.CELLS.items(), 1):
        assert f"{k:>4}  {cell}: {seeds} runs" in text
    assert call("answer", "--list", "--airframes", "my-wing", "--vehicles", "20", "--only", "none") == 0
    assert "20 my-wing, swap, windy; none; straight: 20 runs" in capsys.readouterr().out


def test_the_page_is_the_committed_table_and_that_follows_from_every_run() -> None:
    kept = pd.read_csv(KEPT / "answer.csv")
    made = answer.table(pd.read_csv(KEPT / "runs.csv"))
    pd.testing.assert_frame_equal(made, kept, check_dtype=False)
    page = answer_page.PAGE.read_text("utf-8")
    assert answer_page.written(page, answer_page.tables(kept)) == page, "python docs/answer_page.py"
    assert {Cell(*key) for key in kept[COLUMNS].itertuples(index=False)} <= set(design.CELLS)
    flown, runs = pd.read_csv(KEPT.parent / "flow.csv"), pd.read_csv(KEPT / "runs.csv")
    assert flow_page.page(flown, runs) == flow_page.PAGE.read_text("utf-8"), "python docs/flow_page.py"
    for text in (page, (ROOT / "README.md").read_text("utf-8")):
        said = " ".join(text.split())
        for cells in (flow_page.LAYERS, flow_page.RANDOM[:1], flow_page.RANDOM[1:2]):
            of = kept[[Cell(*key) in cells for key in kept[COLUMNS].itertuples(index=False)]]
            lost, below, n = of.lost.sum(), of.h_below_0.sum(), of.runs.sum()
            home = round((of.arrived_share * of.runs * of.number).sum())
            assert f"lost Ds in {lost} of {n} runs, h fell below 0 in {below}" in said
            assert f"{home} of {(of.runs * of.number).sum()} arrived" in said
