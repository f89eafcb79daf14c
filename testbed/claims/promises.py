"""Says which claims each kind of filter makes; the others are measured and not judged."""

from __future__ import annotations

from testbed.claims import registry

# filter.kind -> those of `registry.OF_THE_PAPERS_BARRIER` that it promises; and G6, for it has no such rows.
KEPT = {
    "flow": (registry.ROWS_SATISFIED,),
    "collision-cone": (registry.ROWS_SATISFIED,),
    "optimal-decay": (
        registry.SAFE_SET,
        registry.ZCBF_CONDITION,
        registry.MANOEUVRE_KEEPS_DS,
        registry.ROWS_SATISFIED,
    ),
    "velocity-obstacles": (registry.ROWS_SATISFIED,),
    "backup": (registry.ROWS_SATISFIED,),
    "gatekeeper": (registry.ROWS_SATISFIED,),
    "receding-horizon": (registry.ROWS_SATISFIED,),
}
# Kinds that solve QPs, of which they do not promise that there is a solution; and those that promise it.
SOLVING_AT_BEST = ("flow", "collision-cone", "velocity-obstacles", "receding-horizon")
ALWAYS_SOLVING = ("centralised", "limited", "optimal-decay")


def excused(declared: bool, kind: str = "") -> frozenset[str]:
    """Ids of the claims that a filter did not make: one with a barrier of its own, or of another kind.

    declared  whether a user's filter declares a barrier
    kind      filter.kind, "" of a user's filter
    G6 of a user's filter is measured; those of `KEPT` have no rows of this kind at all.
    """
    if not declared and kind not in KEPT:
        return frozenset()
    kept = {claim.id for claim in KEPT.get(kind, ())}
    return frozenset({claim.id for claim in registry.OF_THE_PAPERS_BARRIER} - kept)
