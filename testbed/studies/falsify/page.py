"""Makes the part of a page about a search for violations."""

from __future__ import annotations

from pathlib import Path

from testbed.report import settings
from testbed.report.blocks import (
    LOST,
    OPEN,
    Listing,
    Note,
    Part,
    Section,
    Table,
    read_csv,
)
from testbed.report.folder_files import (
    about,
    attached,
    json_of,
    pictures,
    text_of,
)
from testbed.studies.falsify.study import counted, sentences

# Rows of a table on the page; its file has them all.
MOST_ROWS = 30


def part(folder: Path, title: str) -> Part:
    """The search for a scenario that breaks a guarantee."""
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
