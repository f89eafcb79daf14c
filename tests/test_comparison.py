"""Comparisons: combinations of plants, filters and guidance, runs that were flown, many at once."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import testbed
from testbed.components import named_parts
from testbed.records.run import Run
from testbed.report import figures, page, style, tables
from testbed.studies.comparison.combinations import MOST, combinations
from testbed.studies.comparison.comparison import Comparison, compare, folder_names, part

SHORT = ["duration_s=0.2", "record_dt_s=0.05", "filter_dt_s=0.05", "manoeuvre_instants=0"]
PARTS = '''
import numpy as np
from filters.cbf.collision import Passthrough
from filters.model import Command


class Bold:
    """A filter of one's own."""

    def __init__(self, scenario, barrier, goal, share=1.0):
        self.inner = Passthrough()

    def __call__(self, view, nominal, limits):
        return self.inner(view, nominal, limits)


class Ahead:
    """Guidance of one's own."""

    def __init__(self, scenario, goal, barrier):
        self.n = scenario.vehicles

    def __call__(self, t, view):
        return Command(np.full(self.n, 18.0), np.zeros(self.n), np.zeros(self.n))
'''


@pytest.fixture
def own(tmp_path: Path) -> Path:
    file = tmp_path / "mine.py"
    file.write_text(PARTS)
    return file


def labels(*parts: str, **asked: str | None) -> list[str]:
    wanted = {role: asked.get(role) for role in ("plant", "filter", "guidance")}
    return list(combinations("paper-2-turn", SHORT, wanted, named_parts.read(parts)))


def test_every_plant_flies_with_every_filter_and_every_guidance(own: Path) -> None:
    found = combinations(
        "paper-2-turn",
        SHORT,
        {"plant": "unicycle,lagged", "filter": f"centralised,{own}:Bold(share=2),none", "guidance": None},
    )
    assert list(found) == [
        f"{plant}, {kind}"
        for plant in ("unicycle", "lagged")
        for kind in ("centralised", "Bold(share=2)", "none")
    ]
    assert found["lagged, none"].scenario.plant == "lagged"
    assert found["lagged, none"].scenario.filter.kind == "none" and found["lagged, none"].parts is None
    parts = found["unicycle, Bold(share=2)"].parts
    assert parts is not None and list(parts.own()) == ["filter"]


def test_what_is_not_named_is_the_scenarios(own: Path) -> None:
    assert labels() == ["unicycle", "jsbsim"]
    assert labels(filter="centralised,none") == ["centralised", "none"]
    # A part of a role that is not varied flies in every combination.
    found = combinations(
        "paper-2-turn", SHORT, {"plant": "unicycle,lagged"}, named_parts.read([f"{own}:Ahead"])
    )
    assert all(c.parts is not None and "nominal" in c.parts.own() for c in found.values())
    assert labels(f"{own}:Bold", filter="none,Bold") == ["none", "Bold"]
    # Named twice, by --parts and by its file, it is one part.
    assert labels(f"{own}:Bold", filter=f"none,{own}:Bold") == ["none", "Bold"]


@pytest.mark.parametrize(
    ("parts", "asked", "says"),
    [
        ([], {"filter": "centralized"}, "--filters: there is no filter 'centralized'; there is centralised,"),
        ([], {"filter": "none,none"}, "--filters: 'none' is listed twice"),
        ([], {"plant": ","}, "--plants: name at least one plant"),
        ([], {"guidance": "Ahead"}, "--guidance: there is no guidance 'Ahead'; there is near-identity"),
        (["{own}:Bold"], {"filter": "Ahead"}, "none, Bold"),
        (["{own}:Bold"], {"filter": "none"}, "--parts Bold: --filters does not name it; add it there"),
        ([], {"filter": "{own}:Ahead"}, "mine.py:Ahead: it is a guidance, not a filter"),
        ([], {"filter": "{own}:Nobody"}, "has no 'Nobody'"),
        ([], {"filter": ",".join(f"{{own}}:Bold(share={k})" for k in range(MOST + 1))}, "are more than"),
    ],
)
def test_a_wrong_list_is_one_clear_line(
    own: Path, parts: list[str], asked: dict[str, str], says: str
) -> None:
    with pytest.raises(testbed.UserError) as refused:
        given = {role: names.replace("{own}", str(own)) for role, names in asked.items()}
        labels(*(p.replace("{own}", str(own)) for p in parts), **given)
    said = str(refused.value)
    assert says in said and "\n" not in said


def test_compare_in_one_command(own: Path, tmp_path: Path, call: Callable[..., int], capsys: Any) -> None:
    out = tmp_path / "c"
    sets = [x for s in SHORT for x in ("--set", s)]
    names = f"centralised,{own}:Bold,none"
    assert (
        call(
            "compare", "paper-2-turn", "--plants", "unicycle,lagged", "--filters", names, *sets, "--out", out
        )
        == 0
    )
    text = capsys.readouterr().out
    assert "5: lagged, Bold" in text and "mine.Bold" in text
    assert max(map(len, text.partition("figures:")[0].splitlines())) <= 80
    assert set(json.loads((out / "comparison.json").read_text())) == {
        f"{p}, {f}" for p in ("unicycle", "lagged") for f in ("centralised", "Bold", "none")
    }
    assert testbed.load(out / "lagged-Bold").part("filter") == "mine.Bold"
    assert (out / "figures" / "panels.png").is_file() and "lagged, Bold" in (out / "report.html").read_text()
    assert call("compare", "paper-2-turn", "--filters", "nothing", *sets) == 2
    assert "there is no filter 'nothing'" in capsys.readouterr().err


@pytest.fixture(scope="module")
def flown() -> dict[str, Run]:
    s = [testbed.load_scenario("paper-2-turn", [*SHORT, f"filter.kind={k}"]) for k in ("centralised", "none")]
    return {"the paper's": testbed.run(s[0]), "no/filter": testbed.run(s[1])}


def test_runs_that_were_flown_are_compared(flown: dict[str, Run], tmp_path: Path) -> None:
    found = testbed.compare(flown)
    assert found.figures == [] and found.runs == flown
    table = found.scorecard
    assert table.loc["qp-feasibility", ("no/filter", "verdict")] == "not applicable"
    assert (
        table.loc["separation", ("the paper's", "value")]
        == flown["the paper's"].guarantee("separation").value
    )
    assert len(found.panels().axes) == 4
    kept = testbed.compare(flown, tmp_path / "c")
    assert kept.figures[0].name == "panels.png" and all(f.is_file() for f in kept.figures)
    # Saved as they are, and read back: the same tables, the same verdicts, the same page.
    for label, run in flown.items():
        again = kept.runs[label]
        assert [dict(v) for v in again.guarantees] == [dict(v) for v in run.guarantees]
        np.testing.assert_array_equal(again.vehicles.to_numpy(), run.vehicles.to_numpy())
    assert "no/filter" in page.page([part(tmp_path / "c", "c")])
    from testbed.verification.check import verify

    assert all(f.agrees is not False for f in verify(tmp_path / "c" / "no-filter"))
    # A run read from a folder is compared like one in memory, beside one that is to be flown.
    mixed: dict[str, Any] = {
        "old": kept.runs["no/filter"],
        "new": testbed.load_scenario("paper-2-turn", SHORT),
    }
    again = compare(mixed, tmp_path / "d", report=False)
    assert isinstance(again, Comparison) and set(again.runs) == {"old", "new"}


def test_what_cannot_be_compared_is_refused(flown: dict[str, Run], tmp_path: Path) -> None:
    s = testbed.load_scenario("paper-2-turn", SHORT)
    for wrong, says in (
        ({}, "nothing to compare"),
        ({"a": 3}, "'a' is a int"),
        ({1: flown["no/filter"]}, "a label must be text"),
        ({"a": s}, "say into which folder"),
    ):
        with pytest.raises(testbed.UserError, match=says):
            testbed.compare(wrong)  # type: ignore[arg-type]


def test_folders_of_labels_differ_and_are_plain() -> None:
    found = folder_names(["a/b", "a b", "A:B", "figures", "..", "x" * 300, "µ"])
    assert len({name.lower() for name in found.values()}) == len(found)
    assert all(name.isascii() and "/" not in name and name[0] != "." for name in found.values())
    assert "figures" not in found.values()


def test_twenty_runs_have_twenty_looks_and_one_legend_that_hides_nothing(flown: dict[str, Run]) -> None:
    run = flown["the paper's"]
    runs = {f"unicycle, Filter(gain={k})": run for k in range(20)}
    looks = style.styles(runs)
    assert len({(look["color"], str(look["linestyle"])) for look in looks.values()}) == 20
    with style.drawing():
        figure = figures.panels(runs)
        figure.canvas.draw()
        assert all(a.get_legend() is None for a in figure.axes)
        (legend,) = figure.legends
        assert [t.get_text().partition(", least")[0] for t in legend.get_texts()] == list(runs)
        box = legend.get_window_extent()
        assert all(not box.overlaps(a.get_window_extent()) for a in figure.axes)
        assert box.x1 <= figure.bbox.x1 + 1


def test_a_table_of_many_runs_is_eighty_columns_wide(flown: dict[str, Run]) -> None:
    from rich.console import Console

    runs = {f"plant {k}, filter": run for k, run in enumerate([*flown.values()] * 4)}
    console = Console(width=80)
    with console.capture() as seen:
        console.print(tables.scorecard(runs, "eight"))
    text = seen.get()
    assert "8: plant 7, filter" in text and "G1 separation" in text and "…" not in text
    rows = [line for line in text.splitlines() if line[:2] in ("1 ", "8 ")]
    assert len(rows) == 2 and "+" in rows[0]
