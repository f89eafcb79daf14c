"""Tuned gains, the paper's figures and searches as parts of a report."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    KEPT,
    LOST,
    OPEN,
    Block,
    Listing,
    Note,
    Part,
    Section,
    Table,
    download,
    read_csv,
)
from testbed.report.folder_files import about, attached, csv_text, finite, json_of, pictures, text_of

# Rows of a table on the page; its file has them all.
MOST_ROWS = 30


def tune(folder: Path, title: str) -> Part:
    """Swept or optimised gains."""
    data = json_of(folder / "tune.json")
    rows = data["rows"]
    blocks: list[Block] = []
    if (folder / "sweep.csv").is_file():
        text, status = f"{len(rows)} sets of gains flown", OPEN
        fewest = min(rows, key=lambda r: finite(r.get("missed")))
        where = ", ".join(f"{name} {value:.4g}" for name, value in fewest.items() if "." in name)
        details = [f"Fewest bounds of the step specification are missed at {where}: {fewest.get('missed')}."]
        blocks += pictures(
            folder,
            ("sweep",),
            "Scores, margins and the guarantee against the gain",
            folder / "sweep.csv",
            rows,
        )
        sheet = attached(folder / "sweep.csv")
    else:
        missed = sum(not r["met"] for r in rows)
        status = LOST if missed else KEPT
        text = (
            f"{missed} of {len(rows)} bounds missed"
            if missed
            else f"All {len(rows)} bounds of the step specification met"
        )
        details, sheet = [], download("CSV", "specification.csv", csv_text(rows))
    bad = frozenset(k for k, r in enumerate(rows) if r.get("met") is False)
    blocks.append(
        Table(rows, "A row per set of gains" if "met" not in rows[0] else "The specification", bad, sheet)
    )
    gains = folder / "gains.toml"
    if gains.is_file():
        blocks.append(Listing("gains.toml", text_of(gains)))
    return Part(
        title=title,
        what=f"Made by {data['command']}",
        status=status,
        headline=text,
        details=details,
        sections=[Section("Tuning", blocks), Section("Settings and provenance", settings.of_study(data))],
    )


def figures(folder: Path, title: str) -> Part:
    """The paper's figures redrawn, with their errors at the published points."""
    data = json_of(folder / "figures.json")
    sheets = [f.removesuffix(".png") for f in data["files"] if f.endswith(".png")]
    # The single panels of a figure, fig2a-speed, are on its sheet, fig2.
    names = [n for n in sheets if not any(n != s and n.startswith(s) for s in sheets)]
    blocks: list[Block] = [Table(rows, name.capitalize()) for name, rows in data["tables"].items() if rows]
    rows = data["tables"].get("errors at the published vertices", [])
    within = [r for r in rows if r.get("within")]
    return Part(
        title=title,
        what="The paper's figures, flown again.",
        status=OPEN if not rows else KEPT if len(within) == len(rows) else LOST,
        headline=f"{len(within)} of {len(rows)} published curves met" if rows else f"{len(names)} figures",
        sections=[
            Section("Tables", blocks),
            Section("Figures", [p for n in names for p in pictures(folder, (n,), n, None, [])]),
            Section("Files", [Table([{"file": f} for f in data["files"]])]),
        ],
    )


def falsify(folder: Path, title: str) -> Part:
    """The search for a scenario that breaks a guarantee."""
    from testbed.studies.falsify.study import counted, sentences

    data = json_of(folder / "falsify.json")
    found = "a counterexample was found" if data["violated"] else "no counterexample was found"
    bounds = {f"bound of {name}": value for name, value in data["bounds"].items()}
    search = {"guarantee": data["guarantee"], "budget": data["budget"], "seed of the search": data["seed"]}
    flights = read_csv(text_of(folder / "flights.csv"))
    shown = f", the first {MOST_ROWS} of {len(flights)}" if len(flights) > MOST_ROWS else ""
    sheet = folder / "flights.csv"
    path = "The counterexample" if data["violated"] else "The flight of the least margin"
    departures = Table(data["departures"]) if data["departures"] else Note("None: the scenario as it stands.")
    return Part(
        title=title,
        what=about(data, f"the search for what breaks {data['guarantee']}"),
        # A search that finds nothing proves nothing.
        status=LOST if data["violated"] else OPEN,
        headline=f"{data['guarantee'].capitalize()}: {found} in {counted(data['flights'], 'flight')}",
        details=sentences(data),
        sections=[
            Section("Departures from the scenario", [departures]),
            Section(
                "Flights",
                [
                    *pictures(
                        folder,
                        ("counterexample",),
                        f"{path}: paths, and distance and h of the worst pair",
                        None,
                        [],
                    ),
                    *pictures(folder, ("margin",), "The margin of every flight", sheet, flights),
                    Table(flights[:MOST_ROWS], "Flights" + shown, downloads=attached(sheet)),
                    Listing("scenario.toml, which shows it", text_of(folder / "scenario.toml")),
                ],
            ),
            Section(
                "Settings and provenance",
                [
                    Table([{"what": k, "value": v} for k, v in (search | bounds).items()], "The search"),
                    *settings.of_study(data | {"command": data["reproduce"]}),
                ],
            ),
        ],
    )
