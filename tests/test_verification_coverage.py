"""All of a run folder is checked or named as not covered; forgeries of it differ or touch what is named."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from testbed.errors import UserError
from testbed.records.run import (
    AIRCRAFT_COLUMNS,
    DECLARED_COLUMNS,
    FENCE_COLUMNS,
    LEFT_COLUMNS,
    PAIR_COLUMNS,
    VEHICLE_COLUMNS,
    WIND_COLUMNS,
)
from testbed.records.verdict import Verdict
from testbed.scenario.scenario import builtin, load
from testbed.simulation.refly import refly
from testbed.simulation.simulate import run
from testbed.verification import coverage_table
from testbed.verification.check import check, verify
from testbed.verification.coverage import entry, items
from testbed.verification.recorded import read
from tests.forgeries import FIELDS, RUNS, Forgery, forgeries
from tests.forgery import copied, seal

EVERY = forgeries()
# Of the forgeries that are flown again, so many in every run of the tests: evenly through the list.
SAMPLE = EVERY[::20]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The folder of a run of RUNS, flown when first asked for."""
    folder, done = tmp_path_factory.mktemp("covered"), set()

    def of(name: str) -> Path:
        if name not in done:
            run(load("paper-2-turn", RUNS[name]), folder / name)
            assert [f for f in verify(folder / name) if f.agrees is False] == [], name
            done.add(name)
        return folder / name

    return of


def forged(flown: Callable[[str], Path], tmp_path: Path, forgery: Forgery) -> Path:
    folder = copied(flown(forgery.run), tmp_path / "x")
    forgery.change(folder)
    seal(folder)
    return folder


def missed(folder: Path, forgery: Forgery) -> set[str]:
    """What is changed and neither makes the verification differ nor is listed as not covered."""
    try:
        checked = check(folder)
    except UserError:  # it cannot even be read as a run
        return set()
    if any(f.agrees is False for f in checked.findings):
        return set()
    return set(forgery.items) - {u.what for u in checked.uncovered}


@pytest.mark.slow
@pytest.mark.parametrize("forgery", EVERY, ids=str)
def test_a_forgery_differs_or_touches_what_is_not_covered(
    flown: Callable[[str], Path], tmp_path: Path, forgery: Forgery
) -> None:
    assert missed(forged(flown, tmp_path, forgery), forgery) == set()


@pytest.mark.slow
@pytest.mark.parametrize("forgery", [f for f in SAMPLE if f.fly], ids=str)
def test_a_forgery_is_found_when_flown_again(
    flown: Callable[[str], Path], tmp_path: Path, forgery: Forgery
) -> None:
    found_when_flown(flown, tmp_path, forgery)


@pytest.mark.soak
@pytest.mark.parametrize("forgery", [f for f in EVERY if f.fly], ids=str)
def test_every_forgery_is_found_when_flown_again(
    flown: Callable[[str], Path], tmp_path: Path, forgery: Forgery
) -> None:
    found_when_flown(flown, tmp_path, forgery)


def found_when_flown(flown: Callable[[str], Path], tmp_path: Path, forgery: Forgery) -> None:
    folder = forged(flown, tmp_path, forgery)
    try:
        findings = [*verify(folder), *refly(folder)]
    except UserError:
        return
    assert any(f.agrees is False for f in findings)


def test_there_are_a_hundred_forgeries_and_more() -> None:
    assert len(EVERY) >= 150 and len({str(f) for f in EVERY}) == len(EVERY)
    assert sum(len(fields) for fields in FIELDS.values()) >= 40


def test_the_table_has_every_column_that_the_writer_knows() -> None:
    assert set(coverage_table.VEHICLES) == {*VEHICLE_COLUMNS, *AIRCRAFT_COLUMNS, *WIND_COLUMNS, *LEFT_COLUMNS}
    assert set(coverage_table.PAIRS) == {*PAIR_COLUMNS, *DECLARED_COLUMNS}
    assert set(coverage_table.FENCES) == set(FENCE_COLUMNS)
    assert {*coverage_table.FIELDS, "detail"} == set(Verdict.__annotations__) - {
        "kind", "instant", "status"
    } | {"t_s", "verdict"}  # fmt: skip


def folders(tmp_path: Path) -> Iterator[Path]:
    """Runs of every built-in scenario, of a monitor, lags, plans, near pairs, and one that ended early."""
    short = ["duration_s=0.1", "filter_dt_s=0.005", "record_dt_s=0.005", "manoeuvre_instants=1"]
    for name in builtin():
        yield Path(run(load(name, short), tmp_path / name, force=True).path or "")
    for k, more in enumerate(
        (
            ["filter.monitor=true"],
            ["plant=lagged", "lags.source=table"],
            ["plant=jsbsim"],
            ['goal.on_arrival="leave"'],
            ['guidance={kind="track", rows=[[0, -200, 0, 0], [9, 0, 0, 0]]}'],
            ["sensing.range_m=300"],
            ["filter.kind=flow", "filter.margin_m=identified", "plant=lagged", "lags.source=airframe"],
            ["filter.kind=gatekeeper", "plant=lagged", "filter_dt_s=0.05", "record_dt_s=0.05"],
            ['fence=[{kind="heights", floor_m=-50}]'],
            ["vehicles=81", "start.radius_m=400", "manoeuvre_instants=0"],
        )
    ):
        yield Path(run(load("paper-2-turn", [*short, *more]), tmp_path / f"{k}").path or "")


def test_the_table_has_every_field_of_runs_and_names_only_findings_that_there_are(
    tmp_path: Path,
) -> None:
    """A name in the table that no verification ever reports would cover nothing."""
    seen: set[str] = set()
    for folder in folders(tmp_path):
        recorded = read(folder)
        assert {name for name in items(recorded) if entry(name, recorded) is None} == set(), folder.name
        seen |= {f.what for f in verify(folder)}
    tables = (
        coverage_table.VEHICLES, coverage_table.PAIRS, coverage_table.MANIFEST, coverage_table.SCENARIO,
        coverage_table.FIELDS, coverage_table.TIMING, coverage_table.FENCES, *coverage_table.DETAILS.values(),
    )  # fmt: skip
    named = {what for table in tables for checked in table.values() for what in checked.by if what}
    assert named <= seen


def test_the_command_lists_what_is_not_covered(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    run(load("paper-2-turn", ["duration_s=0.1", "manoeuvre_instants=0"]), tmp_path / "r")
    assert call("verify", tmp_path / "r") == 0
    text = capsys.readouterr().out
    assert "not covered: manifest.versions" in text and "why of every claim" in text
    assert max(map(len, text.splitlines())) <= 80
