"""Prepares the scorecard of a report page: every guarantee and premise, a line for each run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from testbed.claims.nearest import nearest_approach
from testbed.claims.registry import FENCE_CLEARANCE, SAFE_SET
from testbed.records.run import Run
from testbed.records.verdict import Kind, Status, Verdict
from testbed.report.blocks import KEPT, LOST, OPEN, Fact
from testbed.report.style import styles
from testbed.report.tables import further, number

# Status -> sign and class; the sign tells them apart without colour.
LOOKS = {
    Status.HOLDS: ("✓", KEPT),
    Status.VIOLATED: ("✗", LOST),
    Status.PREMISE_NOT_MET: ("?", OPEN),
    Status.NOT_APPLICABLE: ("–", "none"),
    Status.OPEN: ("?", OPEN),
}
PREMISES = "Premises: if one is not met, what rests on it is not shown"
HEADINGS = {
    Kind.PREMISE: PREMISES,
    Kind.OWN: "What a filter of the user's own promises by its declaration",
    Kind.FLOW: "What the flow filter's own theorem says",
    Kind.RIVAL: "What the filter of other authors promises on its model",
}
GUARANTEES = "Guarantees"
_FENCE = FENCE_CLEARANCE.id


def rows(runs: Mapping[str, Run]) -> list[dict[str, Any]]:
    """One entry per claim with a line per run that has it: premises last, else in the order judged."""
    listed = {v.id: v for run in runs.values() for v in run.guarantees}
    made, seen, looks = [], set(), styles(runs)
    for first in sorted(listed.values(), key=lambda v: v.kind is Kind.PREMISE):
        heading = HEADINGS.get(first.kind, GUARANTEES)
        lines = [
            _line(label, v, looks[label]["color"])
            for label, run in runs.items()
            for v in run.guarantees
            if v.id == first.id
        ]
        made.append(
            {
                "number": first.number,
                "id": first.id,
                "claim": first.claim,
                "source": first.source,
                "quantity": first.quantity,
                "lines": lines,
                "heading": "" if heading in seen else heading,
            }
        )
        seen.add(heading)
    return made


def _line(label: str, v: Verdict, color: str) -> dict[str, Any]:
    sign, look = LOOKS[v.status]

    def said(value: float | None) -> str:
        return "–" if value is None else f"{number(value)} {v.unit}".rstrip()

    return {
        "run": label,
        "color": color,
        "verdict": v.status.value,
        "sign": sign,
        "look": look,
        "value": said(v.value),
        "bound": said(v.bound),
        "margin": said(v.margin),
        "t_s": v.instant,
        "who": "–".join(map(str, v.vehicles)) or "–",
        "pair": "-".join(map(str, v.vehicles)) if len(v.vehicles) == 2 else "",
        "why": [*([v.why] if v.why else []), *further(v)],
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
        {"run": label} | {k: v[k] for k in keep} | {"vehicles": "-".join(map(str, v.vehicles)), "why": v.why}
        for label, run in runs.items()
        for v in run.guarantees
    ]


def fact(label: str, run: Run, color: str) -> Fact:
    """How one run stands on separation, the claim that matters most."""
    v = nearest_approach(run)
    if v.status is Status.NOT_APPLICABLE or v.value is None or v.bound is None:
        return Fact(label, OPEN, v.why or "separation was not judged", None, color)
    status = {Status.HOLDS: KEPT, Status.VIOLATED: LOST}.get(v.status, OPEN)
    when = f", at {v.instant:.2f} s, vehicles {' and '.join(map(str, v.vehicles))}" if v.vehicles else ""
    text = f"{v.value:.2f} m at closest (Ds {v.bound:g} m){when}"
    if run.manifest["ended_early"]:
        text += f"; the run did not finish: {run.manifest['ended_early']}"
    return Fact(label, status, text, v.value / v.bound, color)


def left_safe_set(run: Run) -> bool:
    """Whether h went below zero although Ds was kept: the safe set was not invariant in this run."""
    kept = nearest_approach(run).status is Status.HOLDS
    return kept and run.guarantee(SAFE_SET.id).status is Status.VIOLATED


def headline(facts: Sequence[Fact], left: Sequence[str] = ()) -> tuple[str, str]:
    """The status of all runs together, and the same in words.

    left  runs that kept Ds and left the safe set
    """
    status, text = _separation(facts)
    return status, text + (f", though h fell below zero on {_and(left)}" if left else "")


def fenced(runs: Mapping[str, Run], status: str, text: str) -> tuple[str, str]:
    """The status and headline of all runs together, with how they stand on their fences, if they have any."""
    found = [(label, v.status) for label, run in runs.items() for v in run.guarantees if v.id == _FENCE]
    lost = [label for label, of in found if of is Status.VIOLATED]
    unknown = [label for label, of in found if of not in (Status.VIOLATED, Status.HOLDS)]
    if lost:
        return LOST, f"{text}; fences LEFT on {_and(lost)}"
    if unknown:
        return (OPEN if status == KEPT else status), f"{text}; fences not shown kept on {_and(unknown)}"
    return status, text + ("; fences kept" if found else "")


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

    def named(status: Status, premise: bool) -> list[str]:
        return [
            f"{v.number} {v.id}"
            for v in run.guarantees
            if v.status is status and (v.kind is Kind.PREMISE) == premise
        ]

    held, violated = (named(status, False) for status in (Status.HOLDS, Status.VIOLATED))
    text = f"{label}: {len(held)} of {len(held) + len(violated)} judged claims hold"
    why = "the run ended early" if run.manifest["ended_early"] else "a premise failed"
    for said, found in (
        ("violated", violated),
        (f"not judged, {why}", named(Status.PREMISE_NOT_MET, False)),
        ("premises not met", named(Status.PREMISE_NOT_MET, True)),
        ("open", named(Status.OPEN, False)),
    ):
        text += f"; {said}: {', '.join(found)}" if found else ""
    return text + "."


def _and(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
