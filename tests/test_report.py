"""The report page: one for every kind of folder, self-contained, text escaped, its data what was flown."""

from __future__ import annotations

import hashlib
import io
import json
import re
import shutil
from collections.abc import Callable
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from aircraft.kinematic import KinematicFleet
from filters.cbf.collision import Passthrough
from testbed.claims.registry import SEPARATION
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.errors import UserError
from testbed.export import acmi, csv
from testbed.measures import hdot_ledger
from testbed.records.run import Run
from testbed.records.store import load as load_run
from testbed.records.verdict import Status
from testbed.report import blocks, figures, ledger_figures, page, playback, run_part, scorecard
from testbed.report.blocks import Part, Section, Table
from testbed.report.style import STYLES, drawing, nth, styles
from testbed.report.tables import scorecard as scorecard_table
from testbed.scenario.scenario import Scenario, load
from testbed.simulation.simulate import run
from testbed.studies.comparison.comparison import compare
from testbed.studies.pages import KINDS

SHORT = ["duration_s=0.5", "manoeuvre_instants=0"]
DATA = Path(__file__).parent.parent / "docs" / "guide" / "data"
EVIL = "</script><script>alert(1)</script> & \"quotes' \u2028 é"


class Seen(HTMLParser):
    """What a page holds: ids, addresses, scripts and JSON blocks, text."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.ids: list[str] = []
        self.addresses: list[str] = []
        self.scripts: list[str] = []
        self.json: list[str] = []
        self.pictures: list[dict[str, str | None]] = []
        self.words = ""
        self._into: list[str] | None = None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.ids += [given["id"]] if given.get("id") else []  # type: ignore[list-item]
        self.addresses += [v for k, v in attrs if k in ("src", "href", "xlink:href") and v]
        self.pictures += [given] if tag == "img" or given.get("role") == "img" else []
        if tag == "script":
            self._into = self.json if given.get("type") == "application/json" else self.scripts
            self._into.append("")

    def handle_endtag(self, tag: str) -> None:
        self._into = None if tag == "script" else self._into

    def handle_data(self, data: str) -> None:
        if self._into is not None:
            self._into[-1] += data
        else:
            self.words += data


def seen(*folders: Path) -> Seen:
    found = Seen(page.page([page.part(f, f.name, KINDS) for f in folders]))
    assert len(found.ids) == len(set(found.ids))
    assert all(a.startswith(("data:", "#")) for a in found.addresses)
    assert all(p.get("alt") or p.get("aria-label") for p in found.pictures)
    assert len(found.scripts) == (1 if found.json else 0)
    return found


def table(found: Seen, text: str) -> pd.DataFrame:
    """The table behind the first address whose content begins with `text`."""
    uri = next(
        a
        for a in found.addresses
        if a.startswith("data:text/csv") and unquote(a).partition(",")[2].startswith(text)
    )
    return pd.read_csv(io.StringIO(unquote(uri.partition(",")[2])))


@pytest.fixture(scope="module")
def both(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A comparison long enough for the encounter, on plants that are quick to fly."""
    fields = ["filter_dt_s=0.02", "record_dt_s=0.02", "manoeuvre_instants=0", "duration_s=10"]
    out = tmp_path_factory.mktemp("report") / "spaces and é"
    scenarios = {p: load("paper-2-turn", [*fields, f"plant={p}"]) for p in ("unicycle", "lagged")}
    return compare(scenarios, out).path


@pytest.fixture(scope="module")
def found(both: Path) -> Seen:
    return seen(both)


def test_a_comparison_has_every_part_and_the_numbers_of_its_runs(both: Path, found: Seen) -> None:
    for words in (
        "Scorecard",
        "Playback",
        "Ledger",
        "The paper's panels",
        "Tracking",
        "Settings and provenance",
    ):
        assert words in found.words
    runs = {p: load_run(both / p) for p in ("unicycle", "lagged")}
    for label, of in runs.items():
        assert f"{of.guarantee('separation')['value']:.2f} m at closest (Ds 5 m)" in found.words
        for e in of.guarantees:
            assert e["claim"] in found.words and e["source"] in found.words
        card = table(found, "run,number")
        mine = card[card.run == label].set_index("id")
        for e in of.guarantees:
            assert mine.loc[e["id"], "verdict"] == e["verdict"]
    assert "spaces and é" in found.words
    assert (both / "report.html").read_text(encoding="utf-8") == page.page(
        [page.part(both, both.name, KINDS)]
    )


