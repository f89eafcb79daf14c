"""Makes a campaign's part of a page: rates and distances of many runs, cell by cell."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.distinct import counted
from testbed.campaigns.folder import MANIFEST, RUNS, SUMMARY
from testbed.campaigns.identity import changed_airframes
from testbed.claims.registry import GOAL, MANOEUVRE_KEEPS_DS, SEPARATION, SEPARATION_INTRUDERS
from testbed.records.verdict import Status
from testbed.report import embed, settings
from testbed.report.blocks import KEPT, LOST, OPEN, Block, Fact, Part, Picture, Section, Table, download
from testbed.report.own_parts import of_campaign
from testbed.report.style import drawing
from testbed.statistics import Rate

if TYPE_CHECKING:
    import pandas as pd

# Cells whose rate stands beside the verdict; all are in the table.
MOST_FACTS = 24


# Guarantees whose values are distances, judged by Ds.
DISTANCES = (SEPARATION.id, SEPARATION_INTRUDERS.id, MANOEUVRE_KEEPS_DS.id)


def part(folder: Path, title: str) -> Part:
    """A campaign's part of a page; of one that is not finished it says so."""
    import pandas as pd

    manifest = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    flown = (folder / SUMMARY).is_file() and (folder / RUNS).is_file()
    if not flown:
        return Part(
            title, "a campaign", OPEN, "The campaign is not finished", ["The same command goes on with it."]
        )
    found = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
    cells = found["cells"]
    runs = pd.read_parquet(folder / RUNS)
    guarantee = _guarantee(manifest)
    facts = [_fact(cell) for cell in cells]
    lost, held = sum(c["lost"] for c in cells), [c for c in cells if c["lost"] == 0]
    text = f"{lost} of {sum(c['runs'] for c in cells)} runs lose {guarantee}"
    if len(cells) > 1:
        text += f"; none in {len(held)} of {len(cells)} cells"
    voided = sum(c.get("refused", 0) + c.get("failed", 0) for c in cells)
    details = [f"A run counts as lost unless {guarantee} holds."]
    # Campaigns of earlier versions did not count distinct results.
    if all("distinct" in c for c in cells):
        details.append(counted(sum(c["runs"] for c in cells), sum(c["distinct"] for c in cells)) + ".")
    if voided:
        details.append(f"{voided} of them were refused or failed.")
    details += [
        f"Airframe {name} has changed since; these are the numbers of the earlier one."
        for name in changed_airframes(manifest.get("airframes") or {})
    ]
    details += of_campaign(manifest)
    rows = [_row(c) for c in cells]
    tables: list[Block] = [
        Table(
            rows,
            f"A row per cell; {_quantity(guarantee)}",
            downloads=download("cells (CSV)", "cells.csv", pd.DataFrame(rows)),
        )
    ]
    return Part(
        title=f"campaign {manifest['name']}",
        what=f"{len(runs)} runs in {len(cells)} cells. {manifest['campaign']['description']} Folder: {title}",
        status=LOST if lost else KEPT,
        headline=text,
        details=details,
        facts=facts[:MOST_FACTS],
        sections=[
            Section("Campaign", [_picture(cells, runs, guarantee, manifest), *tables]),
            Section("Settings and provenance", [_asked(manifest), *_provenance(manifest)]),
        ],
    )


def _guarantee(manifest: Mapping[str, Any]) -> str:
    return str(manifest["campaign"]["guarantee"])


def _quantity(guarantee: str) -> str:
    return "distances [m]" if guarantee in DISTANCES else f"values of {guarantee}"


def _asked(manifest: Mapping[str, Any]) -> Block:
    """The campaign's file: axes, draws, seeds and stopping rule, those that it has."""
    asked = {k: v for k, v in manifest["campaign"].items() if v not in (None, [], {}, "")}
    return Table([{"field": k, "value": settings.said(v)} for k, v in asked.items()], "The campaign")


