"""Lists every claim that a run is judged by: its number, kind, text, source, quantity and unit.

Whoever needs a claim's name takes it from here; no other module of the project spells it. The claims that a
theorem monitor checks stand in `filters.cbf.theorem_monitor`; `testbed.claims.monitored` lists them.
"""

from __future__ import annotations

from dataclasses import dataclass

from testbed.records.verdict import Kind, Verdict


@dataclass(frozen=True)
class Claim:
    """One claim.

    text      in words; {goal_radius_m} stands for the scenario's
    source    where the paper makes it
    among     the text where there are intruders, if it differs: about vehicles under the filter alone
    quantity  what a verdict's value is
    unit      of that value; "h" stands for the unit of the scenario's barrier
    """

    id: str
    number: str
    kind: Kind
    text: str
    source: str
    quantity: str = ""
    unit: str = ""
    among: str = ""

    def words(self, goal_radius_m: float, intruders: bool = False) -> str:
        """The text as a run states it, one with or without intruders."""
        text = self.among if intruders and self.among else self.text
        return text.replace("{goal_radius_m}", f"{goal_radius_m:g}")

    def unit_of(self, form: str) -> str:
        """The unit with a barrier of that form, "root" (h in m) or "squared" (h in m^2)."""
        h = "m" if form == "root" else "m^2"
        return {"h": h, "h/s": f"{h}/s"}.get(self.unit, self.unit)

    def unjudged(self, form: str, goal_radius_m: float, intruders: bool = False) -> Verdict:
        """A verdict without data: not applicable until something decides it."""
        return Verdict(
            id=self.id,
            number=self.number,
            kind=self.kind,
            claim=self.words(goal_radius_m, intruders),
            source=self.source,
            quantity=self.quantity,
            unit=self.unit_of(form),
        )


DECLARED = "the filter's own declaration"

START_SAFE = Claim(
    "start-safe", "P1", Kind.PREMISE, "the start is in the safe set", "Theorem 1", "h >= 0 at t = 0"
)
SHARED_MANOEUVRE = Claim(
    "shared-manoeuvre", "P2", Kind.PREMISE, "all barriers share one manoeuvre", "Assumption 1"
)
MANOEUVRE_IN_U = Claim(
    "manoeuvre-in-U", "P3", Kind.PREMISE, "gamma lies in the input set", "Theorem 2", "distance inside U"
)
MANOEUVRE_FLYABLE = Claim(
    "manoeuvre-flyable", "P4", Kind.PREMISE, "the vehicles can fly gamma for ever", "Theorem 2"
)
GRADIENT = Claim(
    "gradient",
    "P5",
    Kind.PREMISE,
    "L_g h is not zero within 0.05 of the boundary, h = 0",
    "Theorem 2, Proposition 1",
    "least |L_g h| where |h| <= 0.05",
)
OFF_THE_KINK = Claim(
    "off-the-kink",
    "P6",
    Kind.PREMISE,
    "h is differentiable where it binds",
    "Theorem 2, Appendix",
    "filter steps' motion to the kink, least",
)
RANGE_IS_ENOUGH = Claim(
    "range-is-enough",
    "P7",
    Kind.PREMISE,
    "vehicles know of each other from far enough that a pair is safe when it is first known",
    "beyond the paper: docs/guide/range.md",
    "range",
    "m",
)
SEPARATION = Claim(
    "separation",
    "G1",
    Kind.GUARANTEE,
    "every pair keeps Ds",
    "Theorem 1 with eq. (7)",
    "least distance",
    "m",
    "every pair under the filter keeps Ds",
)
# Of runs with intruders alone.
SEPARATION_INTRUDERS = Claim(
    "separation-intruders",
    "G1i",
    Kind.GUARANTEE,
    "every vehicle under the filter keeps Ds from every intruder",
    "no theorem covers intruders",
    "least distance to an intruder",
    "m",
)
SAFE_SET = Claim(
    "safe-set", "G2", Kind.GUARANTEE, "h >= 0 for ever", "Theorem 1, Corollary 1", "least h", "h"
)
BARRIER_CONDITION = Claim(
    "barrier-condition",
    "G3",
    Kind.GUARANTEE,
    "along the motion hdot + alpha(h) >= 0",
    "eq. (4), Corollary 1",
    "least hdot + alpha(h) over a filter period",
    "h/s",
)
ZCBF_CONDITION = Claim(
    "zcbf-condition",
    "G4a",
    Kind.GUARANTEE,
    "inside its safe set each barrier leaves an admissible input",
    "Definition 1, Theorem 2",
    "least sup over U of hdot + alpha(h)",
    "h/s",
)
QP_FEASIBILITY = Claim(
    "qp-feasibility",
    "G4",
    Kind.GUARANTEE,
    "the QP has a solution",
    "Theorems 3, 4",
    "vehicle-steps without one",
)
COMMAND_LIMITS = Claim(
    "command-limits",
    "G5",
    Kind.GUARANTEE,
    "commands stay in U",
    "eq. (5), actuator rows",
    "least distance inside the limits, as a share of their range",
)
ROWS_SATISFIED = Claim(
    "rows-satisfied",
    "G6",
    Kind.GUARANTEE,
    "solved inputs satisfy every pair's row, limited communication included",
    "Theorem 4, K(x) in K_cap(x)",
    "least L_g h u + alpha(h)",
    "h/s",
)
GOAL = Claim(
    "goal",
    "G7",
    Kind.GUARANTEE,
    "every vehicle passes its goal within {goal_radius_m} m before the run ends",
    "Section V: vehicles reach their waypoints",
    "largest over vehicles of the closest approach",
    "m",
    "every vehicle under the filter passes its goal within {goal_radius_m} m before the run ends",
)
# Of runs longer than its bound.
PROGRESS = Claim(
    "progress", "G7b", Kind.GUARANTEE,
    "nobody waits for ever: within the bound each comes {goal_radius_m} m nearer to its goal, or to it",
    "beyond the paper: docs/guide/scorecard.md", "longest time without coming nearer", "s",
)  # fmt: skip
INTERVENTION = Claim(
    "intervention",
    "G8",
    Kind.GUARANTEE,
    "the nominal input is altered minimally",
    "eq. (6)",
    "time overridden, worst",
)
MANOEUVRE_KEEPS_DS = Claim(
    "manoeuvre-keeps-Ds",
    "G9",
    Kind.GUARANTEE,
    "flown from a safe state, gamma keeps every pair Ds apart",
    "eq. (9), Theorem 2",
    "least distance while flying gamma",
    "m",
)
# Of runs with fences alone.
FENCE_CLEARANCE = Claim(
    "fence-clearance",
    "G10",
    Kind.GUARANTEE,
    "every vehicle keeps clear of its fences",
    "Theorem 1 and eq. (9), of one vehicle and a fence",
    "least signed distance to a fence, less its margin",
    "m",
)
FENCE_SAFE_SET = Claim(
    "fence-safe-set",
    "G11",
    Kind.GUARANTEE,
    "h >= 0 of every fence for ever",
    "Theorem 1, of one vehicle and a fence",
    "least h of a fence",
    "m",
)

