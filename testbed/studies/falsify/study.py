"""Writes what the search found: a scenario file that shows it, tables, two figures."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from math import isnan
from pathlib import Path
from typing import Any

from testbed.records.run import Run
from testbed.records.store import staged, write_json
from testbed.requirements.requirement import entry as judged
from testbed.scenario.location import moved, placed
from testbed.scenario.scenario import Scenario, load, parse
from testbed.simulation.simulate import run as fly
from testbed.studies.common.found import Found, titled
from testbed.studies.falsify import figures
from testbed.studies.falsify.falsify import Falsified
from testbed.studies.falsify.flights import Flight

FILE = "scenario.toml"


def write(result: Falsified, out: Path, overwrite: bool, parts: Sequence[str] = ()) -> Found:
    """Write `out`: scenario.toml, falsify.json, flights.csv, figures; what to print of it.

    parts  the user's own as `--parts` names them, for the command that reproduces it
    The file is flown once more, as it stands there. Raises RuntimeError if that gives another value than
    the search saw: then a run depends on something that its scenario does not say.
    """
    import pandas as pd

    shown = result.shrunk or result.least
    s = described(result, shown)
    with staged(out, overwrite) as folder:
        (folder / FILE).write_text(text(s, heading(result, shown, out, parts), folder), encoding="utf-8")
        again = fly(load(folder / FILE), parts=result.search.parts)
        entry = judged(again, result.guarantee)
        if entry["value"] != shown.value:
            raise RuntimeError(f"flown again, {result.guarantee} is {entry['value']!r}, not {shown.value!r}")
        data = account(result, shown, out, parts) | {"margin_unit": entry["unit"]}
        data |= {k: again.manifest[k] for k in ("versions", "airframes", "parts") if k in again.manifest}
        stages = [("search", result.search)] + ([("shrink", result.shrinks)] if result.shrinks else [])
        rows = [{"part": stage} | _flight(f) for stage, flights in stages for f in flights.flown]
        pd.DataFrame(rows).to_csv(folder / "flights.csv", index=False)
        figures.margins(result, entry["unit"], folder)
        figures.counterexample(again, entry, folder)
        write_json(folder / "falsify.json", data | {"scenario": s.model_dump(mode="json")})
    rows = [_printed(row) for row in result.space.values(shown.x) if shown.violated or _close(row, shown)]
    return Found(out, _title(result, shown, again), rows, sentences(data), data)


def described(result: Falsified, shown: Flight) -> Scenario:
    """The scenario of `shown`, named after what it is."""
    s = result.space.at(shown.x)
    what = "Counterexample" if shown.violated else "Least margin found, no violation"
    value = f"{result.guarantee} {shown.value:.6g}"
    return s.model_copy(
        update={
            "name": f"{s.name[:88]}-falsified",
            "description": f"{what}: {value}, from {s.name} by testbed falsify",
        }
    )


def text(s: Scenario, heading: str, folder: Path) -> str:
    """`s` as a scenario file in `folder`, defaults left out; RuntimeError if it does not read back as `s`."""
    import tomli_w

    written = "".join(f"# {line}\n" for line in heading.splitlines())
    written += tomli_w.dumps(moved(s.model_dump(mode="json", exclude_defaults=True), folder))
    if parse(placed(tomllib.loads(written), folder)) != s:
        raise RuntimeError("the scenario file written does not read back as the scenario")
    return written


def heading(result: Falsified, shown: Flight, out: Path, parts: Sequence[str] = ()) -> str:
    said = f"{result.guarantee}: {shown.value!r}, margin {shown.margin!r}"
    return f"{said}\nReproduce: {command(out, parts)}"


def command(out: Path, parts: Sequence[str] = ()) -> str:
    import shlex

    own = "".join(f" --parts {shlex.quote(text)}" for text in parts)
    return f"testbed run {shlex.quote(str(out / FILE))}{own}"


def account(result: Falsified, shown: Flight, out: Path, parts: Sequence[str] = ()) -> dict[str, Any]:
    """What falsify.json says, but for the scenario."""
    search, shrinks = result.search, result.shrinks
    return {
        "guarantee": result.guarantee,
        "violated": shown.violated,
        "budget": result.budget,
        "seed": result.seed,
        "bounds": vars(result.space.bounds),
        "flights": len(search.flown),
        "refused": sum(bool(f.refused) for f in search.flown),
        "nominal": search.flown[0].row(),
        "found": result.found.row() if result.found else None,
        "found_departures": result.space.values(result.found.x) if result.found else [],
        "least": result.least.row(),
        "shrink_flights": len(shrinks.flown) if shrinks else 0,
        "shrink_ended": bool(shrinks is None or shrinks.left > 0),
        "result": shown.row(),
        "departures": result.space.values(shown.x),
        "reproduce": command(out, parts),
    }


def sentences(data: dict[str, Any]) -> list[str]:
    """The account in words."""
    unit = f" {data['margin_unit']}" if data.get("margin_unit") else ""
    lines = [f"as it stands: margin {data['nominal']['margin']:.3f}{unit}"]
    result = data["result"]
    when = "" if isnan(result["t_s"]) else f"at {result['t_s']:.3f} s, "
    at = f"{when}vehicles {_names(result)}" if result["vehicles"] else when.rstrip(", ")
    if data["violated"] and not data["departures"]:
        lines = [f"violated as it stands, nothing was searched: margin {result['margin']:.3g}{unit} {at}"]
    elif data["violated"]:
        found = data["found"]
        lines.append(
            f"violated at flight {found['number']} of at most {data['budget']} ({found['stage']}):"
            f" margin {found['margin']:.3f}{unit}, {counted(len(data['found_departures']), 'departure')}"
        )
        lines.append(
            f"shrunk in {counted(data['shrink_flights'], 'flight')} to"
            f" {counted(len(data['departures']), 'departure')}: margin {result['margin']:.3g}{unit} {at}"
        )
        if not data["shrink_ended"]:
            lines.append("the shrinking spent its budget: smaller departures may violate too")
    else:
        lines.append(
            f"no violation in {counted(data['flights'], 'flight')}; the least margin is"
            f" {data['least']['margin']:.3f}{unit}. A search that finds nothing proves nothing"
        )
    if data["refused"]:
        were = "start was" if data["refused"] == 1 else "starts were"
        lines.append(f"{data['refused']} {were} refused, being outside the safe set or not flyable")
    return [*lines, f"reproduce: {data['reproduce']}"]


def counted(count: int, what: str) -> str:
    return f"{count} {what}" + ("" if count == 1 else "s")


def _names(row: dict[str, Any]) -> str:
    return " and ".join(map(str, row["vehicles"]))


def _flight(flight: Flight) -> dict[str, Any]:
    return flight.row() | {"vehicles": "-".join(map(str, flight.vehicles))}


def _title(result: Falsified, shown: Flight, run: Run) -> str:
    unit = judged(run, result.guarantee)["unit"]
    what = "smallest departures found that violate" if shown.violated else "departures of the least margin"
    s = result.space.scenario
    return f"{titled(s, result.search.parts)}: {what} {result.guarantee} ({shown.value:.4g} {unit})"


def _close(row: dict[str, Any], shown: Flight) -> bool:
    """Of a search that found nothing, the departures of the closest pair and the weather are printed."""
    return row.get("vehicle") is None or row["vehicle"] in shown.vehicles


def _printed(row: dict[str, Any]) -> dict[str, Any]:
    towards = f" towards {row['towards_deg']:.4g} deg" if "towards_deg" in row else ""
    return {
        "departure": row["kind"],
        "vehicle": row.get("vehicle", ""),
        "by": f"{row['value']:+.6g} {row['unit']}{towards}",
    }