def test_the_figures_data_is_what_was_flown(both: Path, found: Seen) -> None:
    lagged = load_run(both / "lagged")
    paths = table(found, "plant,t_s,vehicle,x_m")
    mine = paths[paths.plant == "lagged"].merge(lagged.vehicles, on=["t_s", "vehicle"], suffixes=("", "_run"))
    assert len(mine) > 500
    assert np.abs(mine.x_m - mine.x_m_run).max() < 1e-4 and np.abs(mine.z_m - mine.z_m_run).max() < 1e-4


def test_the_playback_decodes_to_the_run_within_a_step_of_rounding(both: Path, found: Seen) -> None:
    lagged = load_run(both / "lagged")
    data = json.loads(found.json[0])
    plant = data["plants"][1]
    t = np.cumsum(plant["t"]) * data["steps"]["t"]
    rows = lagged.vehicles[lagged.vehicles.vehicle == 2].set_index("t_s")
    at = [int(np.argmin(np.abs(rows.index.to_numpy() - x))) for x in t]
    for channel, (column, scale, step) in playback.CHANNELS.items():
        decoded = np.cumsum(plant["tracks"][channel][1]) * step
        truth = scale * rows[column].to_numpy(dtype=float)[at]
        truth = np.unwrap(truth) if channel == "theta" else truth
        # coding sums rounded values, it does not sum rounding errors
        assert np.abs(decoded - truth).max() <= 0.5 * step + 1e-9
    separation = lagged.guarantee("separation")
    assert plant["critical"] == separation["vehicles"]
    moment = next(m for m in plant["moments"] if m["label"] == "least distance")
    assert moment["t"] == separation["t_s"] and np.abs(t - moment["t"]).min() <= 0.02


def test_thinning_keeps_the_worst_instants_and_the_end() -> None:
    t = np.arange(100_001) * 0.005
    kept = playback.frames(t, 1001, [123.456, 400.0])
    assert len(kept) <= 1004 and kept[0] == 0 and kept[-1] == 100_000
    assert all(np.abs(t[kept] - x).min() <= 0.0025 for x in (123.456, 400.0))
    assert (np.diff(kept) > 0).all()


def test_values_that_are_not_finite_do_not_break_the_coding() -> None:
    deltas = playback.coded(np.array([np.nan, 1.0, np.nan, np.inf, 3.0]), 0.5)
    assert np.cumsum(deltas).tolist() == [0, 2, 2, 2, 6]
    assert json.loads(json.dumps(deltas)) == deltas


def test_several_folders_make_one_page_with_ids_of_their_own(both: Path) -> None:
    found = seen(both / "unicycle", both / "lagged", both)
    assert len(found.json) == 3 and len(found.scripts) == 1
    assert {"player-1", "player-2", "player-3"} <= set(found.ids)


def test_several_playbacks_of_one_part_are_players_of_their_own() -> None:
    from testbed.report.blocks import OPEN, Part, Playback, Section

    block = Playback(playback.data({"unicycle": run(load("paper-2-turn", ["duration_s=0.05"]))}))
    text = page.page([Part("t", "w", OPEN, "h", sections=[Section("a", [block]), Section("b", [block])])])
    assert Seen(text).ids.count("player-1") == Seen(text).ids.count("player-1-2") == 1
    assert len(Seen(text).json) == 2


def test_a_scenarios_text_is_text() -> None:
    flown = run(load("paper-2-turn", SHORT))
    flown.manifest["scenario"] |= {"name": EVIL, "description": EVIL}
    found = Seen(page.page([run_part.part({"unicycle": flown}, None, "r <b>&é")]))
    assert found.words.count(EVIL) >= 2 and "r <b>&é" in found.words
    assert json.loads(found.json[0])["vehicles"] == 2
    assert all(s not in found.json[0] for s in ("</", "<!--", "\u2028"))


def test_a_plant_name_is_text_too(tmp_path: Path) -> None:
    flown = run(load("paper-2-turn", SHORT))
    made = Seen(page.page([run_part.part({EVIL: flown}, None, "x")]))
    assert json.loads(made.json[0])["plants"][0]["name"] == EVIL
    assert EVIL in made.words and len(made.scripts) == 1