OWN_SAFE_SET = Claim(
    "own-safe-set", "O1", Kind.OWN, "the barrier that the filter declares stays >= 0", DECLARED, "least own h"
)
OWN_CONDITION = Claim(
    "own-condition",
    "O2",
    Kind.OWN,
    "along the motion hdot + alpha(h) >= 0 of the barrier and alpha that the filter declares",
    DECLARED,
    "least hdot + alpha(h) over a filter period",
)
OWN_ROWS = Claim(
    "own-rows",
    "O3",
    Kind.OWN,
    "commands satisfy the constraints that the filter declares",
    DECLARED,
    "least left side minus right side of its rows",
)

# In the order in which they are judged and written.
PREMISES = (START_SAFE, SHARED_MANOEUVRE, MANOEUVRE_IN_U, MANOEUVRE_FLYABLE, GRADIENT, OFF_THE_KINK)
GUARANTEES = (
    SEPARATION,
    SAFE_SET,
    BARRIER_CONDITION,
    ZCBF_CONDITION,
    QP_FEASIBILITY,
    COMMAND_LIMITS,
    ROWS_SATISFIED,
    GOAL,
    INTERVENTION,
)
INTRUDERS = (SEPARATION_INTRUDERS,)
LIVENESS = (PROGRESS,)
FENCES = (FENCE_CLEARANCE, FENCE_SAFE_SET)
# Judged only where the scenario limits how far vehicles know of each other.
RANGES = (RANGE_IS_ENOUGH,)
# Judged only of a user's own filter that declares a barrier.
OWN = (OWN_SAFE_SET, OWN_CONDITION, OWN_ROWS)
# What rests on the scenario's barrier: such a filter has one of its own and did not promise it. It is still
# measured; its verdict is "not applicable", for the reason `NOT_ITS_CLAIM`.
OF_THE_PAPERS_BARRIER = (
    SAFE_SET,
    BARRIER_CONDITION,
    ZCBF_CONDITION,
    ROWS_SATISFIED,
    MANOEUVRE_KEEPS_DS,
    FENCE_SAFE_SET,
)
NOT_ITS_CLAIM = "not this filter's claim"

EVERY = (*PREMISES, *RANGES, *GUARANTEES, *INTRUDERS, *LIVENESS, *FENCES, MANOEUVRE_KEEPS_DS, *OWN)
CLAIMS = {claim.id: claim for claim in EVERY}
# What a run can lose: intervention is reported, not judged.
JUDGED = (
    *(claim for claim in GUARANTEES if claim is not INTERVENTION),
    MANOEUVRE_KEEPS_DS,
    *INTRUDERS,
    *LIVENESS,
    *FENCES,
    *OWN,
)


def check_id(name: str) -> str:
    """The id of the claim that a theorem monitor's check `name` makes."""
    return f"monitor-{name}"


def check_claim(name: str, text: str, number: str = "M", source: str = "Theorems 3 and 4") -> Claim:
    """The claim that a check `name` inside a filter makes; a unit stands in brackets behind its text."""
    claim, _, unit = text.rstrip("]").partition(" [")
    return Claim(check_id(name), number, Kind(number[0]), claim, source, "smallest seen", unit)
