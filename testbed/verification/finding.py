"""What is found of one claim: the run's word for it, ours, and whether the two agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from testbed.verification.recorded import Array, Recorded

HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"
Entry = dict[str, Any]
Rule = Callable[[float], bool]


@dataclass(frozen=True)
class Finding:
    """One thing looked into.

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


@dataclass(frozen=True)
class Values:
    """What the record says of a quantity of which an entry reports the least.

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
    """Compares one entry with what we find, and gathers what is wrong with it."""

    run: Recorded
    entry: Entry
    wrong: list[str] = field(default_factory=list)

    def expect(self, name: str, said: Any, due: Any) -> None:
        """Words and counts are as due, numbers to rounding."""
        if isinstance(due, float) and isinstance(said, int | float) and not isinstance(said, bool):
            same = bool(abs(said - due) <= 1e-9 * max(1.0, abs(due)))
        else:
            same = bool(said == due) and isinstance(said, bool) == isinstance(due, bool)
        if not same:
            self.wrong.append(f"{name} is {_short(said)}, {_short(due)} is due")

    def expect_near(self, name: str, said: Any, due: float, within: float) -> None:
        """A number is as due within `within`."""
        if not (isinstance(said, int | float) and abs(said - due) <= within):
            self.wrong.append(f"{name} is {_short(said)}, {due:.6g} is due")

    def verdict(self, holds: bool, fails: str = VIOLATED) -> str:
        """What a value that holds or not leads to; a run that ended early holds no guarantee."""
        if not holds:
            return fails
        return PREMISE if self.run.ended and not self.entry["number"].startswith("P") else HOLDS

    def least(
        self,
        values: Values,
        bound: float,
        rule: Rule,
        fails: str = VIOLATED,
        empty: str = OTHER,
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
            self.expect("verdict", e["verdict"], PREMISE if void else empty)
            if high < np.inf:
                self.wrong.append(f"no value, {high:.6g} is due")
            return self.done("none", open_=values.floor is not None, why=missing)
        if not low <= said <= high:
            due = f"{values.least():.6g}" if values.floor is None else _between(low, high)
            self.wrong.append(f"value is {said:.6g}, {due} is due")
        self.expect("bound", e["bound"], float(bound))
        self.expect("margin", e["margin"], float(said - bound))
        self._place(values, said)
        self.expect("verdict", e["verdict"], PREMISE if void else self.verdict(rule(said), fails))
        if values.floor is None:
            return self.done(f"{values.least():.6g}", high - values.least())
        decided = void or rule(low) == rule(high)
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

    def nothing(self, own: str, verdict: str = OTHER) -> Finding:
        """There is nothing to report, and the entry says so."""
        self.expect("value", self.entry["value"], None)
        self.expect("verdict", self.entry["verdict"], verdict)
        return self.done(own)

    def done(self, own: str, within: float | None = None, open_: bool = False, why: str = "") -> Finding:
        """The finding, when everything was compared; `open_`: nothing speaks against it, nor decides it."""
        e = self.entry
        value = e["value"]
        said = e["verdict"] if value is None else f"{value:.6g}, {e['verdict']}"
        what = f"{e['number']} {e['id']}"
        if self.wrong:
            return Finding(what, said, own, False, within, "; ".join(self.wrong))
        return Finding(
            what, said, own, None if open_ else True, within, (why or thin(self.run)) if open_ else ""
        )


def thin(run: Recorded) -> str:
    """Why steps in between leave something open."""
    period = run.scenario["rates"]["record_dt_s"]
    return f"it cannot be decided from the record at this recording period, {period:g} s"


def _between(low: float, high: float) -> str:
    if high == np.inf:
        return "nothing recorded" if low == -np.inf else f"at least {low:.4g}"
    return f"at most {high:.6g}" if low == -np.inf else f"{low:.6g} to {high:.6g}"


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)[:60]