class Falling(KinematicFleet):
    """Vehicle 2 hits the ground after 0.2 s."""

    steps = 0

    def step(self, command, wind, n):  # type: ignore[no-untyped-def]
        self.steps += n
        return super().step(command, wind, n)

    def faults(self) -> list[str]:
        return ["", "ground" if self.steps * self.dt >= 0.2 else ""]


def test_a_run_that_ended_early_says_so_and_keeps_nothing(tmp_path: Path) -> None:
    scenarios = {p: load("paper-2-turn", [*SHORT, f"plant={p}"]) for p in ("unicycle", "lagged")}
    falling = Parts(plant=lambda s, wind: Falling(s.vehicles, s.rates.fdm_dt_s))
    compare(scenarios, tmp_path / "r", parts={"lagged": falling})
    found = seen(tmp_path / "r")
    why = "vehicle 2: ground at 0.200 s; run stopped"
    assert "Separation not shown on lagged; kept on unicycle" in found.words
    assert f"the run did not finish: {why}" in found.words
    assert "not judged, the run ended early: G1 separation" in found.words
    data = json.loads(found.json[0])
    assert data["plants"][1]["ended"] == why
    ends = [sum(p["t"]) * data["steps"]["t"] for p in data["plants"]]
    assert ends[0] == pytest.approx(0.5) and ends[1] == pytest.approx(0.195)


def test_one_vehicle_has_a_page_without_pairs(tmp_path: Path) -> None:
    run(load("paper-2-turn", ["vehicles=1", *SHORT]), tmp_path / "r")
    found = seen(tmp_path / "r")
    assert "Separation not shown" in found.words and "a single vehicle has no pair" in found.words
    assert json.loads(found.json[0])["plants"][0]["pairs"] is None


@pytest.mark.parametrize(
    ("fields", "kind"),
    [
        (("paper-2-turn",), "turn"),
        (("paper-2-straight",), "straight"),
        (("paper-counterexample",), "pairs"),
        (("paper-motivating",), "none"),
    ],
)
def test_the_manoeuvre_in_the_player_is_the_barriers(fields: tuple[str, ...], kind: str) -> None:
    scenario = load(fields[0])
    gamma = playback.gamma(scenario.model_dump(mode="json"))
    assert gamma["kind"] == kind
    if "vehicles" in gamma:
        flown = catalogue.barrier(scenario).manoeuvre(scenario.vehicles).array()
        assert np.array_equal(np.array(gamma["vehicles"]), flown)


def fact(value: float | None, verdict: str) -> scorecard.Fact:
    said = SEPARATION.unjudged("root", 20.0).but(
        value=value, bound=5.0, instant=1.0, vehicles=(1, 2), status=Status(verdict), why="nobody"
    )
    return scorecard.fact(verdict, Run({"ended_early": None}, [said], {}), "")


def test_the_headline_never_hides_a_loss() -> None:
    kept, lost, void = fact(6.0, "holds"), fact(4.0, "violated"), fact(6.0, "premise not met")
    none = fact(None, "not applicable")
    assert scorecard.headline([kept, kept])[0] == "kept"
    assert scorecard.headline([kept, void]) == (
        "open",
        "Separation not shown on premise not met; kept on holds",
    )
    assert scorecard.headline([none])[0] == "open"
    assert scorecard.headline([kept, void, lost])[0] == "lost"
    assert scorecard.headline([kept, lost])[1] == "Separation LOST on violated; kept on holds"
    assert scorecard.headline([kept], ["x8"]) == (
        "kept",
        "Separation kept on holds, though h fell below zero on x8",
    )
    assert lost.width < 40 < kept.width  # the bound stands at 40 %


def test_names_nobody_planned_for_keep_their_look() -> None:
    for many in (1, 8, 60, 300):
        names = ["unicycle", "x8", "jsbsim", *(f"mine {k}" for k in range(many))]
        looks = [tuple(map(str, look.values())) for look in styles(names).values()]
        assert len(set(looks)) == len(names)
    few = styles(["jsbsim", "glider", "kite", "balloon"])
    assert len({look["color"] for look in few.values()}) == 4
    assert styles(["glider"]) == styles(["glider"]) and few["jsbsim"] == STYLES["jsbsim"]
    assert len({tuple(map(str, nth(k).values())) for k in range(400)}) == 400


# -- studies


