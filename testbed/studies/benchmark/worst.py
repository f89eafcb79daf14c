"""Finds the worst encounter of each set and flies it again under every filter, recorded for playback."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import tomli_w

from testbed.errors import UserError
from testbed.records.run import Run
from testbed.records.store import load
from testbed.scenario.location import moved
from testbed.studies.benchmark.benchmark import Cell, Plan

FOLDER = "worst"
# Vehicles in all runs of one playback: more make a page too large.
MOST_VEHICLES = 24


def worst(made: Plan, rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Per set, the encounter that most filters lost on the last plant; of equals the one of least distance.

    filters  those to show: all, or of a fleet the one that came nearest and the one it is compared with
    """
    b = made.benchmark
    plant = list(b.plants)[-1]
    found = []
    for set_ in b.sets:
        here = [r for r in rows if (r["set"], r["plant"]) == (set_, plant) and not r["refused"]]
        judged = [r for r in here if r["filter"] != b.without and r["distance_m"] is not None]
        if not judged:
            continue
        names = list(dict.fromkeys(r["encounter"] for r in judged))
        of = {name: [r for r in judged if r["encounter"] == name] for name in names}
        name = max(names, key=lambda n: (sum(r["lost"] for r in of[n]), -min(r["distance_m"] for r in of[n])))
        nearest = min(of[name], key=lambda r: r["distance_m"])
        flown = [r["filter"] for r in here if r["encounter"] == name]
        each = made.scenarios[Cell(flown[0], plant, set_)].vehicles
        if each * len(flown) > MOST_VEHICLES:
            flown = [f for f in flown if f in (nearest["filter"], b.first)]
        found.append(
            {
                "set": set_,
                "plant": plant,
                "encounter": name,
                "lost_by": [r["filter"] for r in of[name] if r["lost"]],
                "nearest": nearest["filter"],
                "distance_m": nearest["distance_m"],
                "filters": flown,
            }
        )
    return found


def fly(made: Plan, which: Sequence[Mapping[str, Any]], out: Path) -> None:
    """Run folders out/worst/SET/K of the encounters, and out/worst/SET.toml, the scenario of the nearest."""
    from testbed.simulation.simulate import run

    for w in which:
        numbers = [m.name for m in made.sets[w["set"]]]
        for k, name in enumerate(w["filters"]):
            flight = made.flight(Cell(name, w["plant"], w["set"]), numbers.index(w["encounter"]))
            s = flight.scenario()
            folder = out / FOLDER / w["set"] / str(k)
            run(s, folder, force=True, overwrite=True)
            if name == w["nearest"]:
                data = moved(s.model_dump(mode="json", exclude_defaults=True), out / FOLDER)
                (out / FOLDER / f"{w['set']}.toml").write_text(tomli_w.dumps(data), encoding="utf-8")


def runs(folder: Path, w: Mapping[str, Any]) -> dict[str, Run]:
    """Filter -> its run of a worst encounter, those that are there."""
    found = {}
    for k, name in enumerate(w["filters"]):
        where = folder / FOLDER / w["set"] / str(k)
        try:
            found[name] = load(where)
        except UserError:
            continue
    return found
