"""Defines a verdict: whether a run met one claim, by what margin, when, for which vehicles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Enum, StrEnum
from functools import cache
from typing import Any


class Kind(Enum):
    """What a claim is. The value is the letter with which its number begins; run files state only that."""

    PREMISE = "P"
    GUARANTEE = "G"
    OWN = "O"
    MONITOR = "M"
    FLOW = "F"
    RIVAL = "R"


class Status(StrEnum):
    """How a claim stands; the value is the word in run files.

    OPEN  the run cannot decide it: `why` says what would
    """

    HOLDS = "holds"
    VIOLATED = "violated"
    PREMISE_NOT_MET = "premise not met"
    NOT_APPLICABLE = "not applicable"
    OPEN = "open"


# Fields whose key in run files is another one.
_RENAMED = {"status": "verdict", "instant": "t_s"}


@dataclass(frozen=True, eq=False)
class Verdict(Mapping[str, Any]):
    """What was found about one claim in one run.

    id        name of the claim, e.g. separation
    number    P1.. for a premise of the theorems, G1.. for a guarantee, O1.. for what a user's own filter
              promises, M for a check by the theorem monitor, F of the flow filter, R1.. of a rival
    kind      which of these; not a key of run files, where `number` tells it
    claim     the claim in words
    source    where the paper makes it
    quantity  what `value` is, in words
    unit      of value, bound and margin; "" for a share or a count
    value     the worst seen; None if there is none
    bound     what it is compared with
    margin    distance from value to bound, negative on the wrong side
    instant   s, when the worst was seen
    vehicles  that it was seen at, counted from 1
    why       reason, in words
    detail    further numbers, by name
    It can be read like a dictionary with the keys of run files: verdict["verdict"] is status, verdict["t_s"]
    is instant, all others are named as the fields.
    """

    id: str
    number: str
    kind: Kind
    claim: str
    source: str
    quantity: str
    unit: str
    value: float | None = None
    bound: float | None = None
    margin: float | None = None
    instant: float | None = None
    vehicles: tuple[int, ...] = ()
    status: Status = Status.NOT_APPLICABLE
    why: str = ""
    detail: Mapping[str, Any] = field(default_factory=dict)

    def but(self, **changes: Any) -> Verdict:
        """The same verdict with some fields changed."""
        return replace(self, **changes)

    def to_json(self) -> dict[str, Any]:
        """The entry of run files, with their keys in their order."""
        entry = {key: getattr(self, name) for key, name in _keys().items()}
        return entry | {
            "vehicles": list(self.vehicles),
            "verdict": self.status.value,
            "detail": dict(self.detail),
        }

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> Verdict:
        """The verdict that an entry of a run file states; ValueError if it states none."""
        keys = _keys()
        if entry.keys() != keys.keys():
            raise ValueError(f"not the keys of a verdict: {', '.join(sorted(keys.keys() ^ entry.keys()))}")
        said = {name: entry[key] for key, name in keys.items()}
        said["vehicles"] = tuple(entry["vehicles"])
        return cls(kind=Kind(entry["number"][:1]), **said | {"status": Status(entry["verdict"])})

    def __getitem__(self, key: str) -> Any:
        return self.to_json()[key]

    def __iter__(self) -> Iterator[str]:
        return iter(_keys())

    def __len__(self) -> int:
        return len(_keys())


@cache
def _keys() -> dict[str, str]:
    """Key of run files -> field."""
    return {_RENAMED.get(f.name, f.name): f.name for f in fields(Verdict) if f.name != "kind"}