@pytest.mark.parametrize(("name", "mark"), [("answer", "answer.json"), ("certificate", "remedies.json")])
def test_the_guides_own_studies_have_pages(name: str, mark: str) -> None:
    found = seen(DATA / name)
    rows = pd.read_csv((DATA / name / mark).with_suffix(".csv"))
    assert "lose" in found.words and found.words.count("runs lose Ds (95 % interval") == len(rows)
    assert (DATA / name / mark).is_file()


def test_a_sweep_has_a_page(tmp_path: Path) -> None:
    rows = pd.read_csv(DATA / "turn-bandwidth.csv")
    shutil.copy(DATA / "turn-bandwidth.csv", tmp_path / "sweep.csv")
    (tmp_path / "tune.json").write_text(
        json.dumps({"command": "testbed tune x8", "rows": json.loads(rows.to_json(orient="records"))})
    )
    found = seen(tmp_path)
    assert f"{len(rows)} sets of gains flown" in found.words and "testbed tune x8" in found.words
    assert len(table(found, rows.columns[0])) == len(rows)


@pytest.mark.slow
def test_studies_write_their_page_at_their_end(tmp_path: Path, call: Callable[..., int]) -> None:
    short = ("--workers", 1, "--seeds", 1, "--set", "duration_s=0.5")
    ladder, margin = tmp_path / "ladder", tmp_path / "margin"
    assert call("compare", "paper-2-turn", "--ladder", *short, "--out", ladder) == 0
    knob = ("--knob", "ds_buffer", "--target-rate", "0.9", "--plant", "unicycle")
    assert call("margin", "paper-2-turn", *knob, *short, "--out", margin) == 0
    for folder, words in (
        (ladder, "of 1 runs on the lowest rung"),
        (margin, "ds_buffer 0 m meets a rate of 0.9"),
    ):
        assert words in Seen((folder / "report.html").read_text(encoding="utf-8")).words
        assert "<svg" in (folder / "report.html").read_text(encoding="utf-8")
        assert seen(folder).words


@pytest.mark.slow
def test_a_campaign_writes_its_page(tmp_path: Path, call: Callable[..., int]) -> None:
    file, out = tmp_path / "c.toml", tmp_path / "out"
    file.write_text(
        'name = "small"\ndescription = "<b>"\nscenario = "paper-2-turn"\nseeds = 3\nplants = ["unicycle"]\n'
        'remedies = ["none", "buffer 1 m"]\n[set]\nduration_s = 0.1\nheading_perturbation_deg = 1\n'
        '"checks.manoeuvre_instants" = 0\n'
    )
    assert call("campaign", "run", file, "--out", out, "--workers", 1) == 0
    text = (out / "report.html").read_text(encoding="utf-8")
    assert (
        "campaign small" in Seen(text).words
        and "<b>" in Seen(text).words
        and "0 of 6 runs lose separation" in Seen(text).words
    )
    assert len(table(seen(out), "id,")) == 6


# -- what is made of one run


