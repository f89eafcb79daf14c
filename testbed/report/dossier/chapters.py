"""Makes the chapters of a dossier: results, aircraft, methods, what was not covered, provenance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.claims.registry import EVERY
from testbed.records.checksums import sha256
from testbed.report.blocks import Block, Note, Part, Playback, Section, Table
from testbed.report.dossier import evidence
from testbed.report.registry import Kind
from testbed.statistics import Quantile, Rate, means
from testbed.statistics.risk_ratio import RiskRatio

HOLM = "Holm's step-down rule over exact binomial tests (McNemar's, exact) of encounters that one of two lost"
INTERVALS = (
    ("rate of runs or encounters", Rate.method),
    ("mean", means.METHOD),
    ("mean of few different values", means.METHOD_FEW),
    ("quantile", Quantile.method),
    ("risk ratio", RiskRatio.method),
    ("several comparisons of one page", HOLM),
)
LIMITS = (
    "Everything here was flown in simulation. No statement is made about a real aircraft beyond its model.",
    "Models of aircraft, engines, sensors and autopilots are those that the chapter on aircraft names, with"
    " the assumptions stated there; what they do not model is not covered.",
    "A rate or interval speaks of the scenarios, starts and weather that were drawn, and of no others.",
    "A search that found no violation proves nothing.",
    "Guarantees rest on their premises: where a premise is not met the verdict says so and is no pass.",
)
PAPER = (
    "Theorems, equations, definitions and assumptions without another name are those of Squires, Pierpaoli,"
    " Konda, Coogan and Egerstedt, Composition of Safety Constraints for Fixed-Wing Collision Avoidance"
    " Amidst Limited Communications, Journal of Guidance, Control, and Dynamics 45(4), 2022."
)
TERMS = {
    "Ds": "separation that every pair is to keep, in m, between reference points; the scenario sets it",
    "v, omega, zeta": "commanded ground speed [m/s], course rate [rad/s] and climb rate [m/s]",
    "U": "the set of commands within the scenario's limits",
    "gamma": "the evading manoeuvre: the command that a vehicle could keep for ever",
    "h": "barrier of a pair: its least distance if both flew gamma from now on, less Ds [m]; the safe set has"
    " h >= 0",
    "hdot, alpha": "the rate of h, and the function of h that it may fall by: hdot + alpha(h) >= 0",
    "QP": "the quadratic program that finds the command nearest to the wanted one in U under all pairs' rows",
    "plant": "what flies the commands: unicycle (the paper's model), lagged (its channels lag), jsbsim (6"
    " degrees of freedom with an autopilot)",
}
WORDS = {
    "holds": "the value keeps its bound at every step",
    "violated": "it does not",
    "premise not met": "what the claim rests on did not hold, or the run ended early: no pass",
    "open": "the record cannot decide it: no pass",
    "not applicable": "the run has nothing that the claim speaks of",
}


@dataclass(frozen=True)
class Chapter:
    """A chapter; `parts` are those of the report's pages, in the chapter on results."""

    title: str
    sections: Sequence[Section] = ()
    parts: Sequence[Part] = field(default_factory=tuple)


def chapters(folders: Sequence[Path], parts: Sequence[Part], kinds: Sequence[Kind]) -> list[Chapter]:
    """All chapters. Raises UserError where the folders do not belong together, or are damaged."""
    names = [folder.resolve().name for folder in folders]
    return [
        Chapter("Summary", [Section("What was found", [_summary(names, parts)])]),
        Chapter("Results", parts=[_printed(part) for part in parts]),
        Chapter("Aircraft", _aircraft(folders, kinds)),
        Chapter("Methods", _methods()),
        Chapter("What was not covered", _coverage(folders, names)),
        Chapter("Provenance", _provenance(folders, names, kinds)),
    ]


def _summary(names: Sequence[str], parts: Sequence[Part]) -> Table:
    return Table(
        [
            {
                "folder": name,
                "what": part.title,
                "result": part.status,
                "in words": part.headline,
                "figures": "; ".join(f"{f.name}: {f.text}" for f in part.facts),
            }
            for name, part in zip(names, parts, strict=True)
        ],
        "kept: nothing was lost; lost: something was; open: nothing is claimed",
    )


def _printed(part: Part) -> Part:
    """A part without what paper cannot show: playback is left out, and listings are unfolded."""
    kept = []
    for section in part.sections:
        blocks = [b for b in section.blocks if not isinstance(b, Playback)]
        if blocks:
            kept.append(Section(section.title, blocks))
    return Part(part.title, part.what, part.status, part.headline, part.details, part.facts, kept)


def _aircraft(folders: Sequence[Path], kinds: Sequence[Kind]) -> list[Section]:
    found = evidence.airframes(folders, kinds)
    if not found:
        return [Section("Airframes", [Note("No airframe was flown: vehicles are unicycles.")])]
    rows, sections = [], []
    for name, of in found.items():
        sha = of.sha256
        now, points = evidence.assumptions(name, of.places)
        same = "yes" if now == sha else "no: it has changed since" if now else "no: it is not there any more"
        rows.append({"airframe": name, "SHA-256 of its files and gains": sha, "files are those now": same})
        listed: list[Block] = [Note(f"{k}. {point}") for k, point in enumerate(points, 1)]
        said = "Its README.md states no assumptions under a heading of that name; none may be taken as none."
        sections.append(Section(f"Assumptions of {name}", listed or [Note(said)]))
    return [Section("Airframes", [Table(rows, "Every airframe that the results rest on")]), *sections]


