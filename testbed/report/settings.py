"""Makes the tables of settings and provenance: everything that a result depends on."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from testbed.records.run import Run
from testbed.report.blocks import Block, Listing, Table, cell, download
from testbed.report.own_parts import origins

# A list longer than this is only counted.
LISTED = 40


def of_runs(runs: Mapping[str, Run]) -> list[Block]:
    """Fields that are not defaults, side by side; what made the files; every field, folded."""
    scenarios = {label: run.manifest["scenario"] for label, run in runs.items()}
    return [
        Table(changed(scenarios), "Settings that are not defaults, or differ between the runs"),
        Table(_made(runs), "What made these files"),
        *(listing(f"every setting of {label}", scenario) for label, scenario in scenarios.items()),
    ]


def of_study(data: Mapping[str, Any]) -> list[Block]:
    """The same from a study's JSON file: its scenario, seeds and versions, those that it has."""
    blocks: list[Block] = []
    scenario = data.get("scenario")
    if scenario:
        blocks.append(Table(changed({"value": scenario}), "Settings that are not defaults"))
    keys = (
        "seeds",
        "command",
        "knob",
        "unit",
        "target_rate",
        "schema_version",
        "versions",
        "airframes",
        "code",
    )
    rows = [{"what": k.replace("_", " "), "value": said(data[k])} for k in keys if data.get(k) is not None]
    if scenario:
        rows.append({"what": "scenario schema version", "value": said(scenario.get("schema_version"))})
        rows.append({"what": "scenario seed", "value": said(scenario.get("seed"))})
    if rows:
        blocks.append(Table(rows, "What made these files"))
    if scenario:
        blocks.append(listing("every setting", scenario))
    return blocks


def listing(title: str, scenario: Mapping[str, Any]) -> Listing:
    text = json.dumps(scenario, indent=2, ensure_ascii=False)
    return Listing(title, text, download("JSON", "scenario.json", text))


def changed(scenarios: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Dotted field -> value in each scenario, where it is no default or they differ."""
    from testbed.scenario.defaults import defaults
    from testbed.scenario.scenario import without_foreign
    from testbed.scenario.spelling import current

    scenarios = {label: current(s) for label, s in scenarios.items()}
    # Scenarios of schema 1 have fields of other kinds too, at their defaults.
    flat = {label: _flat(without_foreign(s)[0]) for label, s in scenarios.items()}
    usual = {path: value for s in scenarios.values() for path, value in defaults(s).items()}
    usual |= {"name": "x", "vehicles": 1}
    fields = dict.fromkeys(f for of in flat.values() for f in of)
    rows = []
    for field in fields:
        values = [of.get(field) for of in flat.values()]
        if any(v != values[0] for v in values) or values[0] != usual.get(field):
            rows.append({"field": field} | {label: said(of.get(field)) for label, of in flat.items()})
    return rows


def _flat(data: Mapping[str, Any], above: str = "") -> dict[str, Any]:
    flat: dict[str, Any] = {}
    for key, value in data.items():
        if isinstance(value, Mapping):
            flat |= _flat(value, f"{above}{key}.")
        else:
            flat[above + key] = value
    return flat


def said(value: Any) -> str:
    if isinstance(value, Mapping):
        return "; ".join(f"{k} {said(v)}" for k, v in value.items())
    if isinstance(value, list) and value and (isinstance(value[0], Mapping) or len(value) > LISTED):
        return f"{len(value)} entries"
    return cell(value)


def _made(runs: Mapping[str, Run]) -> list[dict[str, Any]]:
    """Rows: what | value in each run."""

    def row(what: str, of: Any) -> dict[str, Any]:
        return {"what": what} | {label: said(of(run)) for label, run in runs.items()}

    manifest = next(iter(runs.values())).manifest
    rows = [
        row("schema version", lambda r: r.manifest["schema_version"]),
        row("seed", lambda r: r.manifest["scenario"]["seed"]),
        row("named random streams", lambda r: r.manifest["seed_streams"]),
        row("filter steps flown", lambda r: r.manifest["filter_steps"]),
        row("ended early", lambda r: r.manifest["ended_early"] or "no"),
        row("worst QP residual", lambda r: r.manifest["worst_qp_residual"]),
        row("airframe files, SHA-256", lambda r: r.manifest["airframes"] or "none"),
        row("time it took [s]", lambda r: r.timing.get("wall_s")),
    ]
    flown = {part for run in runs.values() for part in origins(run.manifest)}
    rows += [
        row(f"{part} of the user's own", lambda r, p=part: origins(r.manifest).get(p, "the scenario's"))
        for part in sorted(flown)
    ]
    return rows + [
        row(f"version of {name}", lambda r, n=name: r.manifest["versions"].get(n))
        for name in manifest["versions"]
    ]
