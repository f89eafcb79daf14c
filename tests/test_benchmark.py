"""The benchmark: equal encounters for all filters, resumable, and nothing ranked that tests do not carry."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from testbed.campaigns.journal import Journal
from testbed.encounters.generating import generate, least
from testbed.statistics import paired_verdicts
from testbed.studies.benchmark import table
from testbed.studies.benchmark.benchmark import Cell, fly_all, plan, rows
from testbed.studies.benchmark.confirm import confirm, kept
from testbed.studies.benchmark.file import EncounterSet, load, shortened
from testbed.studies.benchmark.meetings import meetings, perturbed
from testbed.studies.benchmark.search import settings_of, tried

TINY = """
name = "tiny"
without = "none"
[set]
duration_s = 0.2
[filters.none]
"filter.kind" = "none"
[filters.centralised]
"filter.kind" = "centralised"
[filters.limited]
"filter.kind" = "limited"
[share]
limited = 0.4
[plants.unicycle]
plant = "unicycle"
[sets.meeting]
generate = ["head-on", "crossing"]
n = 3
"""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    path = tmp_path / "tiny.toml"
    path.write_text(TINY)
    return path


def test_all_filters_and_plants_fly_the_same_encounters() -> None:
    b, folder = load("field")
    made = plan(shortened(b, 2), folder)
    for set_ in b.sets:
        cells = [c for c in made.cells if c.set == set_]
        assert len(cells) == len(b.filters) * len(b.plants)
        for k in range(2):
            flights = [made.flight(c, k) for c in cells]
            assert all(f.data is flights[0].data for f in flights)
            assert len({made.key(f) for f in flights}) == len(flights)
    # Cut short anywhere, no cell is more than one encounter ahead of another of its set.
    counts: dict[str, dict[Any, int]] = {}
    for f in itertools.islice(made.flights(), 200):
        of = counts.setdefault(f.set, {(c.filter, c.plant): 0 for c in made.cells if c.set == f.set})
        of[f.filter, f.plant] += 1
        of = {k: v for k, v in of.items() if k[0] not in b.share}
        assert max(of.values()) - min(of.values()) <= 1


def test_the_ready_benchmark_is_as_large_as_its_page_says() -> None:
    b, folder = load("field")
    assert len(set(b.filters) - set(b.share)) >= 8 and len(b.plants) >= 3
    formats = {s.format for s in b.sets.values() if s.format}
    assert formats == {"daa", "scn", "table", "csv"}
    for s in b.sets.values():
        assert s.n >= (100 if not s.generate or s.vehicles == 2 else 20)
        assert not s.file or (folder / s.file).stat().st_size < 10_000
    for name in b.candidates:
        assert len(b.candidates[name]) == 3, "every filter's search is as long as the others'"
    assert set(b.candidates) == set(b.filters) - {b.without}
    again = tried(b, 2)
    assert again.seed != b.seed and len(again.filters) == 4 * len(b.candidates)
    assert all(len({json.dumps(x) for x in settings_of(b, name)}) == 4 for name in b.candidates)


def test_a_perturbed_encounter_keeps_the_others_paths_and_moves_them() -> None:
    (e,) = generate("crossing", 3, 1)
    rng = np.random.default_rng(1)
    same = perturbed(e, rng, 0.0, 0.0, 0.0)
    moved = perturbed(e, rng, 10.0, 2.0, 0.2)
    for a, b, c in zip(e.aircraft, same.aircraft, moved.aircraft, strict=True):
        assert np.allclose(a.rows, b.rows) and np.allclose(a.goal, b.goal)
        assert np.linalg.norm(c.goal - c.start) == pytest.approx(np.linalg.norm(a.goal - a.start))
        assert c.speed == a.speed
    own, other = moved.aircraft
    assert np.array_equal(own.rows, e.aircraft[0].rows)
    # The path goes where its course says.
    along = other.goal - other.start
    assert np.arctan2(along[1], along[0]) == pytest.approx(np.angle(np.exp(1j * other.course)), abs=1e-9)


@pytest.mark.parametrize("name", ["crossing", "converging", "turning", "overtaking"])
def test_two_of_every_set_meet_and_start_safe(name: str) -> None:
    from testbed.encounters.encounter import Aircraft
    from testbed.scenario.scenario import parse

    b, folder = load("field")
    of = b.sets[name].model_copy(update={"n": 6})
    found = meetings(of, b.seed, folder, name)
    assert [m.data for m in found[:3]] == [
        m.data for m in meetings(of.model_copy(update={"n": 3}), b.seed, folder, name)
    ]
    assert len({json.dumps(m.data["vehicle"]) for m in found}) == 6
    for m in found:
        s = parse(m.data)
        assert 12 <= s.duration_s <= 25
        each = [
            Aircraft("", np.array([[0.0, v.x_m, v.y_m, v.z_m]]), np.radians(v.course_deg), v.speed_mps)
            for v in s.vehicle
        ]
        assert least(each) >= 0.5


def test_it_goes_on_where_it_stopped_and_writes_the_page(file: Path, call: Callable[..., int]) -> None:
    out = file.parent / "out"
    assert call("benchmark", file, "--out", out, "--workers", 1, "--minutes", 1e-6) == 0
    assert not json.loads((out / "benchmark.json").read_text())["complete"]
    kept = (out / "journal.jsonl").read_text()
    assert call("benchmark", file, "--out", out, "--as-it-is") == 0
    assert (out / "journal.jsonl").read_text() == kept
    assert "1 of 7 runs are flown so far" in (out / "report.html").read_text(encoding="utf-8")
    assert call("benchmark", file, "--out", out, "--workers", 1) == 0
    journal = (out / "journal.jsonl").read_text()
    assert journal.startswith(kept) and journal.count("\n") == 7
    said = json.loads((out / "benchmark.json").read_text())
    assert said["complete"] and [c["runs"] for c in said["cells"]] == [3, 3, 1]
    text = (out / "report.html").read_text(encoding="utf-8")
    assert 'id="player-1"' in text and "Worst encounter: meeting" in text
    made = plan(*load(str(file)))
    assert fly_all(made, Journal(out / "journal.jsonl"), 1)


def test_runs_of_earlier_code_are_kept_only_if_samples_of_them_come_out_the_same(file: Path) -> None:
    made = plan(*load(str(file)))
    journal = Journal()
    assert fly_all(made, journal, 1, only=["none"]) and len(journal.entries) == 3
    assert fly_all(made, journal, 1)
    made.code = "1" * 16
    assert not rows(made, journal)
    confirm(made, journal, 1, 1)
    found = rows(made, journal)
    assert len(found) == made.size == 7 and sum(r["code"] == made.code for r in found) == 3
    assert kept(made, journal, found)["runs"] == 4 and kept(made, journal, found)["again"] == 2
    # A filter of which one run differs is flown anew; the others' runs stay.
    made.code = "2" * 16
    filters = {r["id"]: r["filter"] for r in found}
    for row in (e["row"] for e in journal.entries.values()):
        if filters[row["id"]] == "centralised":
            row["distance_m"] += 1e-3
    confirm(made, journal, 1, 1)
    assert {r["filter"] for r in rows(made, journal) if r["code"] != made.code} == {"none"}
    assert fly_all(made, journal, 1)
    assert all(r["code"] == made.code for r in rows(made, journal) if r["filter"] == "centralised")


def test_a_run_of_the_benchmark_is_the_run_of_its_scenario(file: Path) -> None:
    from testbed.simulation.simulate import run
    from testbed.studies.benchmark.flight import fly

    made = plan(*load(str(file)))
    flight = made.flight(Cell("centralised", "unicycle", "meeting"), 1)
    row = fly(flight)
    alone = run(flight.scenario(), force=True)
    assert row["distance_m"] == alone.guarantee("separation")["value"]
    assert flight.scenario().filter.kind == "centralised" and row["lost"] is False


def row(filter_: str, encounter: int, lost: bool) -> dict[str, Any]:
    return {
        "set": "s",
        "plant": "p",
        "filter": filter_,
        "encounter": str(encounter),
        "refused": "",
        "lost": lost,
    }


def test_equal_filters_are_never_ranked() -> None:
    rows = [row(name, k, k % 3 == 0) for name in "abcd" for k in range(100)]
    found = table.comparisons(rows, {"s": 2})
    assert len(found) == 6 and not any(c.sure for c in found)


def test_a_clear_difference_is_sure_and_names_the_better_one() -> None:
    rows = [row(name, k, name == "bad" and k < 40) for name in ("bad", "good", "none") for k in range(100)]
    found = table.comparisons(rows, {"s": 2}, without="none")
    assert [(c.first, c.second, c.sure) for c in found] == [("good", "bad", True)]


@given(st.lists(st.tuples(st.integers(0, 30), st.integers(0, 30)), min_size=1, max_size=8))
@settings(max_examples=30, deadline=None)
def test_holm_is_what_its_definition_says(counts: list[tuple[int, int]]) -> None:
    pairs = [
        paired_verdicts([True] * a + [False] * b, [False] * a + [True] * b)
        for a, b in counts
        if a + b or True
    ]
    found = [table.Comparison("f", "p", f"a{k}", f"b{k}", pair) for k, pair in enumerate(pairs)]
    marked = table.holm(found, 0.05)
    # The definition: the smallest rank whose p exceeds its bound, and every larger p, is not sure.
    p = sorted(c.pair.p_value for c in found)
    fails = [k for k, x in enumerate(p) if x > 0.05 / (len(p) - k)]
    assert sum(c.sure for c in marked) == (fails[0] if fails else len(p))
    assert all(
        c.sure or c.pair.p_value >= max((d.pair.p_value for d in marked if d.sure), default=0) for c in marked
    )


MISTAKES = {
    'name = "t"\n[filters.a]\n"filter.kind" = "none"\n[plants.u]\nplant = "unicycle"\n[sets.s]\nn = 2\n': (
        "sets.s: say file and format, or generate"
    ),
    TINY.replace('"head-on"', '"headon"'): "there is no kind 'headon'; did you mean head-on",
    TINY.replace('without = "none"', 'without = "nome"'): "without: no filter 'nome'; did you mean none",
    TINY.replace('"filter.kind" = "limited"', '"filter.kind" = "limitd"'): "filter.kind",
    TINY.replace('"filter.kind" = "limited"', '"filter.knd" = "limited"'): "filter.knd",
    TINY.replace(
        'generate = ["head-on", "crossing"]', 'file = "a.daa"\nformat = "daa"'
    ): "a.daa does not exist",
    TINY.replace("n = 3", "n = 1000000"): "n: input should be less than or equal to 100000",
    TINY + "[candidates]\nx = [{}]\n": "candidates: no filter 'x'",
}


@pytest.mark.parametrize("text", MISTAKES)
def test_a_mistake_in_the_file_is_one_line(
    text: str, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "b.toml"
    path.write_text(text)
    assert call("benchmark", path, "--out", tmp_path / "out") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1 and MISTAKES[text] in lines[0], lines
    assert not (tmp_path / "out").exists()


def test_the_guides_page_is_that_of_its_data() -> None:
    import runpy

    guide = Path(__file__).parent.parent / "docs"
    made = runpy.run_path(str(guide / "field_page.py"))["page"]()
    assert made == (guide / "guide" / "field.md").read_text(encoding="utf-8")
    data = json.loads((guide / "guide" / "data" / "field" / "benchmark.json").read_text())
    b = load("field")[0].model_dump(mode="json")
    # The page is of the benchmark that comes with the package, settings as its search chose them.
    assert data["benchmark"] == b
    searched = json.loads((guide / "guide" / "data" / "field" / "search.json").read_text())
    assert {r["filter"]: r["fields"] for r in searched["rows"] if r["chosen"]} == {
        name: b["filters"][name] for name in b["candidates"]
    }


def test_a_set_says_what_it_is_of() -> None:
    with pytest.raises(ValueError, match="format: say one of"):
        EncounterSet.model_validate({"file": "a.daa"})
