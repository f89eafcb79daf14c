"""A run printed takes ten lines; in a notebook it is a table of verdicts and two panels."""

from __future__ import annotations

import re
from functools import cache
from operator import methodcaller
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest

import testbed
from filters.model import Command
from testbed.records import shown
from testbed.records.run import Run

notebook = methodcaller("_repr_html_")
BRIEF = ["duration_s=1", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]


@cache
def flown(*overrides: str) -> Run:
    return testbed.run(testbed.load_scenario("paper-2-turn", [*BRIEF, *overrides]), force=True)


@pytest.mark.parametrize("overrides", [(), ("vehicles=1",), ("start.radius_m=3",), ("filter.kind=none",)])
def test_print_of_a_run_takes_ten_lines_and_names_every_claim_once(overrides: tuple[str, ...]) -> None:
    run = flown(*overrides)
    said = str(run)
    assert said == repr(run) and len(said.splitlines()) == 10
    for verdict in run.guarantees:
        place = said.count(f"{verdict.number} {verdict.id}")
        assert place == (0 if verdict.kind.name == "PREMISE" and verdict.status == "holds" else 1), verdict.id


def test_print_says_scenario_loss_and_its_value() -> None:
    said = str(flown("start.radius_m=3")).splitlines()
    assert said[0] == "paper-2-turn: 2 vehicles on unicycle, filter centralised, seed 1"
    violated = next(line for line in said if line.startswith("  violated"))
    least = flown("start.radius_m=3").guarantee("separation")["value"]
    assert f"G1 separation ({least:.4g} m)" in violated
    assert "P1 " in said[3] and "premise not met" in said[3]


def test_print_says_whose_parts_flew_and_why_the_run_ended() -> None:
    session = testbed.assemble(testbed.load_scenario("paper-2-turn", BRIEF))
    session.reset()
    session.step(Command([20.0, 20.0], [0.0, 0.0], [0.0, 0.0]))
    said = str(session.judge()).splitlines()
    assert said[1].endswith("judged before its end at 0.050 s; run stopped")
    assert said[2].endswith("nominal commands given step by step")


@pytest.mark.parametrize("overrides", [(), ("vehicles=1",), ("vehicles=8",)])
def test_in_a_notebook_there_is_a_row_per_claim_and_panels_within_their_frame(
    overrides: tuple[str, ...],
) -> None:
    run = flown(*overrides)
    page = ElementTree.fromstring(notebook(run).replace("<br>", "<br/>"))
    rows = page.findall(".//tbody/tr")
    assert [r.findall("td")[0].text for r in rows] == [v.number for v in run.guarantees]
    assert [r.findall("td")[2][0].text.split(" ", 1)[1] for r in rows] == [  # type: ignore[union-attr]
        v.status.value for v in run.guarantees
    ]
    panels = page.findall(".//svg")
    assert len(panels) == (1 if len(run.pairs) == 0 else 2)
    lines = [line.get("points") or "" for panel in panels for line in panel.findall("polyline")]
    for x, y in (point.split(",") for line in lines for point in line.split()):
        assert 0 <= float(x) <= shown.WIDTH and 0 <= float(y) <= shown.HEIGHT
    paths = panels[-1].findall("polyline")
    assert len(paths) == int(run.vehicles.vehicle.nunique())


def test_the_panel_shows_the_least_distance_and_ds_at_one_scale() -> None:
    """Two vehicles that close at 40 m/s: the line falls by 40 m of the scale that runs from 0."""
    run = flown("start.radius_m=100")
    panel = ElementTree.fromstring(notebook(run).replace("<br>", "<br/>")).findall(".//svg")[0]
    line, level = (
        np.array([p.split(",") for p in (poly.get("points") or "").split()], dtype=float)
        for poly in panel.findall("polyline")
    )
    least = run.pairs.groupby("t_s").distance_m.min().to_numpy()
    scale = (shown.HEIGHT - 2 * shown.EDGE) / least.max()  # pixels a metre
    assert line[:, 1] == pytest.approx(shown.HEIGHT - shown.EDGE - scale * least, abs=0.06)
    assert level[:, 1] == pytest.approx(shown.HEIGHT - shown.EDGE - 5.0 * scale, abs=0.06)


def test_what_a_record_says_cannot_become_markup() -> None:
    run = flown()
    manifest = run.manifest | {"ended_early": "<script>alert(1)</script>"}
    verdicts = [v.but(why="<b>&") for v in run.guarantees]
    page = shown.html(manifest, verdicts, run.vehicles, run.pairs)
    assert "<script" not in page and "&lt;script&gt;" in page and "<b>&" not in page


def test_what_is_not_finite_and_what_is_long_is_drawn_all_the_same() -> None:
    times = np.arange(5000) / 10
    pairs = pd.DataFrame({"t_s": times, "distance_m": np.where(times < 1, np.nan, 7.0)})
    page = shown.html(flown().manifest, [], pd.DataFrame(), pairs)
    points = re.findall(r'points="([^"]*)"', page)[0].split()
    assert 300 < len(points) <= shown.MOST_POINTS and "nan" not in page


def test_a_run_read_back_shows_the_same(tmp_path) -> None:  # type: ignore[no-untyped-def]
    s = testbed.load_scenario("paper-2-turn", BRIEF)
    run = testbed.run(s, tmp_path / "r")
    again = testbed.load(tmp_path / "r")
    assert str(again) == str(run) and notebook(again) == notebook(flown())
