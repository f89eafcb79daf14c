"""Compares what a run states with what we find: findings, and the judge of one claim's entry."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbed.claims import promises, registry
from testbed.records.verdict import Kind, Status
from testbed.verification.recorded import Array, Recorded

Entry = dict[str, Any]
Rule = Callable[[float], bool]


@dataclass(frozen=True)
class Finding:
    """One thing compared.

    said, own  what the run says, and what we find
    agrees     None: the record cannot decide it, and `why` says what is missing
    within     how far apart the two may lie and still agree, in the unit of the value; None: to the letter
    why        what differs, or why it cannot be decided
    """

    what: str
    said: str
    own: str
    agrees: bool | None
    within: float | None = None
    why: str = ""


def compared(name: str, said: Array, own: Array, within: Array | float, why: str = "") -> Finding:
    """A column of values that must be as we find them."""
    off = np.abs(said - own)
    good = off <= within
    worst = float(np.nanmax(off, initial=0.0))
    bad = int((~good).sum())
    note = "" if not bad else f"{bad} of {said.size} values differ" + why
    tight = float(np.max(within, initial=0.0))
    return Finding(name, f"{said.size} values", f"off by {worst:.2g}", not bad, tight, note)


@dataclass(frozen=True)
class Values:
    """The recorded values of a quantity whose least value an entry reports.

    value    (T, K)  at instants t (T,), of K pairs or vehicles
    off      (T, K)  how far from the truth it may be
    counts   (T, K)  whether the entry looks at it
    doubtful (T, K)  whether round-off decides if it looks
    who      (K,)    vehicles of each column, from 1
    floor            what an instant that was not recorded may come down to; None: all are recorded
    ceiling          what such instants came down to at least
    """

    t: Array
    value: Array
    off: Array
    who: list[list[int]]
    counts: Array
    doubtful: Array
    floor: float | None = None
    ceiling: float = np.inf

    @classmethod
    def of(
        cls,
        t: Array,
        value: Array,
        off: Array | float,
        who: list[list[int]],
        counts: Array | bool = True,
        doubtful: Array | bool = False,
        floor: float | None = None,
        ceiling: float = np.inf,
    ) -> Values:
        """With `off`, `counts` and `doubtful` for all alike, if they are."""
        rest = [np.broadcast_to(np.asarray(a), value.shape) for a in (off, counts, doubtful)]
        return cls(t, value, rest[0], who, rest[1], rest[2], floor, ceiling)

    def range(self) -> tuple[float, float]:
        """Between what the least value lies; (inf, inf) of nothing."""
        maybe, sure = self.counts | self.doubtful, self.counts & ~self.doubtful
        low = float(np.min(np.where(maybe, self.value - self.off, np.inf), initial=np.inf))
        high = float(np.min(np.where(sure, self.value + self.off, np.inf), initial=np.inf))
        return (low if self.floor is None else min(low, self.floor)), min(high, self.ceiling)

    def least(self) -> float:
        """The least value recorded; inf of nothing."""
        return float(np.min(np.where(self.counts, self.value, np.inf), initial=np.inf))

    def at(self, t: float, vehicles: list[int]) -> tuple[float, float] | None:
        """Value and error at an instant and column; None if not recorded."""
        k = int(np.argmin(np.abs(self.t - t))) if len(self.t) else 0
        if not len(self.t) or abs(self.t[k] - t) > 1e-6 or vehicles not in self.who:
            return None
        p = self.who.index(vehicles)
        if not (self.counts | self.doubtful)[k, p]:
            return None
        return float(self.value[k, p]), float(self.off[k, p])


@dataclass
class Judge:
    """Compares one entry with what we find, and collects what is wrong with it."""

    run: Recorded
    entry: Entry
    wrong: list[str] = field(default_factory=list)

    def expect(self, name: str, said: Any, due: Any) -> None:
        """Words and counts must be equal, numbers equal to rounding."""
        if name == "verdict" and self.excused:
            due = Status.NOT_APPLICABLE
        if isinstance(due, float) and isinstance(said, int | float) and not isinstance(said, bool):
            same = bool(abs(said - due) <= 1e-9 * max(1.0, abs(due)))
        else:
            same = bool(said == due) and isinstance(said, bool) == isinstance(due, bool)
        if not same:
            self.wrong.append(f"{name} is {_short(said)}, should be {_short(due)}")

    def expect_near(self, name: str, said: Any, due: float, within: float) -> None:
        """A number must be equal within `within`."""
        if not (isinstance(said, int | float) and abs(said - due) <= within):
            self.wrong.append(f"{name} is {_short(said)}, should be {due:.6g}")

    def verdict(self, holds: bool, fails: str = Status.VIOLATED) -> str:
        """The status for a value that holds or does not; a run that ended early holds no guarantee."""
        if not holds:
            return fails
        if self.run.ended and not self._is_premise:
            return Status.PREMISE_NOT_MET
        return Status.HOLDS

    @property
    def excused(self) -> bool:
        """Whether the claim rests on the scenario's barrier, and the filter has one of its own."""
        kind = "" if "filter" in self.run.parts else self.run.scenario["filter"]["kind"]
        return self.entry["id"] in promises.excused(bool(self.run.declared), kind)

    @property
    def _is_premise(self) -> bool:
        claim = registry.CLAIMS.get(self.entry["id"])
        return claim is not None and claim.kind is Kind.PREMISE

    def least(
        self,
        values: Values,
        bound: float,
        rule: Rule,
        fails: str = Status.VIOLATED,
        empty: str = Status.NOT_APPLICABLE,
        void: bool = False,
        missing: str = "",
    ) -> Finding:
        """The entry reports the least of `values`; `rule` says which of them hold.

        empty    the verdict where there is nothing to report
        void     whether the premise of it all is not met
        missing  why it is open, if not for instants that are not recorded
        """
        e, said = self.entry, self.entry["value"]
        low, high = values.range()
        if said is None:
            self.expect("verdict", e["verdict"], Status.PREMISE_NOT_MET if void else empty)
            if high < np.inf:
                self.wrong.append(f"no value, should be {high:.6g}")
            return self.done("none", open_=values.floor is not None, why=missing)
        if not low <= said <= high:
            due = f"{values.least():.6g}" if values.floor is None else _between(low, high)
            self.wrong.append(f"value is {said:.6g}, should be {due}")
        self.expect("bound", e["bound"], float(bound))
        self.expect("margin", e["margin"], float(said - bound))
        self._place(values, said)
        self.expect(
            "verdict", e["verdict"], Status.PREMISE_NOT_MET if void else self.verdict(rule(said), fails)
        )
        if values.floor is None:
            return self.done(f"{values.least():.6g}", high - values.least())
        decided = void or self.excused or rule(low) == rule(high)
        return self.done(_between(low, high), high - low, open_=not decided, why=missing)

    def _place(self, values: Values, said: float) -> None:
        """The worst instant and vehicles are where that value is."""
        e = self.entry
        here = values.at(e["t_s"], e["vehicles"]) if e["t_s"] is not None else None
        if here is not None:
            if not abs(here[0] - said) <= here[1]:
                self.wrong.append(f"value at {e['t_s']:g} s of {e['vehicles']} is {here[0]:.6g}")
        elif values.floor is None or e["t_s"] is None or e["vehicles"] not in values.who:
            self.wrong.append(f"nothing counts at {_short(e['t_s'])} s of {e['vehicles']}")

    def nothing(self, own: str, verdict: str = Status.NOT_APPLICABLE) -> Finding:
        """There is nothing to report, and the entry says so."""
        self.expect("value", self.entry["value"], None)
        self.expect("verdict", self.entry["verdict"], verdict)
        return self.done(own)

    def done(self, own: str, within: float | None = None, open_: bool = False, why: str = "") -> Finding:
        """The finding, when everything was compared; `open_`: nothing speaks against it, nor decides it."""
        e = self.entry
        value = e["value"]
        if value is None:
            for name, none in (("bound", None), ("margin", None), ("t_s", None), ("vehicles", [])):
                self.expect(name, e[name], none)
        said = e["verdict"] if value is None else f"{value:.6g}, {e['verdict']}"
        what = f"{e['number']} {e['id']}"
        if self.wrong:
            return Finding(what, said, own, False, within, "; ".join(self.wrong))
        return Finding(
            what, said, own, None if open_ else True, within, (why or thin(self.run)) if open_ else ""
        )


def thin(run: Recorded) -> str:
    """Why something is open where steps in between are not recorded."""
    period = run.scenario["rates"]["record_dt_s"]
    return f"the steps between instants recorded every {period:g} s are needed"


def _between(low: float, high: float) -> str:
    if high == np.inf:
        return "nothing recorded" if low == -np.inf else f"at least {low:.4g}"
    return f"at most {high:.6g}" if low == -np.inf else f"{low:.6g} to {high:.6g}"


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)[:60]