def _methods() -> list[Section]:
    claims = [
        {
            "claim": f"{c.number} {c.id}",
            "kind": c.kind.name.lower(),
            "text": c.words(20.0),
            "source": c.source,
        }
        for c in EVERY
    ]
    return [
        Section("Terms", [Note(PAPER), Table([{"term": k, "meaning": v} for k, v in TERMS.items()])]),
        Section(
            "Claims",
            [
                Note(
                    "Each run is judged at every step, recorded or not, at the vehicles' true states, by the"
                    " scenario's own Ds and the unmodified barrier, whatever the filter used. The goal radius"
                    " is the scenario's; 20 m stands for it here."
                ),
                Table(claims, "Every claim that a run may be judged by"),
                Table([{"verdict": k, "meaning": v} for k, v in WORDS.items()], "Verdicts"),
            ],
        ),
        Section(
            "Intervals",
            [Table([{"of": k, "method": v} for k, v in INTERVALS], "At 95 % unless a table says otherwise")],
        ),
        Section(
            "Second opinion",
            [
                Note(
                    "Run folders are checked by a second program that shares no formula with the first: it"
                    " computes each verdict again from the recorded positions and commands, and lists what"
                    " it cannot decide. Every file of a run folder carries a checksum."
                )
            ],
        ),
    ]


def _coverage(folders: Sequence[Path], names: Sequence[str]) -> list[Section]:
    """The second opinion on every run folder, and what it did not cover."""
    rows: list[dict[str, Any]] = []
    left: dict[str, dict[str, list[str]]] = {}
    undecided: list[dict[str, Any]] = []
    for folder, name in zip(folders, names, strict=True):
        runs = evidence.run_folders(folder)
        if not runs:
            none = "no run folder was kept: its numbers were not computed a second time"
            rows.append({"run folder": name, "agree": None, "differ": None, "open": None, "remark": none})
        for run in runs:
            inside = run.relative_to(folder).as_posix()
            found = evidence.checked(run, name if inside == "." else f"{name}/{inside}")
            remark = found.fault or ("; ".join(found.differs) and f"differ: {', '.join(found.differs)}")
            counts = {"agree": found.agrees, "differ": len(found.differs), "open": len(found.open)}
            rows.append({"run folder": found.run, **counts, "remark": remark})
            undecided += [{"run folder": found.run, "open": k, "why": why} for k, why in found.open.items()]
            for item in found.uncovered:
                left.setdefault(item.why, {}).setdefault(item.what, []).append(found.run)
    uncovered = [
        {"not covered": ", ".join(_grouped(items)), "in run folders": _most(items), "why": why}
        for why, items in left.items()
    ]
    return [
        Section("Limits of this document", [Note(line) for line in LIMITS]),
        Section("Run folders checked", [Table(rows, "What was computed again from the records")]),
        Section("Open: what a record cannot decide", [Table(undecided) if undecided else Note("None.")]),
        Section("Items of the records that nothing was compared with", [
            Table(uncovered, "Columns and fields that no formula of the second opinion decides")
            if uncovered else Note("None.")
        ]),
    ]  # fmt: skip


def _grouped(items: Iterable[str]) -> list[str]:
    """Names of one table in one, where there are many."""
    tables: dict[str, list[str]] = {}
    for name in items:
        tables.setdefault(name.rpartition(".")[0], []).append(name)
    return [s for table, of in tables.items() for s in (of if len(of) <= 4 else [f"{table}.* ({len(of)})"])]


def _most(items: Mapping[str, Sequence[str]]) -> int:
    return len({run for runs in items.values() for run in runs})


def _provenance(folders: Sequence[Path], names: Sequence[str], kinds: Sequence[Kind]) -> list[Section]:
    each = {name: evidence.records(folder, kinds) for folder, name in zip(folders, names, strict=True)}
    inside = {
        name: evidence.records(runs[0], kinds) if (runs := evidence.run_folders(folder)) else {}
        for folder, name in zip(folders, names, strict=True)
    }
    rows = []
    for name, data in each.items():
        known = data.get("versions") or inside[name].get("versions") or {}
        made = {"folder": name, "code": data.get("code") or inside[name].get("code") or "not recorded"}
        rows.append(made | {"versions": "; ".join(f"{k} {v}" for k, v in known.items()) or "not recorded"})
    seals = [
        {"file": f"{name}/{file.relative_to(folder).as_posix()}", "SHA-256": sha256(file)}
        for folder, name in zip(folders, names, strict=True)
        for file in evidence.marks(folder, kinds)
    ]
    said = "Files that this document was made from; a run folder's manifest.json has those of its other files"
    return [
        Section("What made the results", [Table(rows, "Versions recorded when they were flown")]),
        Section("Evidence", [Table(seals, said)]),
    ]
