"""Flies what the paper's figures need, draws them, and writes the numbers beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.engine import fly_all
from testbed.campaigns.journal import Journal, journal_beside
from testbed.claims.registry import GOAL, QP_FEASIBILITY, SAFE_SET, SEPARATION
from testbed.errors import UserError
from testbed.records.store import check_free, staged, write_json
from testbed.scenario.scenario import Scenario, load
from testbed.studies.kink import kink
from testbed.studies.onset import onset
from testbed.studies.paper import reproduction

if TYPE_CHECKING:
    import pandas as pd


@dataclass
class Book:
    """What was written, and the tables to print.

    files    below the folder, by name
    tables   title -> rows; every number is also in a file
    """

    folder: Path
    files: list[str] = field(default_factory=list)
    tables: dict[str, list[dict[str, Any]]] = field(default_factory=dict)

    def summary(self) -> dict[str, Any]:
        return {"folder": str(self.folder), "files": self.files, "tables": self.tables}


@dataclass(frozen=True)
class Flight:
    scenario: Scenario
    folder: Path


def make(
    out: Path,
    what: Sequence[str] = ("paper",),
    *,
    plant: str = "unicycle",
    overrides: Sequence[str] = (),
    seeds: int = 20,
    workers: int | None = None,
    overwrite: bool = False,
) -> Book:
    """Write the figures and tables named in `what` (paper, onset, kink) into `out`.

    plant      of the paper's figures; the two studies are about the unicycle
    overrides  `field=value`, of every scenario flown
    seeds      headings of the kink study, counted from 1
    Raises     UserError before anything is flown where that can be known
    """
    if plant != "unicycle" and tuple(what) != ("paper",):
        raise UserError("--plant: the kink and the onset are studied on the unicycle; leave it out")
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: at least one")
    # The kink study keeps its rows beside `out` while it runs: that name must be free first.
    check_free(out, overwrite)
    book = Book(out)
    with staged(out, overwrite) as folder:
        for name in what:
            if name == "paper":
                _paper(book, folder, plant, overrides, workers)
            elif name == "onset":
                _onset(book, folder, tuple(overrides), workers)
            else:
                with journal_beside(out, "kink") as kept:
                    _kink(book, folder, kept, tuple(overrides), seeds, workers)
        book.files += ["figures.json"]
        write_json(folder / "figures.json", {"files": book.files, "tables": book.tables})
    return book


def fly(flight: Flight) -> dict[str, Any]:
    """Fly into a run folder; the verdicts."""
    from testbed.simulation.simulate import run

    done = run(flight.scenario, flight.folder)
    return {g["id"]: g["value"] for g in done.guarantees}


def _paper(book: Book, folder: Path, plant: str, overrides: Sequence[str], workers: int | None) -> None:
    from testbed.records.store import load as load_run
    from testbed.studies.paper import figures

    flights = [
        Flight(_of_the_paper(name, plant, overrides), folder / "runs" / name)
        for figure in figures.FIGURES
        for name in figure.scenarios.values()
    ]
    # The twenty-vehicle runs take longest: begin with them.
    flights.sort(key=lambda f: -f.scenario.vehicles)
    fly_all(fly, flights, workers, lambda f, v: f"{f.scenario.name}: least distance {v['separation']:.3f} m")
    runs = {f.scenario.name: load_run(f.folder) for f in flights}
    for figure in figures.FIGURES:
        series = {name: runs[s] for name, s in figure.scenarios.items()}
        book.files += [f.name for f in figures.draw(figure, series, folder)]
        if figure.name == "fig2" and plant == "unicycle":
            rows = reproduction.table(series)
            _write(book, folder, "reproduction", "errors at the published vertices", rows, ("mean_error",))
    _write(
        book,
        folder,
        "separation",
        "smallest distances",
        [
            {
                "scenario": name,
                "min_distance_m": run.guarantee(SEPARATION.id)["value"],
                "at_s": run.guarantee(SEPARATION.id)["t_s"],
                "min_h_m": run.guarantee(SAFE_SET.id)["value"],
                "unsolved": run.guarantee(QP_FEASIBILITY.id)["value"],
                "goal_m": run.guarantee(GOAL.id)["value"],
                "ended_early": run.manifest["ended_early"],
            }
            for name, run in runs.items()
        ],
    )


def _of_the_paper(name: str, plant: str, overrides: Sequence[str]) -> Scenario:
    # Twenty vehicles have 190 pairs: every fourth step is enough to draw, extremes are kept at every step.
    thin = ["record_dt_s=0.02"] if name.startswith("published-20") else []
    return load(name, [*thin, f"plant={plant}", *overrides])


def _onset(book: Book, folder: Path, overrides: tuple[str, ...], workers: int | None) -> None:
    from testbed.studies.onset import figures

    onsets = onset.study(overrides, workers)
    medians = tuple(f"median_{name}_s" for name in ("override", "turn_1degps", "lateral_1m"))
    _write(book, folder, "onset", "when overriding begins", onset.table(onsets), medians)
    book.files += [f.name for f in figures.onset(onsets, folder)]


def _kink(
    book: Book, folder: Path, kept: Journal, overrides: tuple[str, ...], seeds: int, workers: int | None
) -> None:
    from testbed.studies.kink import figures

    cases, crowd = kink.perturbed(seeds, overrides), kink.crowded(seeds, overrides)
    rows = kink.study([*crowd, *cases], kept, workers)
    table = rows.iloc[len(crowd) :].reset_index(drop=True)
    book.files += ["kink.csv", "kink-50.csv"]
    table.to_csv(folder / "kink.csv", index=False, float_format="%.9g")
    rows.iloc[: len(crowd)].to_csv(folder / "kink-50.csv", index=False, float_format="%.9g")
    d_safe = cases[0].scenario().d_safe_m
    _write(
        book,
        folder,
        "kink-summary",
        "the kink",
        kink.summary(rows, d_safe),
        ("worst_qp_residual", "median_m"),
    )
    seen = kink.look(kink.worst(table, cases, d_safe))
    book.files += [f.name for f in figures.kink(table, seen, d_safe, folder)]


def _write(
    book: Book,
    folder: Path,
    name: str,
    title: str,
    rows: list[dict[str, Any]] | pd.DataFrame,
    unseen: tuple[str, ...] = (),
) -> None:
    """One table as NAME.csv, and for printing, without the columns `unseen`."""
    import pandas as pd

    table = pd.DataFrame(rows)
    table.to_csv(folder / f"{name}.csv", index=False, float_format="%.9g")
    book.files.append(f"{name}.csv")
    # A terminal has 80 columns; the file has them all.
    book.tables[title] = table.drop(columns=[c for c in unseen if c in table]).to_dict("records")
