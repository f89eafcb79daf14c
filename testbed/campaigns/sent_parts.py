"""Parts of the user's own that travel with a job, and what tells them apart in the ids of runs."""

from __future__ import annotations

import functools
import inspect
import json
import pickle
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from testbed.campaigns.transfer import reason
from testbed.components.components import FIELDS, Parts
from testbed.components.named_parts import NamedPart
from testbed.components.provenance import is_literal
from testbed.errors import UserError
from testbed.records.run import option

Origins = dict[str, dict[str, Any]]
"""Role of a part, as `Parts` calls it -> its origin, as a manifest has it."""


@dataclass(frozen=True)
class SentParts:
    """Parts that a job takes along.

    origins  JSON of `Origins`: what they are where the job was made; a worker must have the same
    """

    parts: Parts
    origins: str

    @classmethod
    def of(cls, parts: Parts | None) -> SentParts | None:
        """The parts as a job takes them; None where all are the scenario's.

        Raises  UserError for a part that cannot be told apart by checksum, or sent to a worker
        """
        known = origins(parts)
        if parts is None or not known:
            return None
        for role in known:
            try:
                pickle.dumps(getattr(parts, role))
            except Exception as error:
                raise UserError(_refused(role, known[role], f"it cannot be sent: {reason(error)}")) from None
        return cls(parts, json.dumps(known, sort_keys=True))

    def here(self) -> Parts:
        """The parts in this process. Raises UserError if their sources are not those the job began with."""
        for role, there in json.loads(self.origins).items():
            now = origins(self.parts).get(role, {})
            if now != there:
                raise UserError(
                    f"a worker has another {there['file'] or there['name']} (SHA-256 {_short(now)}) than this"
                    f" work began with ({_short(there)})"
                )
        return self.parts


def origins(parts: Parts | None) -> Origins:
    """What tells own parts apart: part of the id of every run that they fly.

    Raises  UserError for a part without a checksum of all that it depends on
    """
    own = parts.own() if parts is not None else {}
    for role in own:
        why = _unknown(getattr(parts, role))
        if why is None and own[role].sha256 is None:
            why = "it has no source file"
        if why is not None:
            raise UserError(_refused(role, own[role].to_json(), why))
    return {role: own[role].to_json() for role in sorted(own)}


def _unknown(maker: Any) -> str | None:
    """Why a maker's file and arguments do not tell all that it depends on; None where they do."""
    if isinstance(maker, NamedPart):
        return None
    while isinstance(maker, functools.partial):
        for value in (*maker.args, *maker.keywords.values()):
            if not is_literal(value):
                return f"its argument {value!r:.40} is no literal"
        maker = maker.func
    name = getattr(maker, "__qualname__", "")
    if "<lambda>" in name:
        return "it is a lambda"
    if "<locals>" in name:
        return "it is defined inside a function"
    if not inspect.isclass(maker) and not inspect.isfunction(maker):
        return f"it is an object of class {type(maker).__name__}, whose state has no checksum"
    return None


def _refused(role: str, origin: Mapping[str, Any], why: str) -> str:
    return (
        f"{role} {origin['name']} flies in this process alone: {why}; put it into a file and name it with"
        " --parts FILE.py:NAME, or named_parts.read"
    )


def _short(origin: Mapping[str, Any]) -> str:
    return str(origin.get("sha256") or "none")[:12]


@dataclass(frozen=True)
class OwnParts:
    """The parts that a person named for a campaign, by label.

    origins  label -> role and origin; also of a campaign that is only read
    makers   label -> the part; empty where nothing will be flown
    """

    origins: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    makers: Mapping[str, NamedPart] = field(default_factory=dict)

    @classmethod
    def of(cls, named: Sequence[NamedPart]) -> OwnParts:
        made = {p.label: {"role": p.role, "origin": p.origin.to_json()} for p in named}
        return cls(made, {p.label: p for p in named})

    def identity(self, labels: Sequence[str]) -> Origins:
        """What tells the parts of these labels apart; empty for none."""
        return {FIELDS[self.origins[label]["role"]]: dict(self.origins[label]["origin"]) for label in labels}

    def parts(self, labels: Sequence[str]) -> Parts | None:
        """The parts of these labels; None for none."""
        return Parts.of([self.makers[label] for label in labels]) if labels else None

    def changed(self, recorded: Mapping[str, Mapping[str, Any]]) -> str | None:
        """Why these are not the parts that were `recorded`, in words; None if they are."""
        for label, there in recorded.items():
            here = self.origins.get(label)
            name = there["origin"].get("file") or there["origin"]["name"]
            if here is None:
                return f"with {there['role']} {label}: {option(there['origin'])}"
            if dict(here) != dict(there):
                sums = _short(there["origin"]), _short(here["origin"])
                return f"with another {name} (SHA-256 {sums[0]}, now {sums[1]}); restore it"
        if extra := [label for label in self.origins if label not in recorded]:
            return f"without {extra[0]}; leave it out of --parts"
        return None