@pytest.fixture(scope="module")
def lost(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An encounter that lagged vehicles lose."""
    folder = tmp_path_factory.mktemp("lost") / "run"
    settings = ("plant=lagged", "lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05", "duration_s=9")
    run(load("paper-2-turn", list(settings)), folder)
    return folder


def test_a_ledger_has_a_page(lost: Path, tmp_path: Path, call: Callable[..., int]) -> None:
    assert call("ledger", lost, "--out", tmp_path / "l") == 0
    data = json.loads((tmp_path / "l" / "ledger.json").read_text())
    found, worst = seen(tmp_path / "l"), data["worst"][0]
    assert f"At worst h falls {-worst['residual_mps']:.2f} m/s faster than promised" in found.words
    assert f"At {worst['t_s']:.3f} s, vehicles 1 and 2" in found.words
    assert f"turn rate {worst['omega']:+.2f}" in found.words
    assert "paper-2-turn on lagged" in found.words and "guidance.lookahead_m" in found.words
    assert len(table(found, "channel,")) == 6 and len(table(found, "t_s,vehicles")) == len(data["worst"])
    assert "remedy.robust_omega_degps" in found.words


def test_exported_tables_have_a_page(lost: Path, tmp_path: Path, call: Callable[..., int]) -> None:
    assert call("export", lost, "--format", "csv", "--out", tmp_path / "e") == 0
    found = seen(tmp_path / "e")
    assert "Separation: violated, 4.0" in found.words
    events = pd.read_csv(tmp_path / "e" / "events.csv")
    assert len(events) and all(text in found.words for text in events.text)
    rows = len(pd.read_csv(tmp_path / "e" / "vehicles.csv"))
    assert f"vehicles.csv, the first 5 of {rows} rows" in found.words
    # Tables travel whole where a browser takes them.
    assert len(table(found, "t_s,vehicle,x_m")) == rows
    assert "course, counter-clockwise from east" in found.words


def test_a_table_too_long_to_travel_says_so(
    lost: Path, tmp_path: Path, call: Callable[..., int], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call("export", lost, "--format", "csv", "--out", tmp_path / "e") == 0
    monkeypatch.setattr(blocks, "LONGEST_URI", 20_000)
    found = seen(tmp_path / "e")
    assert "rows; too long to travel in this page" in found.words
    with pytest.raises(StopIteration):
        table(found, "t_s,vehicle,x_m")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["as it stands", "shrunk", "nothing"])
def test_a_search_has_a_page(kind: str, tmp_path: Path, call: Callable[..., int]) -> None:
    rates = ("--set", "filter_dt_s=0.05", "--set", "record_dt_s=0.05", "--workers", 1)
    plants = {"as it stands": ("lagged", 5), "shrunk": ("lagged", 40), "nothing": ("unicycle", 5)}
    plant, budget = plants[kind]
    more = ("--set", "ds_buffer_m=1.6") if kind == "shrunk" else ()
    out = tmp_path / "f"
    look = ("--set", "lookahead_m=10", "--plant", plant, "--budget", budget)
    assert call("falsify", "paper-2-turn", *rates, *look, *more, "--out", out) == 0
    data, found = json.loads((out / "falsify.json").read_text()), seen(out)
    margin = f"{data['result']['margin']:.3g} m at {data['result']['t_s']:.3f} s, vehicles 1 and 2"
    assert "bound of lateral_m" in found.words and "seed of the search" in found.words
    assert data["reproduce"] in found.words
    if kind == "nothing":
        assert "Separation: no counterexample was found in 5 flights" in found.words
        assert "proves nothing" in found.words and "The flight of the least margin" in found.words
        return
    assert margin in found.words and "The counterexample: paths" in found.words
    if kind == "as it stands":
        assert "violated as it stands, nothing was searched" in found.words
        assert "None: the scenario as it stands." in found.words
    else:
        assert 0 < len(data["departures"]) <= len(data["found_departures"])
        assert f"to {len(data['departures'])} departure" in found.words


def test_rows_of_a_table_need_not_have_the_same_columns() -> None:
    """A falsifier's wind has a direction, its starts have vehicles."""
    rows = [{"kind": "lateral", "vehicle": 1}, {"kind": "wind", "towards_deg": 30.5}]
    text = page.page([Part("t", "", "open", "", sections=[Section("s", [Table(rows)])])])
    cells = re.findall(r"<t[dh](?: [^>]*)?>([^<]*)", text)
    assert cells == ["kind", "vehicle", "towards deg", "lateral", "1", "–", "wind", "–", "30.5"]


# -- the command


def test_the_command_writes_where_it_is_told(
    both: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "page.html"
    assert call("report", both / "unicycle", "--out", out) == 0
    assert capsys.readouterr().out == f"report: {out}\n"
    assert "Separation kept on unicycle" in Seen(out.read_text(encoding="utf-8")).words


@pytest.mark.parametrize("kind", ["absent", "empty", "damaged", "unwritable"])
def test_a_mistake_is_one_line(
    kind: str, both: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    folder, out = tmp_path / "r", tmp_path / "page.html"
    if kind == "empty":
        folder.mkdir()
    elif kind == "damaged":
        folder.mkdir()
        (folder / "ladder.json").write_text('{"rows": []}')
    elif kind == "unwritable":
        folder, out = both, tmp_path / "no" / "page.html"
    assert call("report", folder, "--out", out) == 2
    error = capsys.readouterr().err
    assert error.startswith("error: ") and error.count("\n") == 1
    assert not out.exists()


def test_a_page_that_fails_costs_no_result(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with page.reported(tmp_path / "r", run_part.of_folder) as folder:
        (folder / "ladder.json").write_text("{}")
    assert (tmp_path / "r" / "ladder.json").is_file() and not (tmp_path / "r" / "report.html").exists()
    assert "no report.html" in capsys.readouterr().err


def test_a_comparison_without_a_report(tmp_path: Path) -> None:
    done = compare({"unicycle": load("paper-2-turn", SHORT)}, tmp_path / "r", report=False)
    assert not (done.path / "report.html").exists()


def test_a_datasheet_is_a_page_already(tmp_path: Path) -> None:
    (tmp_path / "datasheet.json").write_text("{}")
    with pytest.raises(UserError, match="is a datasheet, a page already"):
        page.part(tmp_path, "x")


class MyFilter(Passthrough):
    """A filter of the user's own."""


class MyPlant(KinematicFleet):
    """A plant of the user's own."""


def test_parts_of_ones_own_are_named_with_their_checksum_everywhere(tmp_path: Path) -> None:
    mine = Parts(filter=named_filter, plant=named_plant)
    done = run(load("paper-2-turn", SHORT), tmp_path / "r", force=True, parts=mine)
    sha = hashlib.sha256(Path(__file__).read_bytes()).hexdigest()[:12]
    page.write([tmp_path / "r"], tmp_path / "page.html")
    csv.write(done, make_folder(tmp_path / "csv"))
    acmi.write(done, tmp_path / "r.txt.acmi")
    console = Console(width=300)
    with console.capture() as shown:
        console.print(scorecard_table({"unicycle": done}, "title"))
    texts = {
        "page": Seen((tmp_path / "page.html").read_text(encoding="utf-8")).words,
        "page of the export": Seen(page.page([page.part(tmp_path / "csv", "csv", KINDS)])).words,
        "recording": (tmp_path / "r.txt.acmi").read_text(encoding="utf-8"),
        "terminal": shown.get(),
    }
    for where, text in texts.items():
        for word in ("named_filter", "named_plant", sha):
            assert word in text, f"{where} does not name {word}"
    assert "filter centralised" not in texts["page"]


def named_filter(s: Scenario, barrier: Any, goal: Any) -> MyFilter:
    return MyFilter()


def named_plant(s: Scenario, wind: Any) -> MyPlant:
    return MyPlant(s.vehicles, s.rates.fdm_dt_s)


def make_folder(path: Path) -> Path:
    path.mkdir()
    return path


def test_the_ledger_is_neither_joined_nor_shaded_across_omitted_rows() -> None:
    t = np.arange(8.0)
    h = np.array([3.0, -1.0, -2.0, 50.0, -3.0, 40.0, 4.0, 5.0])
    columns = {"t_s": t, "i": 1, "j": 2, "h_m": h, "hdot_realised_mps": -h, "hdot_predicted_mps": 0.0}
    pairs = pd.DataFrame(columns | {f"residual_{c}_mps": -h / 4 for c in hdot_ledger.CHANNELS})
    run = Run(
        {"scenario": {"vehicles": 2}, "files": {"pairs.parquet": ""}}, [], {}, reader=lambda name: pairs
    )
    rows = ledger_figures.with_gaps(run, 1, 2, near_h_m=10.0)
    # the rows of h 50 and 40 are omitted, and stand as gaps between the others
    assert rows.t_s.tolist() == t.tolist()
    assert np.isnan(rows.hdot_realised_mps).tolist() == [k in (3, 5) for k in range(8)]
    assert ledger_figures.spans(t, (rows.h_m < 0).to_numpy()) == [(0.5, 2.5), (3.5, 4.5)]
    assert ledger_figures.spans(t, t > 5.5) == [(5.5, 7.0)]


def test_a_legend_states_the_distance_that_was_judged(tmp_path: Path) -> None:
    """Recorded once a second, two vehicles that pass in between come closer than any row shows."""
    fields = [
        "filter.kind=none",
        "record_dt_s=1",
        "filter_dt_s=0.05",
        "manoeuvre_instants=0",
        "duration_s=12",
    ]
    done = run(load("paper-2-turn", [*fields, "lateral_offsets_m=[4, 4]", "d_safe_m=1"]), force=True)
    judged = done.guarantee("separation").value
    assert done.pairs.distance_m.min() > judged + 0.05
    with drawing():
        distance = figures.panels({"unicycle": done}).axes[2]
        assert distance.get_legend().get_texts()[0].get_text() == f"unicycle, least {judged:.2f} m"
