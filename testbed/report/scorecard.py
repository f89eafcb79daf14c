"""The scorecard as a page shows it: every premise and guarantee, a line for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from testbed.claims.verdict import HOLDS, NOT_APPLICABLE, PREMISE, VIOLATED
from testbed.records.run import Run
from testbed.report.blocks import KEPT, LOST, OPEN, Fact
from testbed.report.style import style
from testbed.report.tables import further, number

# Verdict -> sign and class; the sign tells them apart without colour.
LOOKS = {HOLDS: ("✓", KEPT), VIOLATED: ("✗", LOST), PREMISE: ("?", OPEN), NOT_APPLICABLE: ("–", "none")}
HEADINGS = ("Guarantees", "Premises: where one is not met, what rests on it is not shown")


def rows(runs: Mapping[str, Run]) -> list[dict[str, Any]]:
    """One entry per claim with a line per run that has it: guarantees, then premises, in the order judged."""
    listed = {g["id"]: g for run in runs.values() for g in run.guarantees}
    listed = dict(sorted(listed.items(), key=lambda item: item[1]["number"].startswith("P")))
    made = [
        {
            "number": g["number"],
            "id": name,
            "claim": g["claim"],
            "source": g["source"],
            "quantity": g["quantity"],
        }
        | {"lines": [_line(label, e) for label, run in runs.items() if (e := _entry(run, name)) is not None]}
        for name, g in listed.items()
    ]
    seen = set()
    for row in made:
        kind = HEADINGS[row["number"].startswith("P")]
        row["heading"] = "" if kind in seen else kind
        seen.add(kind)
    return made


def _entry(run: Run, name: str) -> dict[str, Any] | None:
    return next((g for g in run.guarantees if g["id"] == name), None)


def _line(label: str, e: Mapping[str, Any]) -> dict[str, Any]:
    sign, look = LOOKS.get(e["verdict"], ("–", "none"))

    def said(value: Any) -> str:
        return "–" if value is None else f"{number(value)} {e['unit']}".rstrip()

    return {
        "run": label,
        "color": style(label)["color"],
        "verdict": e["verdict"],
        "sign": sign,
        "look": look,
        "value": said(e["value"]),
        "bound": said(e["bound"]),
        "margin": said(e["margin"]),
        "t_s": e["t_s"],
        "who": "–".join(map(str, e["vehicles"])) or "–",
        "pair": "-".join(map(str, e["vehicles"])) if len(e["vehicles"]) == 2 else "",
        "why": [*([e["why"]] if e["why"] else []), *further(dict(e))],
    }


def csv_rows(runs: Mapping[str, Run]) -> list[dict[str, Any]]:
    """The same for a file: a row per run and claim."""
    keep = (
        "number",
        "id",
        "claim",
        "source",
        "verdict",
        "quantity",
        "value",
        "unit",
        "bound",
        "margin",
        "t_s",
    )
    return [
        {"run": label}
        | {k: g[k] for k in keep}
        | {"vehicles": "-".join(map(str, g["vehicles"])), "why": g["why"]}
        for label, run in runs.items()
        for g in run.guarantees
    ]


def fact(label: str, run: Run) -> Fact:
    """How one run stands on the claim that matters: separation."""
    e = run.guarantee("separation")
    color = style(label)["color"]
    if e["verdict"] == NOT_APPLICABLE or e["value"] is None:
        return Fact(label, OPEN, e["why"] or "separation was not judged", None, color)
    status = {HOLDS: KEPT, VIOLATED: LOST}.get(e["verdict"], OPEN)
    when = f", at {e['t_s']:.2f} s, vehicles {' and '.join(map(str, e['vehicles']))}" if e["vehicles"] else ""
    text = f"{e['value']:.2f} m at closest (Ds {e['bound']:g} m){when}"
    if run.manifest["ended_early"]:
        text += f"; the run did not finish: {run.manifest['ended_early']}"
    return Fact(label, status, text, e["value"] / e["bound"], color)


def left_safe_set(run: Run) -> bool:
    """Whether h went below zero though Ds was kept: luck or a remedy's room, and no invariance."""
    kept = run.guarantee("separation")["verdict"] == HOLDS
    return kept and run.guarantee("safe-set")["verdict"] == VIOLATED


def headline(facts: Sequence[Fact], left: Sequence[str] = ()) -> tuple[str, str]:
    """The status of all together, and it in words.

    left  runs that kept Ds and left the safe set
    """
    status, text = _separation(facts)
    return status, text + (f", though h fell below zero on {_and(left)}" if left else "")


def _separation(facts: Sequence[Fact]) -> tuple[str, str]:
    by = {status: [f.name for f in facts if f.status == status] for status in (LOST, OPEN, KEPT)}
    if by[LOST]:
        text = "Separation LOST on " + _and(by[LOST])
        text += f"; kept on {_and(by[KEPT])}" if by[KEPT] else ""
        text += f"; not shown on {_and(by[OPEN])}" if by[OPEN] else ""
        return LOST, text
    if by[OPEN]:
        text = "Separation not shown on " + _and(by[OPEN])
        return OPEN, text + (f"; kept on {_and(by[KEPT])}" if by[KEPT] else "")
    return KEPT, "Separation kept on " + _and(by[KEPT])


def other_claims(label: str, run: Run) -> str:
    """In a sentence, what else was violated or rested on a premise that was not met."""

    def named(verdict: str, premise: bool) -> list[str]:
        return [
            f"{g['number']} {g['id']}"
            for g in run.guarantees
            if g["verdict"] == verdict and g["number"].startswith("P") == premise
        ]

    judged = [
        g for g in run.guarantees if g["verdict"] in (HOLDS, VIOLATED) and not g["number"].startswith("P")
    ]
    held = sum(g["verdict"] == HOLDS for g in judged)
    text = f"{label}: {held} of {len(judged)} judged claims hold"
    why = "the run ended early" if run.manifest["ended_early"] else "a premise failed"
    for said, found in (
        ("violated", named(VIOLATED, False)),
        (f"not judged, {why}", named(PREMISE, False)),
        ("premises not met", named(PREMISE, True)),
    ):
        text += f"; {said}: {', '.join(found)}" if found else ""
    return text + "."


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