def _provenance(manifest: Mapping[str, Any]) -> list[Block]:
    recorded = manifest.get("airframes") or {}
    airframes = {name: sha for hashes in recorded.values() for name, sha in hashes.items()}
    return settings.of_study({**manifest, "scenario": _base(manifest), "airframes": airframes or None})


def _base(manifest: Mapping[str, Any]) -> Any:
    base = manifest.get("base")
    return base if isinstance(base, Mapping) else None


def _fact(cell: Mapping[str, Any]) -> Fact:
    text = (
        f"{cell['lost']} of {cell['runs']} runs lost ({100 * cell['confidence']:g} % interval"
        f" {100 * cell['rate_low']:.1f} to {100 * cell['rate_high']:.1f} %, {Rate.method})"
    )
    share = cell["lost"] / cell["runs"] if cell["runs"] else None
    return Fact(cell["cell"], LOST if cell["lost"] else KEPT, text, share, rate=True)


def _row(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Numbers of a cell, what is nested written out."""
    low, pair = cell["quantile_05"], cell["against_first"] or {}
    keep = ["cell", "runs", "distinct", "lost", "rate_low", "rate_high"]
    keep += ["refused", "failed", "ended_early", "least"]
    arrived = {k: cell[k] for k in ("arrived", "with_goal", "time_added_s") if k in cell}
    return (
        {k: cell.get(k) for k in keep}
        | arrived
        | {
            "quantile_05": low[0],
            "median": cell["median"],
            "decision": cell["decision"],
            "lost only here": pair.get("only_this"),
            "lost only in the first": pair.get("only_first"),
            "p": pair.get("p_value"),
        }
    )


def _picture(
    cells: list[dict[str, Any]], runs: pd.DataFrame, guarantee: str, manifest: Mapping[str, Any]
) -> Picture:
    from testbed.report.campaign_figures import cells as draw

    name = guarantee.replace("-", "_")
    judged = [_of_cell(runs, c).dropna(subset=[f"{name}_value"]) for c in cells]
    values = [of[f"{name}_value"].to_numpy(dtype=float) for of in judged]
    lost = [(of[f"{name}_verdict"] != Status.HOLDS.value).to_numpy() for of in judged]
    with drawing():
        svg = embed.markup(draw(cells, values, lost, _bound(guarantee, manifest, runs), guarantee))
    least = "; ".join(f"{c['cell']}: {c['lost']} of {c['runs']} lost" for c in cells[:MOST_FACTS])
    return Picture(
        name="cells",
        caption=f"Left the share of runs that lose {guarantee}, with its interval; right every run's value,"
        " crossed where it lost; the median a bar, a bound common to all dotted.",
        alt=f"Cell by cell: {least}.",
        svg=svg,
        downloads=download("every run (CSV)", "runs.csv", runs),
    )


def _bound(guarantee: str, manifest: Mapping[str, Any], runs: pd.DataFrame) -> float | None:
    """The bound that all runs are judged by; None where it differs between them."""
    field = (dict.fromkeys(DISTANCES, "d_safe_m") | {GOAL.id: "goal_radius_m"}).get(guarantee)
    if field is None:
        return 0.0
    base = _base(manifest) or {}
    return None if field in runs or _varied(manifest, field) else base.get(field)


def _varied(manifest: Mapping[str, Any], field: str) -> bool:
    """Whether a variant sets the field: then it is no column of its own."""
    return any(field in fields for fields in manifest["campaign"].get("variants", {}).values())


def _of_cell(runs: pd.DataFrame, cell: Mapping[str, Any]) -> pd.DataFrame:
    for name, value in cell["parameters"].items():
        # As the table holds them: numbers as floats, words as they are, the rest as JSON.
        plain = runs[name].dtype.kind in "fb" or isinstance(value, str)
        runs = runs[runs[name] == (value if plain else json.dumps(value))]
    return runs
