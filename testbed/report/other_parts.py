"""Tuned gains, the paper's figures, searches, and folders nothing more is known of, as parts of a report."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import KEPT, LOST, OPEN, Block, Listing, Part, Section, Table, download, read_csv
from testbed.report.folder_files import about, attached, csv_text, finite, json_of, pictures, text_of

# Rows of a table on the page; its file has them all.
MOST_ROWS = 200


def tune(folder: Path, title: str) -> Part:
    """Swept or optimised gains."""
    data = json_of(folder / "tune.json")
    rows = data["rows"]
    blocks: list[Block] = []
    if (folder / "sweep.csv").is_file():
        text, status = f"{len(rows)} sets of gains flown", OPEN
        fewest = min(rows, key=lambda r: finite(r.get("missed")))
        details = [f"Fewest bounds of the step specification missed at one of them: {fewest.get('missed')}."]
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
    from testbed.studies.falsify_report import sentences

    data = json_of(folder / "falsify.json")
    found = "a counterexample was found" if data["violated"] else "no counterexample was found"
    return Part(
        title=title,
        what=about(data, f"the search for what breaks {data['guarantee']}"),
        # A search that finds nothing proves nothing.
        status=LOST if data["violated"] else OPEN,
        headline=f"{data['guarantee']}: {found} in {data['flights']} flights",
        details=sentences(data),
        sections=[
            Section("Departures from the scenario", [Table(data["departures"])]),
            Section("Figures and tables", _everything(folder)),
            Section("Settings and provenance", settings.of_study(data | {"command": data["reproduce"]})),
        ],
    )


def anything(folder: Path, title: str) -> Part:
    """A folder of which no more is known than its files."""
    return Part(
        title=title,
        what="Figures and tables of the folder.",
        status=OPEN,
        headline="Not a verdict: figures and tables",
        sections=[Section("Figures and tables", _everything(folder))],
    )


def _everything(folder: Path) -> list[Block]:
    names = sorted(f.stem for f in folder.glob("*.png"))
    tables = sorted(folder.glob("*.csv"))
    return [
        *(p for name in names for p in pictures(folder, (name,), name.capitalize(), None, [])),
        *(Table(read_csv(text_of(f))[:MOST_ROWS], f.name, downloads=attached(f)) for f in tables),
        *(Listing(f.name, text_of(f)) for f in sorted([*folder.glob("*.json"), *folder.glob("*.toml")])),
    ]
