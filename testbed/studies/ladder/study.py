"""`compare --ladder`, `remedies`, `margin`: fly the study, write tables and figures, say what was found."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.engine import notebook
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError, nearest
from testbed.records.store import check_free, write_json
from testbed.report.page import reported
from testbed.scenario.scenario import Scenario
from testbed.statistics import Mean, Rate
from testbed.studies.answer import answer as answers
from testbed.studies.common.measure import default_starts
from testbed.studies.ladder import figures
from testbed.studies.ladder import ladder as ladders
from testbed.studies.margin import margin as margins
from testbed.studies.remedies import remedies

if TYPE_CHECKING:
    import pandas as pd


@dataclass
class Found:
    """What a study wrote, and what to print of it.

    title, rows  a table to print
    lines        sentences to print beneath it
    """

    folder: Path
    title: str
    rows: list[dict[str, Any]]
    lines: list[str] = field(default_factory=list)
    data: dict[str, Any] = field(default_factory=dict)


def ladder(s: Scenario, seeds: int, out: Path, workers: int | None, overwrite: bool) -> Found:
    """The fidelity ladder of `s`: ladder.csv (a row per run), rungs.csv and ladder.json, figures."""
    check_free(out, overwrite)
    s = default_starts(s)
    rungs = ladders.rungs(s)
    with notebook(out, "ladder") as kept:
        table = ladders.climb(s, rungs, seeds, kept, workers)
        distance = ladders.account(table, rungs, "distance_m")
        h = ladders.account(table, rungs, "h_m")
        lost = ladders.rates(table, rungs)
        rows = [
            {
                "rung": d.rung,
                "lost": _rate(lost[d.rung]),
                "d [m]": round(d.value, 2),
                "change of d [95 % CI]": _mean(d.difference),
                "alone": _mean(d.alone),
                "h [m]": round(g.value, 2),
            }
            for d, g in zip(distance.steps, h.steps, strict=True)
        ]
        data = {"seeds": seeds, "rows": rows} | {
            a.quantity: {"total": vars(a.total), "interaction": vars(a.interaction)} for a in (distance, h)
        }
        with reported(out, overwrite) as folder:
            table.to_csv(folder / "ladder.csv", index=False)
            ladders.summary(table, rungs).to_csv(folder / "rungs.csv", index=False)
            write_json(folder / "ladder.json", data | _provenance(s, "jsbsim"))
            figures.ladder(table, distance, h, s.d_safe_m, folder)
    return Found(
        out,
        f"{s.name}: the fidelity ladder, {seeds} seeds (mean, paired differences [95 % interval])",
        rows,
        [
            f"least distance, top rung against bottom: {distance.total} m;"
            f" interaction of the single effects: {distance.interaction} m",
            f"least h, top rung against bottom: {h.total} m; interaction: {h.interaction} m",
            *_not_flown(table),
        ],
        data,
    )


def _not_flown(table: pd.DataFrame) -> list[str]:
    refused = table[table.refused != ""]
    if not len(refused):
        return []
    where = ", ".join(f"{count} on {rung}" for rung, count in refused.rung.value_counts(sort=False).items())
    return [f"could not start, and counted nowhere: {where}; such as seed {refused.seed.iloc[0]}"]


def compare_remedies(
    s: Scenario,
    seeds: range,
    only: list[str],
    out: Path,
    workers: int | None,
    overwrite: bool,
) -> Found:
    """Remedies on `s` at equal seeds: runs.csv, remedies.csv, figure.

    only  names of the remedies to fly; empty flies all
    """
    check_free(out, overwrite)
    s = default_starts(s)
    known = remedies.catalogue(s)
    if unknown := [name for name in only if name not in known]:
        raise UserError(f"--only {unknown[0]!r}: unknown remedy; {nearest(unknown[0], known)}")
    chosen = {name: known[name] for name in (only or known)}
    with notebook(out, "remedies") as kept:
        runs = remedies.compare(s, chosen, seeds, kept, workers)
        table = remedies.table(runs, _straight(s))
        with reported(out, overwrite) as folder:
            runs.to_csv(folder / "runs.csv", index=False)
            table.to_csv(folder / "remedies.csv", index=False)
            write_json(folder / "remedies.json", {"seeds": [seeds[0], seeds[-1]]} | _provenance(s, s.plant))
            figures.remedies(table, s.d_safe_m, folder)
    rows = [
        {
            "remedy": r.remedy,
            "lost": f"{r.violations}/{r.n}",
            "95 % CI": f"{100 * r.rate_low:.1f}-{100 * r.rate_high:.1f} %",
            "d [m]": round(r.least_distance_m, 2),
            "h [m]": round(r.least_h_m, 2),
            "no QP": int(r.infeasible_steps),
            "arrived": f"{r.arrived}/{r.n}",
            "path %": round(100 * r.path_cost, 1),
            "delay [s]": round(r.goal_delay_s, 2),
        }
        for r in table.itertuples()
    ]
    return Found(
        out, f"{s.name} on {s.plant}: remedies, seeds {seeds[0]} to {seeds[-1]}, Ds {s.d_safe_m:g} m", rows
    )


def margin(
    s: Scenario, knob: str, target_rate: float, seeds: int, out: Path, workers: int | None, overwrite: bool
) -> Found:
    """The smallest setting of `knob` that meets the rate: margin.json, curve.csv, figure."""
    import pandas as pd

    check_free(out, overwrite)
    s = default_starts(s)
    with notebook(out, "margin") as kept:
        found = margins.find(s, knob, target_rate, seeds, workers, book=kept)
        curve = pd.DataFrame([vars(p) for p in found.points])
        data = found.as_dict() | {"sentence": margins.sentence(found)}
        with reported(out, overwrite) as folder:
            curve.to_csv(folder / "curve.csv", index=False)
            write_json(folder / "margin.json", data | _provenance(s, s.plant))
            figures.margin(found, folder)
    rows = [
        {
            "stage": p.stage,
            knob: round(p.setting, 4),
            "lost": f"{p.violations}/{p.runs}",
            "95 % CI": f"{100 * p.rate_low:.1f}-{100 * p.rate_high:.1f} %",
            "d [m]": round(p.least_distance_m, 2),
            "no QP": p.infeasible,
            "path [m]": _hundredths(p.path_added_m),
            "time [s]": _hundredths(p.time_added_s),
        }
        for p in found.points
    ]
    title = f"{s.name} on {s.plant}: margin by {knob}, {found.unit}"
    return Found(out, title, rows, [data["sentence"]], data)


def answer(
    airframes: list[str], vehicles: list[int], seeds: int, out: Path, workers: int | None, overwrite: bool
) -> Found:
    """The central table: answer.csv, answer.md, figure. Fleets of 20 fly a fifth of the seeds, at least 5."""
    check_free(out, overwrite)
    made = answers.cases(airframes, vehicles)
    each = {n: seeds if n == 2 else max(5, seeds // 5) for n in vehicles}
    with notebook(out, "answer") as kept:
        table = answers.answer(made, each, kept, workers)
        with reported(out, overwrite) as folder:
            table.to_csv(folder / "answer.csv", index=False)
            (folder / "answer.md").write_text(answers.markdown(table), encoding="utf-8")
            asked = {"seeds": {str(n): k for n, k in each.items()}, "versions": catalogue.versions()}
            hashes = [catalogue.airframe_hashes(s) for s in made.values()]
            asked["airframes"] = {name: sha for of in hashes for name, sha in of.items()}
            write_json(folder / "answer.json", asked)
            figures.answer(table, folder)
    rows = [
        {
            "fleet": f"{r.number} {r.vehicle}",
            "air": r.weather,
            "remedy": r.remedy,
            "lost": f"{r.lost}/{r.runs}",
            "95 % CI": f"{100 * r.rate_low:.0f}-{100 * r.rate_high:.0f} %",
            "least [m]": round(r.least_distance_m, 2),
            "arrived": f"{r.arrived}/{r.runs}",
        }
        for r in table.itertuples()
    ]
    return Found(out, f"does the guarantee survive? runs that lose Ds = {answers.d_safe_m():g} m", rows)


def _mean(m: Mean | None) -> str:
    return str(m) if m is not None else ""


def _provenance(s: Scenario, plant: str) -> dict[str, Any]:
    """What the numbers depend on, besides the code; `plant` knows the airframes."""
    return {
        "scenario": s.model_dump(mode="json"),
        "versions": catalogue.versions(),
        "airframes": catalogue.airframe_hashes(s.model_copy(update={"plant": plant})),
    }


def _hundredths(value: float | None) -> float | None:
    return None if value is None else round(value, 2) + 0.0


def _rate(r: Rate) -> str:
    return f"{r.count}/{r.runs} {100 * r.low:.0f}-{100 * r.high:.0f} %"


def _straight(s: Scenario) -> float:
    """Mean length of the undisturbed way to the goal radius [m]."""
    start, goal = places(s, generators(s.seed)["start"])
    position = start.array()[:, [0, 1, 3]]
    return float(((position - goal) ** 2).sum(axis=-1).mean() ** 0.5) - s.goal_radius_m
